"""``rigsight init --mjcf`` and ``rigsight export --to mjcf``: from a robot's model to a rig file, and back."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rigsight.rigs import read_rig_file
from rigsight.rigs.reading.rig_file import rig_of_text

Run = Callable[..., tuple[int, str, str]]
CART = Path(__file__).parents[1] / "robots" / "models" / "cart_pole.xml"


def test_a_model_becomes_a_rig_file_and_a_campaign_once_records_are_there(tmp_path: Path, run: Run) -> None:
    folder = tmp_path / "stage"
    code, stdout, stderr = run("init", folder, "--mjcf", CART)
    assert (code, stderr) == (0, "Equations of 2 coordinates ...\n")
    assert f"Written: {folder / 'cart_pole.toml'} (2 joints)" in stdout
    assert "agrees with MuJoCo, without dry friction" in stdout
    assert "columns t, push_ctrl, slider_position, hinge_angle" in stdout
    rig_file = folder / "cart_pole.toml"
    assert read_rig_file(rig_file).name == "cart_pole"
    assert "[parameters.NAME]" in stdout
    released = rig_file.read_text("utf-8").replace("[constants.hinge_inertia]", "[parameters.hinge_inertia]")
    assert "hinge_inertia" in {p.name for p in rig_of_text(released).parameters}
    t = 0.01 * np.arange(200)
    rows = np.column_stack([t, np.sin(t), 0.1 * np.sin(t), 0.3 + 0.01 * np.sin(t)])
    np.savetxt(
        folder / "a.csv", rows, delimiter=",", header="t,push_ctrl,slider_position,hinge_angle", comments=""
    )
    code, stdout, stderr = run("init", folder, "--mjcf", CART)
    assert (code, stderr) == (0, "Equations of 2 coordinates ...\nReading files ...\n")
    campaign = (folder / "campaign.toml").read_text("utf-8")
    assert 'file = "cart_pole.toml"' in campaign
    assert "slider_frictionloss = 0.2 " in campaign
    assert 'hold = "zoh"' in campaign
    code, _, stderr = run("init", folder, "--mjcf", CART)
    assert code == 2
    assert "campaign.toml exists already and is not overwritten" in stderr


def test_machines_are_told_what_was_left_out(tmp_path: Path, run: Run) -> None:
    model = tmp_path / "robot.xml"
    limited = CART.read_text("utf-8").replace('damping="0.5"', 'damping="0.5" range="-1 1" limited="true"')
    model.write_text(limited, "utf-8")
    code, stdout, _ = run("init", tmp_path, "--mjcf", model, "--json")
    reported = json.loads(stdout)
    assert code == 0
    assert reported["left_out"] == [
        "range of joints: slider; the rig has no end stops there; use the effect end_stop"
    ]
    assert max(reported["free_run"]["relative_difference"].values()) < 1e-5


def test_a_rig_that_does_not_move_as_mujoco_does_is_told_even_where_nothing_else_is(
    tmp_path: Path, run: Run
) -> None:
    model = tmp_path / "robot.xml"
    limp = CART.read_text("utf-8").replace(
        "<worldbody>", '<option><flag damper="disable"/></option><worldbody>'
    )
    model.write_text(limp, "utf-8")
    code, stdout, stderr = run("init", tmp_path / "stage", "--mjcf", model, "--quiet")
    assert (code, stdout) == (0, "")
    assert "the free run of the rig differs from MuJoCo" in stderr
    head = (tmp_path / "stage" / "robot.toml").read_text("utf-8")
    assert "# - the option that switches off damping of joints, which the rig has" in head


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["init", "--mjcf", "missing.xml"], "missing.xml"),
        (["init", "--mjcf", CART, "--model", "axis"], "leave out --model"),
        (["init", "--mjcf", CART, "--gear", "hinge"], "JOINT=STIFFNESS"),
        (["init", "--mjcf", CART, "--gear", "slidr=1"], "Did you mean 'slider'"),
        (["init", "--mjcf", CART, "--gear", "slider=-1"], "must be positive, got -1"),
        (["init", "--mjcf", CART, "--gear", "slider=100"], "has no armature"),
        (["init", "--mjcf", CART, "--lock", "hinge"], "JOINT=POSITION"),
        (["init", "--mjcf", CART, "--lock", "slidr=1"], "Did you mean 'slider'"),
        (["init", "--mjcf", CART, "--lock", "slider=nan"], "must be finite"),
        (["init", "--mjcf", CART, "--lock", "slider=0", "--lock", "hinge=0"], "nothing moves"),
        (["init", "--lock", "slider=0"], "name the model with --mjcf"),
        (["init", CART, "--mjcf", CART], "a file is in the way"),
        (["init", "--gear", "slider=100"], "name the model with --mjcf"),
        (["init"], "Name the FOLDER"),
        (["export", "MODEL", "--to", "mjcf"], "name the MJCF or URDF file"),
        (["export", "MODEL", "--to", "mjcf", "--mjcf", CART], "has a joint"),
        (["export", "MODEL", "--to", "mjcf", "--mjcf", CART, "--hold", "zoh"], "do not apply to mjcf"),
        (["export", "MODEL", "--to", "c", "--mjcf", CART], "leave it out for c"),
        (["export", "MODEL", "--to", "mjcf", "--usd", "cart.usda"], "leave it out for mjcf"),
        (["export", "MODEL", "--to", "usd", "--usd", "cart.usda"], "name the MJCF or URDF file"),
    ],
)
def test_what_cannot_be_is_one_message(
    arguments: list[object],
    said: str,
    write_model: Callable[..., Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    run: Run,
) -> None:
    monkeypatch.chdir(tmp_path)
    code, stdout, stderr = run(*(write_model() if one == "MODEL" else one for one in arguments))
    assert (code, stdout) == (2, "")
    assert said in stderr
    assert not list(tmp_path.glob("*.xml"))


def test_a_model_of_the_robot_is_written_back(tmp_path: Path, run: Run) -> None:
    run("init", tmp_path, "--mjcf", CART, "-q")
    rig = read_rig_file(tmp_path / "cart_pole.toml")
    model = tmp_path / "model.json"
    model.write_text(
        json.dumps(
            {
                "schema_version": 1,
                "rig": rig.name,
                "declaration": dict(rig.declaration),
                "hold": "zoh",
                "constants": {p.name: p.default for p in rig.constants},
                "parameters": {p.name: p.default for p in rig.parameters} | {"slider_damping": 0.7},
                "effects": ["input_delay@push"],
                "effect_parameters": {"T_d": 0.01},
            }
        ),
        "utf-8",
    )
    out = tmp_path / "corrected.xml"
    code, stdout, stderr = run("export", model, "--to", "mjcf", "--mjcf", CART, "--out", out)
    assert (code, stderr) == (0, "")
    assert "Written: joint 'slider' damping: 0.5 -> 0.7" in stdout
    assert "Written: actuator 'push' delay: input_delay at push (T_d = 0.01)" in stdout
    assert 'delay="0.01"' in out.read_text("utf-8")
    code, stdout, _ = run("export", model, "--to", "isaac", "--mjcf", CART, "--out", tmp_path / "cart.yaml")
    assert code == 0
    assert "friction: 0.2" in (tmp_path / "cart.yaml").read_text("utf-8")
    layer = tmp_path / "cart.usda"
    code, stdout, stderr = run(
        "export", model, "--to", "usd", "--mjcf", CART, "--out", layer, "--step", "0.005", "--json"
    )
    assert (code, stderr) == (0, "")
    assert "input_delay at push (T_d = 0.01)" in json.loads(stdout)["written"]
    assert "int newton:delaySteps = 2" in layer.read_text("utf-8")
    for usd, said in (
        (tmp_path / "missing.usda", "does not exist"),
        (layer, "is the model of the robot itself"),
    ):
        code, _, stderr = run("export", model, "--to", "usd", "--mjcf", CART, "--usd", usd, "--out", layer)
        assert code == 2
        assert said in stderr
    code, _, stderr = run("export", model, "--to", "isaac", "--mjcf", CART, "--step", "0")
    assert code == 2
    assert "--step must lie in" in stderr


@pytest.mark.slow
def test_bodies_are_left_to_mujoco_with_what_binds_them(tmp_path: Path, run: Run) -> None:
    model, folder = tmp_path / "robot.xml", tmp_path / "stage"
    limited = CART.read_text("utf-8").replace('damping="0.5"', 'damping="0.5" range="-1 1" limited="true"')
    model.write_text(limited, "utf-8")
    folder.mkdir()
    t = 0.01 * np.arange(200)
    rows = np.column_stack([t, np.sin(t), 0.1 * np.sin(t), 0.3 + 0.01 * np.sin(t)])
    np.savetxt(
        folder / "a.csv", rows, delimiter=",", header="t,push_ctrl,slider_position,hinge_angle", comments=""
    )
    code, stdout, _ = run("init", folder, "--mjcf", model, "--as-it-is")
    assert code == 0
    assert "agrees with MuJoCo" in stdout
    assert "Not taken over" not in stdout
    text = (folder / "robot.toml").read_text("utf-8")
    assert '[simulator]\nkind = "mujoco"\nfile = "../robot.xml"' in text
    campaign = folder / "campaign.toml"
    assert 'simulator = "mujoco"' in campaign.read_text("utf-8")
    said = campaign.read_text("utf-8")
    campaign.write_text(said.replace('simulator = "mujoco"', 'simulator = "fmu"'), "utf-8")
    code, _, stderr = run("identify", folder, "--out", tmp_path / "out")
    assert code == 2
    assert "simulator is 'fmu', but the rig file simulates its bodies with mujoco" in stderr
    campaign.write_text(said.replace('simulator = "mujoco"', "#"), "utf-8")
    code, _, stderr = run("identify", folder, "--out", tmp_path / "out")
    assert code == 2
    assert 'write simulator = "mujoco"' in stderr


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--mjcf", CART, "--as-it-is", "--gear", "hinge=50"), "a gear splits a joint in two"),
        (("--mjcf", CART, "--as-it-is", "--lock", "hinge=0"), "weld the joint in the file"),
        (("--as-it-is",), "--as-it-is applies only to the model of a robot"),
    ],
)
def test_options_that_contradict_each_other_are_told(
    options: tuple[object, ...], message: str, tmp_path: Path, run: Run
) -> None:
    code, stdout, stderr = run("init", tmp_path, *options)
    assert (code, stdout) == (2, "")
    assert message in stderr

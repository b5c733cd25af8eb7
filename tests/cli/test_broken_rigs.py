"""Whatever is wrong with a rig of the user's own, one message names it and how to mend it, and nothing is left behind."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rigsight.rigs import rig_file_text
from rigsight.workflow.campaign.in_memory import make_model
from rigsight.workflow.run.results import json_text

from ..workflow.any_rig import CURRENT, TRAIN, simulated, write_record, write_train_campaign

Run = Callable[..., tuple[int, str, str]]
Change = Callable[[Path], object]
toml, train = "campaign.toml", "train.toml"


def replaced(file: str, old: str, new: str) -> Change:
    def change(folder: Path) -> None:
        path = folder / file
        text = path.read_text(encoding="utf-8")
        assert old in text
        path.write_text(text.replace(old, new, 1), encoding="utf-8")

    return change


def columns(*names: str) -> Change:
    """Write the first record with these columns alone; a name behind ``=`` is another one for the signal in front."""

    def change(folder: Path) -> None:
        record = simulated("drive_train", TRAIN, CURRENT)
        write_record(folder / "both.csv", record, [name.partition("=")[0] for name in names])
        renamed = ["t", *(name.rpartition("=")[2] for name in names)]
        lines = (folder / "both.csv").read_text().split("\n")
        (folder / "both.csv").write_text("\n".join([",".join(renamed), *lines[1:]]))

    return change


def linked(folder: Path) -> None:
    outside = folder.parent / "elsewhere.toml"
    outside.write_text(rig_file_text("drive_train"), encoding="utf-8")
    (folder / train).unlink()
    (folder / train).symlink_to(outside)


FILE = 'file = "train.toml"'
BROKEN: dict[str, tuple[Change, tuple[str, ...]]] = {
    "neither model nor file": (replaced(toml, FILE, ""), ("rig.model: is missing", "rigsight rigs lists")),
    "both": (replaced(toml, FILE, f'{FILE}\nmodel = "servo"'), ("rig.file: cannot be given together with rig.model",)),
    "unknown rig": (replaced(toml, FILE, 'model = "drive_tran"'), ("Did you mean 'drive_train'", "two_link_arm")),
    "no rig file": (replaced(toml, "train.toml", "trian.toml"), ("rig.file", "Did you mean 'train.toml'")),
    "rig file outside": (replaced(toml, "train.toml", "../train.toml"), ("rig.file", "lies outside the campaign's")),
    "rig file linked": (linked, ("rig.file", "is a link to a file outside")),
    "rig file is a folder": (replaced(toml, "train.toml", "."), ("rig.file", "does not exist")),
    "rig file no toml": (replaced(train, "[energy]", "[energy"), ("train.toml", "not valid TOML", "line")),
    "rig file with a slip": (replaced(train, '"phi_m - phi_l"', '"phi_m - phi_x"'), ("train.toml, line", "phi_x")),
    "rig name no name": (replaced(train, '"train"', '"../train"'), ("train.toml, line 1, column 8: name", "letters")),
    "two roots in units": (replaced(train, 'damping = "d_s"', 'damping = "k_s"'), ("joints.shaft.damping",)),
    "effect without its place": (
        replaced(toml, "cubic_stiffness@shaft", "cubic_stiffness"),
        ("several places of train", "cubic_stiffness@load_bearing"),
    ),
    "effect at no place": (
        replaced(toml, "@shaft", "@shaff"),
        ("'cubic_stiffness@shaff'", "Did you mean 'shaft'", "motor_bearing"),
    ),
    "effect at a wrong kind of place": (replaced(toml, "@shaft", "@motor_angle"), ("Its places: shaft",)),
    "unknown effect at a place": (replaced(toml, "cubic_", "cubik_"), ("Did you mean 'cubic_stiffness'",)),
    "effect without its number": (replaced(toml, "k_3 = 300.0", ""), ("rig.parameters.k_3: is missing",)),
    "unknown constant of a record": (replaced(toml, "{ k_t", "{ k_tt"), ("record 2", "constants.k_tt", "'k_t'")),
    "constant as text": (replaced(toml, "0.06", '"0.06"'), ("record 2", "constants.k_t", "must be a number")),
    "no sensor at all": (columns("u"), ("none of the outputs motor_angle, load_angle", "'u'")),
    "sensor under another name": (columns("u", "motor_angle=angle", "load_angle=l"), ("none of the outputs",)),
    "input under another name": (columns("u=current", "motor_angle"), ("no column 'u'", "Is it 'current'")),
    "sweep without its input": (
        lambda f: (columns("motor_angle")(f), replaced(toml, '"both.csv"', '"both.csv"\nkind = "sweep"')(f)),
        ("no column 'u'", "inputs = { u = 0.0 }"),
    ),
    "mapping of no signal": (
        replaced(toml, '"both.csv"', '"both.csv"\ncolumns = { psi = "u" }'),
        ("columns.psi: is not a signal of train", "motor_angle"),
    ),
    "constant of no input": (
        replaced(toml, '"both.csv"', '"both.csv"\ninputs = { v = 1.0 }'),
        ("inputs.v: is not an input of train", "Inputs: u"),
    ),
    "constant beside its column": (
        replaced(toml, '"both.csv"', '"both.csv"\ninputs = { u = 1.0 }\ncolumns = { u = "u" }'),
        ("inputs.u: cannot be given together with columns.u",),
    ),
    "sensors that never move": (
        lambda f: np.savetxt(f / "both.csv", np.ones((80, 3)) * np.arange(80)[:, None] * [[0.01, 1.0, 0.0]],
                             delimiter=",", header="t,u,motor_angle", comments=""),
        ("motor_angle never changes",),
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_rig_or_campaign_gets_one_helpful_message(case: str, tmp_path: Path, run: Run) -> None:
    folder = tmp_path / "campaign"
    folder.mkdir()
    change, expected = BROKEN[case]
    change(write_train_campaign(folder))
    code, stdout, stderr = run("diagnose", folder, "--out", tmp_path / "out")
    assert (code, stdout) == (2, ""), stderr
    assert stderr.startswith("rigsight: ")
    assert stderr.count("\n") == 1, stderr
    assert "Traceback" not in stderr
    for part in expected:
        assert part in stderr
    assert not (tmp_path / "out").exists()


@pytest.fixture
def model(tmp_path: Path) -> Path:
    path = tmp_path / "model.json"
    path.write_text(json_text(make_model("drive_train", TRAIN).to_json()), encoding="utf-8")
    return path


def two_of_a_name(folder: Path) -> list[object]:
    (folder / "a.toml").write_text(rig_file_text("servo"), encoding="utf-8")
    return ["--rigs", folder / "a.toml"]


def changed(folder: Path, old: str, new: str) -> Path:
    text = (folder / "model.json").read_text(encoding="utf-8")
    assert old in text
    (folder / "model.json").write_text(text.replace(old, new, 1), encoding="utf-8")
    return folder / "model.json"


COMMANDS: dict[str, tuple[Callable[[Path], list[object]], tuple[str, ...]]] = {
    "a rig of a taken name": (lambda f: ["rigs", *two_of_a_name(f)], ("a.toml", "a built-in rig")),
    "no rig file": (lambda f: ["rigs", "--rigs", f / "b.toml"], ("b.toml does not exist",)),
    "a rig that there is not": (lambda f: ["rigs", "hoist"], ("Rig is 'hoist'", "'servo'")),
    "a proposal for no rig": (lambda f: ["init", f, "--model", "hoist"], ("--model is 'hoist'", "'servo'")),
    "another rig than declared": (
        lambda f: ["simulate", changed(f, '"rig": "drive_train"', '"rig": "servo"'), f / "both.csv"],
        ("model.json: rig: is 'servo'", "'drive_train'"),
    ),
    "a slip in the declaration": (
        lambda f: ["simulate", changed(f, '"stiffness": "k_s"', '"stiffness": "k_x"'), f / "both.csv"],
        ("model.json: declaration: joints.shaft.stiffness", "k_x"),
    ),
    "a declaration that is none": (
        lambda f: ["simulate", changed(f, '"declaration": {', '"declaration": {"x": 1,'), f / "both.csv"],
        ("model.json: declaration: x", "not a key"),
    ),
    "an unknown state": (
        lambda f: ["simulate", f / "model.json", f / "both.csv", "--initial-state", "phi=1"],
        ("Initial state 'phi'", "phi_m", "motor_angle"),
    ),
    "an unknown constant": (
        lambda f: ["simulate", f / "model.json", f / "both.csv", "--constant", "k_q=1"],
        ("constants.k_q: unknown to drive_train", "k_t"),
    ),
    "a constant that is no number": (
        lambda f: ["simulate", f / "model.json", f / "both.csv", "--constant", "k_t=much"],
        ("--constant 'k_t=much'", "is not a number"),
    ),
}


@pytest.mark.parametrize("case", COMMANDS)
def test_a_wrong_command_gets_one_helpful_message(
    case: str, model: Path, tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    columns("u", "motor_angle")(tmp_path)
    asked, expected = COMMANDS[case]
    arguments = asked(tmp_path)
    before = set(tmp_path.iterdir())
    code, stdout, stderr = run(*arguments)
    assert (code, stdout) == (2, ""), stderr
    assert stderr.startswith("rigsight: ")
    assert stderr.count("\n") == 1, stderr
    for part in expected:
        assert part in stderr
    assert set(tmp_path.iterdir()) == before

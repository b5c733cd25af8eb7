"""A user's own effect, from a file or a package, competes, is written, and runs again."""

from __future__ import annotations

import importlib
import json
import re
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rigsight import cli
from rigsight.effects import CATALOGUE, Effect, effect_named
from rigsight.errors import InputError
from rigsight.excitation import linear_sweep
from rigsight.records import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.diagnose import run_diagnose
from rigsight.workflow.own.own_effects import equation_text, named, own_effects
from rigsight.workflow.simulate import run_simulate

DOCS = Path(__file__).parents[3] / "docs"
EXAMPLE = DOCS / "examples" / "my_effects.py"
VALUES = {"gain": 1.0, "m": 2.0, "d": 5.0, "k": 800.0, "x_off": 0.0, "force_off": 0.0, "k_5": 6e10}
CAMPAIGN = """\
[rig]
model = "axis"

[[records]]
file = "fit.csv"
role = "estimation"
kind = "sweep"

[[records]]
file = "score.csv"
role = "validation"
kind = "sweep"
"""


@pytest.fixture(scope="module")
def quintic() -> Effect:
    (effect,) = own_effects([EXAMPLE])
    return effect


@pytest.fixture
def campaign(tmp_path: Path, quintic: Effect) -> Path:
    """The folder of a campaign on an axis whose spring hardens with the fifth power."""
    folder = tmp_path / "stage"
    folder.mkdir()
    (folder / "campaign.toml").write_text(CAMPAIGN)
    t = 5e-3 * np.arange(2000)
    for seed, (file, amplitude) in enumerate({"fit.csv": 4.0, "score.csv": 3.0}.items()):
        u = np.concatenate([np.zeros(200), linear_sweep(t[200:], amplitude, 3.0, 60.0)])
        record = simulate(compose(AXIS, [quintic]), VALUES, Record("sweep", 5e-3, {"u": u}, {}))
        x = record["x"] + np.random.default_rng(seed).normal(scale=2e-5, size=t.size)
        rows = np.column_stack([t, u, x])
        np.savetxt(folder / file, rows, delimiter=",", header="t,u,x", comments="")
    return folder


def written(tmp_path: Path, change: Callable[[str], str]) -> Path:
    text = EXAMPLE.read_text("utf-8")
    path = tmp_path / "mine.py"
    path.write_text(change(text), encoding="utf-8")
    assert path.read_text("utf-8") != text
    return path


def test_the_page_shows_the_example_that_is_tested():
    shown = re.search(r"```python\n(.*?)```", (DOCS / "own_effects.md").read_text("utf-8"), re.DOTALL)
    assert shown is not None
    assert shown.group(1) == EXAMPLE.read_text("utf-8")


@pytest.mark.slow
def test_the_example_wins_against_its_nearest_relatives(campaign: Path, tmp_path: Path, quintic: Effect):
    rivals = named(["cubic_stiffness", "quintic_stiffness"], [quintic])
    out = tmp_path / "out"
    diagnosis = run_diagnose(campaign, out, effects=rivals, n_jobs=1)
    assert (diagnosis.verdict, diagnosis.effects) == ("effect", ("quintic_stiffness",))
    found = diagnosis.candidates[0].parameters["k_5"]
    assert found.unit == "N/m^5"
    assert found.value == pytest.approx(VALUES["k_5"], abs=4 * found.std)
    page = (out / "report.html").read_text(encoding="utf-8")
    assert quintic.summary in page
    assert "<mn>5</mn></msup>" in page, "the report shows the declared torque"
    model = json.loads((out / "model.json").read_text())
    assert model["effects"] == ["quintic_stiffness"]
    with pytest.raises(InputError, match=r"'quintic_stiffness' is unknown.*--effects FILE"):
        run_simulate(out / "model.json", campaign / "score.csv")
    again = run_simulate(out / "model.json", campaign / "score.csv", own_effects=[quintic])
    trace = next(trace for trace in diagnosis.traces if trace.record == "score")
    assert np.std(again["x"] - trace.after["x"]) < 1e-2 * np.std(trace.measured["x"])


def test_the_given_simulation_may_have_the_effect_already(campaign: Path, quintic: Effect):
    toml = campaign / "campaign.toml"
    text = CAMPAIGN.replace(
        '"axis"\n', '"axis"\neffects = ["quintic_stiffness"]\n\n[rig.parameters]\nk_5 = 6e10\n'
    )
    toml.write_text(text)
    assert read_campaign(toml, [quintic]).modelled == (quintic,)
    with pytest.raises(InputError, match="'quintic_stiffness' is unknown"):
        read_campaign(toml)


@pytest.mark.parametrize(
    ("change", "reported"),
    [
        (lambda text: text.replace("x**5", "x**5 +"), r"^mine\.py, line 18: is not valid Python"),
        (lambda text: text + "\n1 / 0\n", r"^mine\.py, line 21: running the file failed: ZeroDivisionError"),
        (lambda text: "raise SystemExit\n" + text, r"^mine\.py, line 1: running the file failed: SystemExit"),
        (lambda _: "a = 1\n", r"^mine\.py: declares no effect"),
        (lambda _: "from rigsight.effects.catalogue import CUBIC_STIFFNESS\n", "declares no effect"),
        (
            lambda text: text.replace("quintic_stiffness", "cubic_stiffness"),
            r"^mine\.py, line 9: the effect name 'cubic_stiffness' is used by the catalogue",
        ),
        (
            lambda text: text + "import dataclasses\nTWIN = dataclasses.replace(QUINTIC_STIFFNESS)\n",
            r"^mine\.py, line 21: the effect name 'quintic_stiffness' is used by mine\.py, line 9",
        ),
        (
            lambda text: text.replace("starts=(0.3,)", "starts=()"),
            r"^mine\.py, line 9: effect 'quintic_stiffness': parameter k_5: starts is empty",
        ),
        (
            lambda text: text.replace("    energy=", '    starts=(Start({}, parent="nobody"),),\n    energy=').replace(
                "Signature\n", "Signature, Start\n"
            ),
            "starts from 'nobody', which is not a known effect",
        ),
    ],
)  # fmt: skip
def test_a_file_that_cannot_be_used_is_told_with_its_line(tmp_path: Path, change, reported: str):
    with pytest.raises(InputError, match=reported):
        own_effects([written(tmp_path, change)], check=False)


def test_files_that_are_none_are_told(tmp_path: Path):
    with pytest.raises(InputError, match="does not exist; --effects expects a Python file"):
        own_effects([tmp_path / "nowhere.py"])
    with pytest.raises(InputError, match="is a folder"):
        own_effects([tmp_path])
    binary = tmp_path / "binary.py"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="is not UTF-8 text"):
        own_effects([binary])
    other = tmp_path / "rig.toml"
    other.write_text("raise_what = 1", "utf-8")
    with pytest.raises(InputError, match=r"\.py"):
        own_effects([other])


def test_a_file_named_twice_is_read_once(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(EXAMPLE.parent)
    assert len(own_effects([EXAMPLE, EXAMPLE.name], check=False)) == 1


def entry_points(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, value: str) -> None:
    """Let a package `offers_effects` be installed that has one entry point."""
    (tmp_path / "offered.py").write_text(EXAMPLE.read_text("utf-8") + "\nNUMBER = 3\n")
    info = tmp_path / "offers_effects-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: offers-effects\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[rigsight.effects]\nmine = {value}\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "offered", raising=False)
    importlib.invalidate_caches()


def test_an_installed_package_offers_its_effects(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    entry_points(monkeypatch, tmp_path, "offered:QUINTIC_STIFFNESS")
    (effect,) = own_effects(check=False)
    assert effect.name == "quintic_stiffness"
    assert named([], [effect]) == (*CATALOGUE, effect)


@pytest.mark.parametrize(
    ("value", "reported"),
    [
        ("offered:NUMBER", r"offers-effects \(entry point mine\): is a int, not an Effect"),
        ("nowhere:EFFECT", r"offers-effects \(entry point mine\): cannot be loaded: ModuleNotFoundError"),
    ],
)
def test_a_package_with_another_thing_is_told(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, value, reported
):
    entry_points(monkeypatch, tmp_path, value)
    with pytest.raises(InputError, match=reported):
        own_effects()


def run(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int | str | None:
    monkeypatch.setattr(sys, "argv", ["rigsight", *map(str, arguments)])
    try:
        cli.main()
    except SystemExit as leaving:
        return leaving.code
    return 0


def test_the_command_lists_the_catalogue_and_checks_a_file(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
):
    assert not run(monkeypatch, "effects", "--effects", EXAMPLE)
    shown = capsys.readouterr().out
    for effect in CATALOGUE:
        assert re.search(rf"^{effect.name} +{effect.place.value} ", shown, re.MULTILINE), effect.name
    assert "resisting torque = k_5 x^5" in shown
    assert run(monkeypatch, "effects", "--effects", written(tmp_path, lambda text: text + "1 / 0\n")) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert captured.err.startswith("rigsight: mine.py, line 20: ")


def test_the_command_line_runs_a_model_with_an_effect_of_ones_own(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], write_model, axis_campaign: Path, tmp_path: Path
):  # fmt: skip
    model = write_model(
        lambda m: m.update(effects=["quintic_stiffness"], effect_parameters={"k_5": 1e9}, units={"k_5": "N/m^5"})
    )  # fmt: skip
    arguments = ("simulate", model, axis_campaign / "fit.csv", "--out", tmp_path / "simulated.csv")
    assert run(monkeypatch, *arguments) == 2
    assert "name the file that declares it" in capsys.readouterr().err
    assert not run(monkeypatch, *arguments, "--effects", EXAMPLE)
    assert (tmp_path / "simulated.csv").is_file()


def test_equations_are_plain_text_in_one_line():
    assert equation_text(effect_named("cubic_stiffness")) == "resisting torque = k_3 x^3"
    assert equation_text(effect_named("input_delay")) == "drive = u(t - T_d)"
    assert equation_text(effect_named("backlash")) == "deflection of the spring = x - z, z' = v within +-g"

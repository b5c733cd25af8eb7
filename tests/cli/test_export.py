"""What ``rigsight export`` writes, and how it refuses models, targets and files."""

from __future__ import annotations

import importlib.util
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from rigsight.export import TARGETS
from rigsight.export.targets import DELAY
from rigsight.workflow.export import ROBOT_TARGETS

FMUS = {name for name, target in TARGETS.items() if target.suffix == ".fmu"}
Run = Callable[..., tuple[int, str, str]]


PARTS = {
    "python": "def simulate(t, u,",
    "control": "system = control.NonlinearIOSystem(",
    "c": "int stage_step(stage_model *m",
    "matlab": "function [outputs, states] = stage(t, u,",
    "latex": r"\begin{align*}",
    "modelica": "model stage ",
}
"""Words that show the language; of another target its own name is looked for."""


@pytest.mark.parametrize("target", [name for name in TARGETS if name not in FMUS])
def test_a_file_is_written_and_named(
    target: str, write_model: Callable[..., Path], tmp_path: Path, run: Run
) -> None:
    out = tmp_path / "new" / f"stage{TARGETS[target].suffix}"
    code, stdout, stderr = run("export", write_model(), "--to", target, "--out", out)
    assert (code, stderr) == (0, "")
    assert stdout == f"{target}: {out}\n"
    assert PARTS.get(target, "stage" if TARGETS[target].named else "") in out.read_text(encoding="utf-8")


def test_help_names_every_target(run: Run) -> None:
    """Help cannot read `TARGETS`: it would take a second to load."""
    _, text, _ = run("export", "--help")
    described = {
        option.split()[0]: set(re.findall(r"\w+", option)) for option in re.split(r"\n  (?=-)", text)
    }
    stepping = {name for name, target in TARGETS.items() if target.fixed_step}
    for option, expected in (("--to", {*TARGETS, *ROBOT_TARGETS}), ("--step", stepping)):
        missing = expected - described[option]
        assert not missing, f"Name {missing} in the help of {option} in cli/model_use.py."


def test_the_folder_of_a_model_and_a_default_name_do(
    write_model: Callable[..., Path], monkeypatch: pytest.MonkeyPatch, tmp_path: Path, run: Run
) -> None:
    folder = write_model().parent
    monkeypatch.chdir(tmp_path)
    code, stdout, _ = run("export", folder, "--to", "c", "--quiet")
    assert (code, stdout) == (0, "")
    text = (tmp_path / "axis.c").read_text(encoding="utf-8")
    assert f"{folder.name}/model.json" in text
    assert str(folder) not in text


def test_hold_and_step_are_passed_on(write_model: Callable[..., Path], tmp_path: Path, run: Run) -> None:
    model = write_model(lambda m: m.update(hold="band_limited"))
    out = tmp_path / "stage.py"
    assert run("export", model, "--to", "python", "--out", out)[0] == 2
    code, _, _ = run("export", model, "--to", "python", "--out", out, "--hold", "zoh", "--step", "0.00125")
    assert code == 0
    text = out.read_text(encoding="utf-8")
    assert "MAX_STEP = 0.00125" in text
    assert "constant from each sample to the next" in text


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--to", "matlap"], "Target is 'matlap'. Did you mean 'matlab'"),
        (
            ["--to", "c", "--out", "stage.txt"],
            "stage.txt has the wrong suffix for c: name a file that ends in .c",
        ),
        (["--to", "c", "--out", "."], "it is a folder"),
        (["--to", "c", "--out", "1st.c"], "'1st' cannot be the name"),
        (["--to", "c", "--out", "model.json/stage.c"], "model.json is a file"),
        (["--to", "python", "--source-only"], "--source-only is of an FMU"),
        (["--to", "python", "--step", "-1"], "--step must lie in"),
        (["--to", "c", "--step", "0.001"], "--step is of python, matlab"),
        (["--to", "c", "--hold", "spline"], "--hold is 'spline'"),
    ],
)
def test_what_cannot_be_used_gets_one_message_and_leaves_nothing(
    arguments: list[str],
    expected: str,
    write_model: Callable[..., Path],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    run: Run,
) -> None:
    model = write_model()
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.iterdir())
    code, stdout, stderr = run("export", model.name, *arguments)
    assert code == 2
    assert stdout == ""
    assert stderr.startswith("rigsight: ")
    assert expected in stderr
    assert "Traceback" not in stderr
    assert sorted(tmp_path.iterdir()) == before


def test_a_broken_model_is_told_as_by_simulate(
    write_model: Callable[..., Path], tmp_path: Path, run: Run
) -> None:
    model = write_model(lambda m: m["parameters"].update(m=-1.0))
    code, _, stderr = run("export", model, "--to", "c", "--out", tmp_path / "stage.c")
    assert code == 2
    assert stderr.startswith("rigsight: model.json: parameters.m")
    assert not (tmp_path / "stage.c").exists()


def test_an_effect_that_a_target_cannot_say_is_named(
    write_model: Callable[..., Path], tmp_path: Path, run: Run
) -> None:
    model = write_model(lambda m: m.update(effects=["input_delay"], effect_parameters={"T_d": 0.1}, units={}))
    code, _, stderr = run("export", model, "--to", "control", "--out", tmp_path / "stage.py")
    assert code == 2
    assert "'input_delay' cannot be exported to control" in stderr
    able = ", ".join(name for name, target in TARGETS.items() if DELAY not in target.lacks)
    assert f"Targets with it: {able}." in stderr


def test_without_a_compiler_an_fmu_of_sources_is_offered(
    write_model: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, run: Run
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    # The wheel of zig, where it is installed, needs no PATH.
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    model, out = write_model(), tmp_path / "stage.fmu"
    code, _, stderr = run("export", model, "--to", "fmu", "--out", out)
    assert code == 2
    assert "No C compiler was found" in stderr
    assert not out.exists()
    assert run("export", model, "--to", "fmu", "--out", out, "--source-only")[0] == 0
    assert out.read_bytes().startswith(b"PK")


def test_an_effect_of_one_s_own_is_exported(
    write_model: Callable[..., Path], tmp_path: Path, run: Run
) -> None:
    example = Path(__file__).parents[2] / "docs" / "examples" / "my_effects.py"
    model = write_model(
        lambda m: m.update(effects=["quintic_stiffness"], effect_parameters={"k_5": 6e10}, units={})
    )
    out = tmp_path / "stage.c"
    code, _, stderr = run("export", model, "--to", "c", "--out", out, "--effects", example)
    assert code == 0, stderr
    assert "k_5" in out.read_text(encoding="utf-8")

"""What ``rigsight identify`` leaves and tells, and which options it refuses."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

Run = Callable[..., tuple[int, str, str]]


def test_identify_leaves_all_results_and_shows_the_table(
    axis_campaign: Path, tmp_path: Path, run: Run
) -> None:
    out = tmp_path / "out"
    code, stdout, stderr = run("identify", axis_campaign, "-o", out, "-j", "1")
    assert code == 0, stderr
    figures = ["amplitudes.svg", "bode_fit.svg", "responses.svg"]
    assert sorted(path.name for path in out.iterdir()) == sorted(
        [*figures, "identification.html", "identification.json", "model.json"]
    )
    for part in ("amplitude [input]", "k [N/m]", "resonance [rad/s]", "Only one estimation record", "score"):
        assert part in stdout
    assert json.loads((out / "identification.json").read_text())["schema_version"] == 1
    code, _, stderr = run("simulate", out, axis_campaign / "score.csv", "-o", tmp_path / "predicted.csv")
    assert code == 0, stderr


def test_identify_fits_the_free_run(axis_campaign: Path, tmp_path: Path, run: Run) -> None:
    out = tmp_path / "out"
    options = ["--objective", "free-run", "--initial-samples", "30"]
    code, _, stderr = run("identify", axis_campaign, "-o", out, "-j", "1", *options)
    assert code == 0, stderr
    assert json.loads((out / "identification.json").read_text())["initial_samples"] == 30
    assert "--objective free-run" in (out / "identification.html").read_text()


@pytest.mark.slow
def test_identify_says_nothing_if_quiet(axis_campaign: Path, tmp_path: Path, run: Run) -> None:
    assert run("identify", axis_campaign, "-o", tmp_path / "out", "--quiet") == (0, "", "")


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--method", "thesi"], "Did you mean 'thesis'"),
        (["--resolution", "0.01"], "too short for a resolution"),
        (["--resolution", "0"], "positive number"),
        (["--jobs", "0"], "--jobs"),
        (["--objective", "freerun"], "Did you mean 'free-run'"),
        (["--objective", "free-run", "--initial-samples", "1"], "--initial-samples"),
        (["--objective", "free-run", "--initial-samples", "99999"], "--initial-samples"),
        (["--effect", "bouc_wen"], "Did you mean 'bouc_wen_hysteresis'"),
        (["--effect", "bouc_wen_hysteresis", "--effect", "iwan_hysteresis"], "name one of them"),
    ],
)
def test_options_of_identify_are_checked(
    arguments: list[str], expected: str, axis_campaign: Path, tmp_path: Path, run: Run
) -> None:
    code, stdout, stderr = run("identify", axis_campaign, "-o", tmp_path / "out", *arguments)
    assert (code, stdout) == (2, "")
    assert expected in stderr
    assert not (tmp_path / "out").exists()

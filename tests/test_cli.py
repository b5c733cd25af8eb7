from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rigsight import cli

RIGSIGHT = Path(sys.executable).with_name("rigsight")
Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Run:
    """Run a command line in this process and return exit code, stdout and stderr."""

    def call(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["rigsight", *map(str, arguments)])
        capfd.readouterr()
        try:
            cli.main()
            code: Any = 0
        except SystemExit as leaving:
            code = leaving.code or 0
        return code, *capfd.readouterr()

    return call


def replaced(file: str, old: str, new: str) -> Callable[[Path], None]:
    """Change a file of the campaign; the text to change must be there."""

    def change(folder: Path) -> None:
        path = folder / file
        text = path.read_text(encoding="utf-8")
        assert old in text
        path.write_text(text.replace(old, new, 1), encoding="utf-8")

    return change


def cell(row: int, column: int, text: str) -> Callable[[Path], None]:
    """Change a cell of fit.csv; row 0 is the header."""

    def change(folder: Path) -> None:
        lines = (folder / "fit.csv").read_text().split("\n")
        cells = lines[row].split(",")
        cells[column] = text
        lines[row] = ",".join(cells)
        (folder / "fit.csv").write_text("\n".join(lines))

    return change


def without_lines(first: int, last: int | None) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        lines = (folder / "fit.csv").read_text().split("\n")
        del lines[first:last]
        (folder / "fit.csv").write_text("\n".join(lines))

    return change


def constant_input(folder: Path) -> None:
    lines = (folder / "fit.csv").read_text().split("\n")
    rows = [line.split(",") for line in lines[1:] if line]
    (folder / "fit.csv").write_text("\n".join([lines[0], *(f"{t},1.0,{x}" for t, _, x in rows)]))


def jitter(folder: Path) -> None:
    lines = (folder / "fit.csv").read_text().split("\n")
    rows = [line.split(",") for line in lines[1:] if line]
    shifts = np.random.default_rng(0).uniform(-1e-3, 1e-3, len(rows))
    moved = [f"{float(t) + shift:.7f},{u},{x}" for (t, u, x), shift in zip(rows, shifts, strict=True)]
    (folder / "fit.csv").write_text("\n".join([lines[0], *moved]))


toml = "campaign.toml"
BROKEN_CAMPAIGNS: dict[str, tuple[Callable[[Path], None], tuple[str, ...]]] = {
    "no toml": (lambda f: (f / toml).unlink(), ("holds no campaign.toml",)),
    "invalid toml": (replaced(toml, "[rig]", "[rig"), (toml, "line 3")),
    "not utf-8": (lambda f: (f / toml).write_bytes(b"title = '\xff'"), (toml, "UTF-8")),
    "unknown key": (replaced(toml, "role", "rolle"), ("rolle", "Did you mean 'role'")),
    "unknown rig": (replaced(toml, '"axis"', '"axle"'), ("rig.model", "Did you mean 'axis'")),
    "unknown parameter": (replaced(toml, "d = 5.0", "damp = 5.0"), ("rig.parameters.damp", "Known")),
    "parameter out of range": (replaced(toml, "m = 2.0", "m = -2.0"), ("rig.parameters.m", "must lie in")),
    "text for a number": (replaced(toml, "m = 2.0", 'm = "2 kg"'), ("rig.parameters.m", "must be a number")),
    "missing constant": (replaced(toml, '"axis"', '"running_gear"'), ("rig.constants.v", "missing")),
    "unknown role": (replaced(toml, '"validation"', '"test"'), ("role", "Allowed")),
    "no estimation record": (replaced(toml, '"estimation"', '"validation"'), ("estimation",)),
    "no records": (
        lambda f: (f / toml).write_text('[rig]\nmodel = "axis"\n'),
        ("records", "[[records]]"),
    ),
    "missing file": (replaced(toml, "fit.csv", "fitt.csv"), ("fitt.csv", "Did you mean 'fit.csv'")),
    "path outside": (replaced(toml, "fit.csv", "../fit.csv"), ("leaves the campaign's folder",)),
    "missing column": (replaced("fit.csv", "t,u,x", "t,u,pos"), ("fit.csv", "no column 'x'", "Its columns")),
    "not a number": (cell(7, 2, "oops"), ("fit.csv", "line 8", "column 'x'", "oops")),
    "empty cell": (cell(7, 1, ""), ("line 8", "column 'u'", "empty")),
    "NaN": (cell(7, 2, "nan"), ("line 8", "column 'x'", "finite")),
    "infinity": (cell(9, 1, "-inf"), ("line 10", "column 'u'", "finite")),
    "ragged row": (cell(7, 2, "1.0,2.0"), ("line 8", "4 columns")),
    "time runs backwards": (cell(7, 0, "0.001"), ("line 8", "not increasing")),
    "duplicate stamp": (cell(7, 0, "0.025"), ("line 8", "duplicate")),
    "gap": (without_lines(400, 450), ("samples are missing", "Split the record")),
    "jitter": (jitter, ("not equally spaced", "jitter")),
    "too few samples": (without_lines(20, None), ("at least 50",)),
    "empty record": (lambda f: (f / "fit.csv").write_text(""), ("fit.csv", "empty")),
    "binary record": (lambda f: (f / "fit.csv").write_bytes(b"PK\x03\x04\0\0"), ("not a text file",)),
    "constant input": (constant_input, ("constant", "column 'u'")),
}


@pytest.mark.parametrize("case", BROKEN_CAMPAIGNS)
def test_a_broken_campaign_gets_one_helpful_message(
    case: str, axis_campaign: Path, tmp_path: Path, run: Run
) -> None:
    change, expected = BROKEN_CAMPAIGNS[case]
    change(axis_campaign)
    code, stdout, stderr = run("diagnose", axis_campaign, "--out", tmp_path / "out")
    assert code == 2, stderr
    assert stdout == ""
    assert stderr.startswith("rigsight: ")
    assert stderr.count("rigsight: ") == 1
    assert "Traceback" not in stderr
    for part in expected:
        assert part in stderr
    assert not (tmp_path / "out").exists()


def test_all_mistakes_of_a_campaign_file_are_told_at_once(axis_campaign: Path, run: Run) -> None:
    replaced(toml, "role", "rolle")(axis_campaign)
    replaced(toml, "m = 2.0", 'm = "2"')(axis_campaign)
    _, _, stderr = run("diagnose", axis_campaign, "-o", axis_campaign / "out")
    assert "rolle" in stderr
    assert "rig.parameters.m" in stderr


def test_a_campaign_that_does_not_exist(tmp_path: Path, run: Run) -> None:
    code, _, stderr = run("diagnose", tmp_path / "nowhere", "-o", tmp_path / "out")
    assert code == 2
    assert "does not exist" in stderr


BROKEN_MODELS: dict[str, tuple[Callable[[dict[str, Any]], object] | str, tuple[str, ...]]] = {
    "invalid json": ('{\n  "rig": "axis",\n}', ("model.json, line 3, column 1", "JSON")),
    "no object": ("[1, 2]", ("one object",)),
    "not finite": ('{"rig": "axis", "x": NaN}', ("NaN",)),
    "repeated key": ('{"rig": "axis", "rig": "element"}', ("'rig' stands twice",)),
    "too deep": ("[" * 100_000, ("model.json",)),
    "other schema": (lambda m: m.update(schema_version=7), ("schema_version", "7", "reads 1")),
    "unknown key": (lambda m: m.update(effect=[]), ("effect: unknown key", "Did you mean 'effects'")),
    "missing key": (lambda m: m.pop("rig"), ("rig: is missing",)),
    "unknown rig": (lambda m: m.update(rig="axes"), ("rig: is 'axes'", "Did you mean 'axis'")),
    "unknown effect": (
        lambda m: m.update(effects=["cubic_stifness"]),
        ("effects: 'cubic_stifness'", "Did you mean 'cubic_stiffness'"),
    ),
    "effect twice": (lambda m: m["effects"].append("cubic_stiffness"), ("twice",)),
    "effect of another rig": (
        lambda m: m.update(rig="element", effects=["input_delay"]),
        ("input_delay", "makes no sense"),
    ),
    "missing parameters": (
        lambda m: (m["parameters"].pop("m"), m["effect_parameters"].clear()),
        ("needs parameters.m, effect_parameters.k_3",),
    ),
    "unknown parameter": (lambda m: m["parameters"].update(k_3=1.0), ("parameters.k_3: unknown",)),
    "out of range": (lambda m: m["parameters"].update(m=-1.0), ("parameters.m", "must lie in")),
    "text for a number": (lambda m: m["parameters"].update(m="2"), ("parameters.m", "must be a number")),
    "other unit": (lambda m: m["units"].update(k_3="N/mm^3"), ("units.k_3", "N/m^3", "Convert")),
    "unknown hold": (lambda m: m.update(hold="linear"), ("hold", "Allowed", "foh")),
}


@pytest.mark.parametrize("case", BROKEN_MODELS)
def test_a_broken_model_gets_one_helpful_message(
    case: str, axis_campaign: Path, write_model: Callable[..., Path], tmp_path: Path, run: Run
) -> None:
    change, expected = BROKEN_MODELS[case]
    model = write_model(text=change) if isinstance(change, str) else write_model(change)
    out = tmp_path / "out" / "predicted.csv"
    code, stdout, stderr = run("simulate", model, axis_campaign / "fit.csv", "--out", out)
    assert code == 2, stderr
    assert stdout == ""
    assert stderr.startswith("rigsight: model.json")
    assert "Traceback" not in stderr
    for part in expected:
        assert part in stderr
    assert not out.parent.exists()


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--column", "u"], "SIGNAL=COLUMN"),
        (["--column", "x=pos"], "does not read it"),
        (["--column", "u=7"], "columns are 1 to 3"),
        (["--initial-state", "x"], "STATE=VALUE"),
        (["--initial-state", "x=inf"], "finite"),
        (["--initial-state", "y=0.1"], "The model's states: x, w"),
    ],
)
def test_options_of_simulate_are_checked(
    arguments: list[str],
    expected: str,
    axis_campaign: Path,
    write_model: Callable[..., Path],
    tmp_path: Path,
    run: Run,
) -> None:
    out = tmp_path / "out" / "predicted.csv"
    code, _, stderr = run("simulate", write_model(), axis_campaign / "fit.csv", "-o", out, *arguments)
    assert code == 2
    assert expected in stderr
    assert not out.parent.exists()


def test_a_file_in_the_way_of_the_results_is_told_before_the_work(
    axis_campaign: Path, tmp_path: Path, run: Run
) -> None:
    (tmp_path / "out").write_text("mine")
    for out in (tmp_path / "out", tmp_path / "out" / "below"):
        started = time.perf_counter()
        code, _, stderr = run("diagnose", axis_campaign, "-o", out)
        assert code == 2
        assert "is a file" in stderr
        assert time.perf_counter() - started < 5.0
    assert (tmp_path / "out").read_text() == "mine"


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="needs a folder in which nobody can write")
def test_a_folder_that_cannot_be_written_is_told(axis_campaign: Path, run: Run) -> None:
    code, _, stderr = run("diagnose", axis_campaign, "-o", "/proc/rigsight/out")
    assert code == 2
    assert "Cannot write results" in stderr


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["diagnos", "x"], "Did you mean 'diagnose'"),
        (["diagnose"], "CAMPAIGN"),
        (["diagnose", ".", "--jobs", "0"], "--jobs"),
        (["diagnose", ".", "--seed", "one"], "--seed"),
        (["diagnose", ".", "--effect", "cubic"], "Did you mean 'cubic_stiffness'"),
    ],
)
def test_usage_errors_exit_2(arguments: list[str], expected: str, run: Run) -> None:
    code, stdout, stderr = run(*arguments)
    assert code == 2
    assert stdout == ""
    assert expected in stderr
    assert "Traceback" not in stderr


def test_a_defect_exits_1_with_one_line(
    axis_campaign: Path, tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def defective(*_: object, **__: object) -> None:
        raise ZeroDivisionError("a\nb")

    monkeypatch.setattr("rigsight.workflow.diagnose.diagnose", defective)
    arguments = (
        "diagnose",
        axis_campaign,
        "-o",
        tmp_path / "out",
        "--effect",
        "cubic_stiffness",
        "--jobs",
        "1",
    )
    code, _, stderr = run(*arguments, "--quiet")
    assert code == 1
    assert stderr.count("\n") == 1
    assert "ZeroDivisionError: a b" in stderr
    assert "--debug" in stderr
    assert not (tmp_path / "out").exists()
    with pytest.raises(ZeroDivisionError):
        run(*arguments, "--debug")


def test_help_answers_in_half_a_second() -> None:
    times = []
    for _ in range(3):
        started = time.perf_counter()
        shown = subprocess.run([RIGSIGHT, "--help"], capture_output=True, text=True, check=True)
        times.append(time.perf_counter() - started)
    assert min(times) < 0.5
    for command in ("demo", "diagnose", "simulate"):
        assert command in shown.stdout


def test_help_imports_nothing_heavy() -> None:
    code = "import sys, rigsight.cli; sys.exit(bool({'numpy', 'numba', 'sympy', 'pydantic'} & sys.modules.keys()))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_version(run: Run) -> None:
    code, stdout, _ = run("--version")
    assert code == 0
    assert stdout.startswith("rigsight 0.")


def test_simulate_returns_what_the_model_was_made_from(
    axis_campaign: Path,
    axis_rows: dict[str, np.ndarray],
    write_model: Callable[..., Path],
    tmp_path: Path,
    run: Run,
) -> None:
    out = tmp_path / "out" / "predicted.csv"
    code, stdout, stderr = run("simulate", write_model().parent, axis_campaign / "score.csv", "--out", out)
    assert code == 0, stderr
    assert str(out) in stdout
    assert out.read_text().startswith("t,u,x\n")
    predicted = np.loadtxt(out, delimiter=",", skiprows=1)
    measured = axis_rows["score.csv"]
    np.testing.assert_allclose(predicted[:, :2], measured[:, :2], atol=1e-9)
    assert np.std(predicted[:, 2] - measured[:, 2]) == pytest.approx(2e-5, rel=0.1)


def test_simulate_maps_columns_and_starts_elsewhere(
    axis_campaign: Path, write_model: Callable[..., Path], tmp_path: Path, run: Run
) -> None:
    record = tmp_path / "drive.csv"
    record.write_text("time;force\n" + "\n".join(f"{0.01 * i:.2f};0" for i in range(60)))
    out = tmp_path / "predicted.csv"
    options = ("--column", "t=time", "--column", "u=2", "--initial-state", "x=0.01,w=0")
    code, stdout, _ = run("simulate", write_model(), record, "-o", out, *options, "--quiet")
    assert (code, stdout) == (0, "")
    x = np.loadtxt(out, delimiter=",", skiprows=1)[:, 2]
    assert x[0] == 0.01
    assert x.min() < -0.005


def test_diagnose_leaves_three_results_and_tells_the_verdict(
    axis_campaign: Path, tmp_path: Path, run: Run
) -> None:
    out = tmp_path / "out"
    code, stdout, stderr = run("diagnose", axis_campaign, "-o", out, "--effect", "cubic_stiffness", "-j", "1")
    assert code == 0, stderr
    assert sorted(path.name for path in out.iterdir()) == ["diagnosis.json", "model.json", "report.html"]
    assert "cubic stiffness" in stdout
    assert str(out / "report.html") in stdout.replace("\n", "")
    assert json.loads((out / "diagnosis.json").read_text())["effects"] == ["cubic_stiffness"]


def test_quiet_says_nothing(axis_campaign: Path, tmp_path: Path, run: Run) -> None:
    arguments = ("-o", tmp_path / "out", "--effect", "cubic_stiffness", "--quiet", "--jobs", "1")
    assert run("diagnose", axis_campaign, *arguments) == (0, "", "")


@pytest.mark.skipif(sys.platform == "win32", reason="signals differ there")
@pytest.mark.parametrize("stage", ["Compiling", "Diagnosing"])
def test_an_interrupted_diagnosis_leaves_nothing(stage: str, axis_campaign: Path, tmp_path: Path) -> None:
    out = tmp_path / "new" / "out"
    environment = dict(os.environ)
    if stage == "Compiling":
        environment["RIGSIGHT_CACHE_DIR"] = str(tmp_path / "kernels")
    process = subprocess.Popen(
        [RIGSIGHT, "diagnose", axis_campaign, "-o", out, "--jobs", "2"],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert process.stderr is not None
    seen = ""
    for line in process.stderr:
        seen += line
        if line.startswith(stage):
            break
    time.sleep(2.0)
    # As a terminal does it: to the whole group, worker processes included.
    os.killpg(process.pid, signal.SIGINT)
    stdout, stderr = process.communicate(timeout=60)
    assert process.returncode == 130, seen + stderr
    assert stdout == ""
    assert "Traceback" not in stderr
    assert stderr.strip().endswith("interrupted; nothing was written.")
    assert not out.parent.exists()


def test_identify_leaves_all_results_and_shows_the_table(
    axis_campaign: Path, tmp_path: Path, run: Run
) -> None:
    out = tmp_path / "out"
    code, stdout, stderr = run("identify", axis_campaign, "-o", out, "-j", "1")
    assert code == 0, stderr
    figures = ["amplitudes.svg", "bode_fit.svg", "responses.svg"]
    assert sorted(path.name for path in out.iterdir()) == sorted(
        [*figures, "identification.json", "model.json"]
    )
    for part in ("amplitude [input]", "k [N/m]", "resonance [rad/s]", "One estimation record", "score"):
        assert part in stdout
    assert json.loads((out / "identification.json").read_text())["schema_version"] == 1
    code, _, stderr = run("simulate", out, axis_campaign / "score.csv", "-o", tmp_path / "predicted.csv")
    assert code == 0, stderr


def test_identify_says_nothing_if_quiet(axis_campaign: Path, tmp_path: Path, run: Run) -> None:
    assert run("identify", axis_campaign, "-o", tmp_path / "out", "--quiet") == (0, "", "")


@pytest.mark.parametrize("case", ["unknown rig", "missing file", "NaN", "constant input"])
def test_identify_gives_a_broken_campaign_one_helpful_message(
    case: str, axis_campaign: Path, tmp_path: Path, run: Run
) -> None:
    change, expected = BROKEN_CAMPAIGNS[case]
    change(axis_campaign)
    code, stdout, stderr = run("identify", axis_campaign, "--out", tmp_path / "out")
    assert (code, stdout) == (2, "")
    assert stderr.startswith("rigsight: ")
    assert "Traceback" not in stderr
    for part in expected:
        assert part in stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--method", "thesi"], "Did you mean 'thesis'"),
        (["--resolution", "0.01"], "too short for a resolution"),
        (["--resolution", "0"], "positive number"),
        (["--jobs", "0"], "--jobs"),
    ],
)
def test_options_of_identify_are_checked(
    arguments: list[str], expected: str, axis_campaign: Path, tmp_path: Path, run: Run
) -> None:
    code, stdout, stderr = run("identify", axis_campaign, "-o", tmp_path / "out", *arguments)
    assert (code, stdout) == (2, "")
    assert expected in stderr
    assert not (tmp_path / "out").exists()

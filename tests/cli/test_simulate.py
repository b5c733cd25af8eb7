"""What ``rigsight simulate`` predicts, and how it refuses broken models and options."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rigsight.api.inputs import read_record

Run = Callable[..., tuple[int, str, str]]

BROKEN_MODELS: dict[str, tuple[Callable[[dict[str, Any]], object] | str, tuple[str, ...]]] = {
    "invalid json": ('{\n  "rig": "axis",\n}', ("model.json, line 3, column 1", "JSON")),
    "no object": ("[1, 2]", ("one object",)),
    "not finite": ('{"rig": "axis", "x": NaN}', ("NaN",)),
    "repeated key": ('{"rig": "axis", "rig": "element"}', ("'rig' occurs twice",)),
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
        ("input_delay", "does not apply"),
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
        (["--unit", "t"], "SIGNAL=UNIT"),
        (["--unit", "t=mm"], "does not measure the same as s"),
        (["--column", "x=pos"], "does not use it"),
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


def test_simulate_converts_units_and_asks_about_those_in_names(
    write_model: Callable[..., Path], tmp_path: Path, run: Run
) -> None:
    record = tmp_path / "drive.csv"
    record.write_text("t_ms,F_kN\n" + "\n".join(f"{10 * i},{0.001 * (i > 9)}" for i in range(60)))
    out = tmp_path / "predicted.csv"
    asked = ("simulate", write_model(), record, "-o", out, "--column", "t=t_ms", "--column", "u=F_kN")
    code, stdout, _ = run(*asked)
    assert code == 0
    assert "Note: drive.csv, column 't_ms': values taken as s without conversion" in stdout
    assert "Note: drive.csv, column 'F_kN': values taken as N without conversion" in stdout
    assert "--unit u=kN" in stdout
    code, stdout, _ = run(*asked, "--unit", "t=ms", "--unit", "u=kN")
    assert (code, "Note" in stdout) == (0, False)
    rows = np.loadtxt(out, delimiter=",", skiprows=1)
    assert (rows[-1, 0], rows[-1, 1]) == (pytest.approx(0.59), 1.0)


def test_a_prediction_over_unix_time_is_read_again(
    write_model: Callable[..., Path], tmp_path: Path, run: Run
) -> None:
    record, out = tmp_path / "drive.csv", tmp_path / "predicted.csv"
    rows = (f"{1.7e9 + 0.005 * i:.4f},{np.sin(0.1 * i):.6f}" for i in range(200))
    record.write_text("t,u\n" + "\n".join(rows))
    assert run("simulate", write_model(), record, "-o", out)[0] == 0
    read = read_record(out, "axis")
    assert (read.dt, read.t0, read.notes) == (0.005, 1.7e9, ())


def test_a_measurement_is_not_overwritten_by_its_simulation(
    axis_campaign: Path, write_model: Callable[..., Path], tmp_path: Path, run: Run
) -> None:
    record = axis_campaign / "fit.csv"
    measured = record.read_bytes()
    link = tmp_path / "link.csv"
    link.symlink_to(record)
    for out in (record, link):
        code, _, stderr = run("simulate", write_model(), record, "-o", out)
        assert code == 2
        assert "it is the record that is simulated. Name another file with --out." in stderr
    assert record.read_bytes() == measured

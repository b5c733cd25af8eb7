"""What changed between two fits of simulated rigs is found, what did not change is not, and what cannot be compared is told."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rigsight.effects import effect_named
from rigsight.excitation import linear_sweep
from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.records import Record
from rigsight.report.labels import written
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate
from rigsight.simulate.model import Model
from rigsight.workflow.difference import Difference, Verdict, run_difference

Run = Callable[..., tuple[int, str, str]]
VALUES = {"gain": 1.0, "m": 2.0, "d": 5.0, "k": 800.0, "x_off": 0.0, "force_off": 0.0}
LACKING: dict[str, dict[str, float]] = {"free": {}, "rubs": {"T_c": 1.0}}
FREE = ("m", "d", "k", "x_off")


def diagnosed(
    folder: Path,
    seed: int,
    change: Callable[[dict[str, Any]], object] | None = None,
    records_differ: float = 0.0,
    **changed: float,
) -> Path:
    """Fit a drawn rig and write what a diagnosis without a missing effect writes of it."""
    rng, t, structure = np.random.default_rng(seed), 0.01 * np.arange(800), compose(AXIS)
    u = linear_sweep(t, 2.0, 3.0, 50.0)
    moved = simulate(structure, {**VALUES, **changed}, Record("r", 0.01, {"u": u}, {"u": "N", "x": "m"}))
    record = moved.with_signals(x=moved["x"] + rng.normal(0.0, 2e-4, t.size))
    scales = characteristic_scales(AXIS, [record], VALUES)
    fit = GreyBoxFit(structure, [record], scales, {"x": 2e-4}).fit(VALUES, FREE)
    units = {p.name: p.unit for p in structure.parameters}
    numbers = {
        name: {"value": fit.values[name], "std": fit.standard_errors[name], "unit": units[name]}
        for name in FREE
    }
    groups = [
        {"value": fit.values["d"] + sign * records_differ, "std": fit.standard_errors["d"]}
        for sign in (1, -1, 1, -1)
    ]
    content: dict[str, Any] = {
        "title": "stage", "rig": "axis", "effects": [], "where": [],
        "candidates": [{"effects": [], "where": [], "parameters": numbers}],
        "trust": {"parameters": [{"name": "d", "by_group": {"record": groups}}], "entangled": [{"names": ["m", "k"]}]},
    }  # fmt: skip
    if change is not None:
        change(content)
    folder.mkdir()
    (folder / "diagnosis.json").write_text(json.dumps(content))
    (folder / "model.json").write_text(json.dumps(Model.of(structure, fit.values, "foh").to_json()))
    return folder


def verdicts(found: Difference) -> dict[str, Verdict]:
    return {row.name: row.verdict for row in found.rows}


def test_the_changed_number_is_found_and_the_others_are_the_same(tmp_path: Path, run: Run) -> None:
    folders = [diagnosed(tmp_path / "new", 1), diagnosed(tmp_path / "worn", 2, d=6.0)]
    code, out, _ = run("difference", *folders, "--out", tmp_path / "out")
    assert (code, "Changed: d" in out) == (0, True)
    found = json.loads((tmp_path / "out/difference.json").read_text())
    by_name = {row["name"]: row for row in found["numbers"]}
    assert {name: row["verdict"] for name, row in by_name.items() if name != "x_off"} == {
        "d": "changed", "m": "same", "k": "same",
    }  # fmt: skip
    assert by_name["d"]["difference"] > 5.0
    assert by_name["m"]["values"][0]["entangled_with"] == ["k"]
    assert (tmp_path / "out/difference.png").read_bytes().startswith(b"\x89PNG")


def test_what_differs_no_more_than_records_do_only_looks_changed(tmp_path: Path) -> None:
    folders = [
        diagnosed(tmp_path / name, seed, records_differ=1.5, d=d)
        for name, seed, d in (("a", 1, 5.0), ("b", 2, 6.0))
    ]
    assert verdicts(run_difference(folders))["d"] is Verdict.LOOKS_CHANGED


def test_a_zero_that_no_record_determines_is_no_equal_number(tmp_path: Path) -> None:
    folders = [diagnosed(tmp_path / "a", 1), diagnosed(tmp_path / "b", 2)]
    assert verdicts(run_difference(folders))["x_off"] is Verdict.UNKNOWN


def test_three_follow_their_axis(tmp_path: Path) -> None:
    folders = [diagnosed(tmp_path / str(t), t, k=820.0 - 0.4 * t) for t in (20, 40, 60)]
    found = {row.name: row for row in run_difference(folders, at=[20.0, 40.0, 60.0]).rows}
    trend = found["k"].trend
    assert trend is not None
    assert found["k"].verdict is Verdict.CHANGED
    assert trend.slope == pytest.approx(-0.4, abs=3.0 * trend.std)
    assert found["d"].verdict is Verdict.SAME


def test_equal_rigs_are_rarely_called_changed(tmp_path: Path) -> None:
    folders = [diagnosed(tmp_path / str(i), i) for i in range(60)]
    called = [bool(run_difference(folders[i : i + 2]).changed) for i in range(0, 60, 2)]
    assert sum(called) <= 4


def test_numbers_are_written_to_the_digits_of_their_errors(tmp_path: Path, run: Run) -> None:
    folders = [diagnosed(tmp_path / "a", 1), diagnosed(tmp_path / "b", 2)]
    _, out, _ = run("difference", *folders, "--out", tmp_path / "out")
    known = next(row for row in run_difference(folders).rows if row.name == "m").values[0]
    assert known is not None
    assert written(known.value, known.with_scatter).value in out


def test_what_cannot_be_compared_is_told(tmp_path: Path, run: Run) -> None:
    a, out = diagnosed(tmp_path / "a", 1), tmp_path / "out"
    other = diagnosed(tmp_path / "other", 1, lambda content: content.update(rig="servo"))
    broken = diagnosed(tmp_path / "broken", 1, lambda content: content.pop("candidates"))
    for arguments, told in (
        ([a], "at least two"),
        ([a, tmp_path / "gone"], "contains neither diagnosis.json nor campaign.toml"),
        ([a, other], "of 'servo'"),
        ([a, broken], "candidates"),
        ([a, other / "model.json"], "name the folder of the results"),
        ([a, a, "--at", "1,2"], "three or more"),
        ([a, a, a, "--at", "1,2"], "2 values for 3"),
        ([a, a, a, "--at", "cold"], "cannot be read"),
    ):
        code, said, err = run("difference", *arguments, "--out", out)
        assert (code, said, told in err) == (2, "", True), err
    assert not out.exists()


def unit(folder: Path, seed: int, amplitudes: Sequence[float], head: str = "", **changed: float) -> Path:
    """Write a campaign of sweeps of an axis, with dry friction if a T_c is given."""
    folder.mkdir()
    rng, t = np.random.default_rng(seed), 0.01 * np.arange(1500)
    structure = compose(AXIS, [effect_named("coulomb_friction")] if "T_c" in changed else [])
    lines = [f'[rig]\nmodel = "axis"\n{head}\n[rig.constants]\ngain = 1.0\n']
    for i, amplitude in enumerate(amplitudes):
        u = amplitude * linear_sweep(t, 1.0, 3.0, 50.0)
        asked = Record("r", 0.01, {"u": u}, {"u": "N", "x": "m"})
        x = simulate(structure, {**VALUES, **changed}, asked)["x"] + rng.normal(0.0, 2e-5, t.size)
        rows = np.column_stack([t, u, x])
        np.savetxt(folder / f"{i}.csv", rows, delimiter=",", header="t,u,x", comments="")
        lines.append(f'[[records]]\nfile = "{i}.csv"\nrole = "estimation"\n')
    (folder / "campaign.toml").write_text("".join(lines))
    return folder


def test_campaigns_are_identified_and_compared(tmp_path: Path, run: Run) -> None:
    folders = [unit(tmp_path / f"unit_{d}", i, (2.0, 3.0), d=d) for i, d in enumerate((5.0, 7.0))]
    code, stdout, stderr = run("difference", *folders, "-o", tmp_path / "out", "--json", "-j", "1")
    assert code == 0, stderr
    changed = [row["name"] for row in json.loads(stdout)["numbers"] if row["verdict"] == "changed"]
    assert changed == ["d"]


FRICTION = 'effects = ["coulomb_friction"]\n[rig.parameters]\nm = 2.0\nd = 5.0\nk = 800.0\nT_c = 0.1'


def test_what_one_model_has_is_identified_in_the_other_campaigns_too(tmp_path: Path) -> None:
    folders = [
        unit(tmp_path / "new", 0, (2.0, 3.0)),
        unit(tmp_path / "worn", 1, (2.0, 3.0), FRICTION, T_c=0.2),
    ]
    found = run_difference(folders, n_jobs=1)
    assert (found.other_effects, verdicts(found)["T_c"]) == ({}, Verdict.CHANGED)
    assert verdicts(found)["m"] is Verdict.SAME


def test_one_record_does_not_show_what_differs_between_records(tmp_path: Path) -> None:
    folders = [unit(tmp_path / f"unit_{d}", i, (2.0,), d=d) for i, d in enumerate((5.0, 7.0))]
    found = run_difference(folders, n_jobs=1)
    assert [own.has_one_record for own in found.units] == [True, True]
    assert "only look so" in found.conclusion


def test_an_effect_that_the_equations_lack_may_have_changed(tmp_path: Path) -> None:
    units = [unit(tmp_path / name, i, (2.0, 3.0), **own) for i, (name, own) in enumerate(LACKING.items())]
    told = run_difference(units, n_jobs=1).conclusion
    assert "an effect may have changed which they lack" in told
    assert str(units[1]) in told
    assert f"({units[0]})" not in told

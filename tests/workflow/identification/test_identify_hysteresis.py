"""`rigsight identify --effect`: the hysteresis of a rig comes back with its errors, and nothing is left half-written."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from rigsight.effects import effect_named
from rigsight.errors import InputError
from rigsight.excitation import log_sweep
from rigsight.identify.identification import Identification
from rigsight.records import Record, Role
from rigsight.report.identification import identification_html, identification_summary
from rigsight.rigs import AXIS, rig_file_text
from rigsight.rigs.reading.rig_file import rig_of_tables
from rigsight.simulate.model import Model
from rigsight.workflow.campaign.in_memory import make_campaign
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.compare import run_compare
from rigsight.workflow.identification import hysteresis
from rigsight.workflow.identification.hysteresis import CALIBRATING
from rigsight.workflow.identify import run_identify
from rigsight.workflow.run.progress import Step

from ..virtual_campaign import CONSTANTS, DT, NOISE, TRUTH, Run, write_campaign

BOUC_WEN = effect_named("bouc_wen_hysteresis")
OF_AXIS = {
    "gain": 1.0, "m": 2.0, "k": 3000.0, "d": 6.0, "x_off": 1e-4, "force_off": 0.0,
    "A": 1.0, "a": 0.3, "beta": 1500.0, "gamma": -400.0, "n": 1.0,
}  # fmt: skip
OF_GEAR = {
    **CONSTANTS, **TRUTH, "J_z": 0.58, "k_d": 0.5, "k_c": 700.0,
    "A": 1.0, "a": 0.09, "beta": 2660.0, "gamma": -660.0, "n": 1.0,
}  # fmt: skip


def sweep(name: str, amplitude: float, band: tuple[float, float], role: Role = "estimation") -> Run:
    return Run(name, log_sweep(DT * np.arange(1200), amplitude, *band), "sweep", role, amplitude)


def axis_runs() -> list[Run]:
    band = (3.0, 90.0)
    runs = [sweep(f"{amplitude:g} N", amplitude, band) for amplitude in (1.0, 3.0, 10.0)]
    return [*runs, sweep("held out", 5.0, band, "validation")]


@pytest.fixture(scope="module")
def axis_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("axis")
    campaign = write_campaign(folder / "campaign", axis_runs(), AXIS, OF_AXIS, effect="bouc_wen_hysteresis")
    # A record with a constant of its own makes it a rig that is identified over time, with a page.
    with (campaign / "campaign.toml").open("a") as toml:
        toml.write("constants = { gain = 1.0 }\n")
    return campaign


@pytest.fixture(scope="module")
def steps() -> list[Step]:
    return []


@pytest.fixture(scope="module")
def axis(axis_folder: Path, steps: list[Step]) -> Identification:
    out = axis_folder.parent / "out"
    return run_identify(axis_folder, out, effects=[BOUC_WEN], n_jobs=2, listener=steps.append)


@pytest.fixture(scope="module")
def gear(tmp_path_factory: pytest.TempPathFactory) -> Identification:
    band = (0.7, 90.0)
    runs = [sweep(f"{amplitude:g} A", amplitude, band) for amplitude in (0.25, 0.5, 1.0)]
    folder = write_campaign(
        tmp_path_factory.mktemp("gear"), runs, values=OF_GEAR, effect="bouc_wen_hysteresis"
    )
    return run_identify(folder, effects=[BOUC_WEN], n_jobs=1)


def check_recovered(found: Identification, truth: Mapping[str, float], expected: set[str]) -> None:
    assert found.hysteresis is not None
    fit = found.hysteresis.calibration.fit
    assert fit.success
    assert set(fit.free) == expected
    pulls = {name: (fit.values[name] - truth[name]) / fit.standard_errors[name] for name in fit.free}
    assert max(map(abs, pulls.values())) < 4.0, pulls
    derived = found.hysteresis.calibration.derived
    total, difference = truth["beta"] + truth["gamma"], truth["beta"] - truth["gamma"]
    assert derived.saturation is not None
    for one, true in zip((*derived.pairs, derived.saturation), (total, difference, 1.0 / total), strict=True):
        margin = 0.5 * (one.upper - one.lower)
        assert one.lower - margin < true < one.upper + margin
        assert one.value == pytest.approx(true, rel=0.1)


@pytest.mark.slow
def test_the_hysteresis_of_an_axis_comes_back(axis: Identification) -> None:
    check_recovered(axis, OF_AXIS, {"m", "k", "d", "x_off", "a", "beta", "gamma", "n"})


@pytest.mark.slow
def test_the_hysteresis_of_a_running_gear_comes_back_beside_its_lateral_path(gear: Identification) -> None:
    expected = {"J_z", "k_c", "k_d", "psi_off", "l_0", "c_y", "y_off", "a", "beta", "gamma", "n"}
    check_recovered(gear, OF_GEAR, expected)


def test_errors_fall_to_the_noise_on_records_that_were_not_fitted_too(
    axis: Identification, axis_folder: Path
) -> None:
    assert axis.hysteresis is not None
    scores = {score.record: score for score in axis.hysteresis.scores}
    assert [score.role for score in scores.values()] == 3 * ["estimation"] + ["validation"]
    for name, score in scores.items():
        measured = np.genfromtxt(axis_folder / f"{name}.csv", delimiter=",", names=True)["x"]
        assert score.nrmse["x"] == pytest.approx(NOISE / np.std(measured), rel=0.1)
        assert score.without["x"] > 2.0 * score.nrmse["x"]
    assert "on the held-out records" in axis.hysteresis.statement


def test_the_results_hold_the_calibrated_model_and_its_numbers(
    axis: Identification, axis_folder: Path, steps: list[Step]
) -> None:
    out = axis_folder.parent / "out"
    written: dict[str, Any] = json.loads((out / "identification.json").read_text("utf-8"))["hysteresis"]
    assert written["effects"] == ["bouc_wen_hysteresis"]
    assert set(written["parameters"]["beta"]) == {"value", "std", "interval", "unit"}
    assert written["held"] == {"A": 1.0}
    assert len(written["covariance"]["values"]) == len(written["covariance"]["parameters"])
    assert set(written["derived"]["pairs"]) == {"beta + gamma", "beta - gamma"}
    assert "z saturates at" in written["derived"]["saturation"]["statement"]
    areas = written["derived"]["loop_areas"]
    assert [area["unit"] for area in areas] == 3 * ["J"]
    assert np.all(np.diff([area["value"] for area in areas]) > 0.0)
    model = json.loads((out / "model.json").read_text("utf-8"))
    assert model["effects"] == ["bouc_wen_hysteresis"]
    assert model["effect_parameters"]["beta"] == written["parameters"]["beta"]["value"]
    assert steps[-1].stage == CALIBRATING
    assert steps[-1].done == steps[-1].total


def test_the_calibrated_model_can_be_compared(
    axis: Identification, axis_folder: Path, tmp_path: Path
) -> None:
    fit = axis.joint.fit.fit
    (tmp_path / "linear.json").write_text(json.dumps(Model.of(fit.structure, fit.values, "foh").to_json()))
    models = [axis_folder.parent / "out" / "model.json", tmp_path / "linear.json"]
    compared = run_compare(axis_folder, models, n_jobs=1)
    runs = [s for s in compared.scores if s.record == "held out" and s.column.quantity == "free_run_nrmse"]
    calibrated, linear = (score.value for score in runs)
    assert calibrated < 0.01
    assert linear > 0.2


def test_terminal_page_and_notebook_have_a_section(axis: Identification, axis_folder: Path) -> None:
    console = Console(file=StringIO(), width=150)
    console.print(identification_summary(axis))
    page = (axis_folder.parent / "out" / "identification.html").read_text("utf-8")
    for shown in (console.file.getvalue(), page, identification_html(axis)):
        for words in ("Hysteresis", "beta + gamma", "z saturates at", "energy per cycle at", "held out"):
            assert words in shown
    assert "--effect bouc_wen_hysteresis" in page


def test_a_held_out_record_on_which_the_model_diverges_has_no_error(
    axis: Identification, axis_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert axis.hysteresis is not None
    calibration = axis.hysteresis.calibration
    # With such a pair z grows without bound.
    values = {**calibration.fit.values, "beta": -4000.0, "gamma": 3000.0}
    diverging = replace(calibration, fit=replace(calibration.fit, values=values))
    monkeypatch.setattr(hysteresis, "calibrate_to_records", lambda *_, **__: diverging)
    campaign = read_campaign(axis_folder)
    structure = hysteresis.structure_with_memory(campaign, [BOUC_WEN])
    found = hysteresis.with_hysteresis(axis, campaign, structure, 0, 1, lambda _: None).hysteresis
    assert found is not None
    assert [score.role for score in found.scores] == 3 * ["estimation"]
    assert "diverges on 'held out' of the held-out records: no error is given there." in found.statement


def interrupted(step: Step) -> None:
    if step.stage == CALIBRATING and step.done == 3:
        raise KeyboardInterrupt


def test_an_interrupted_calibration_leaves_the_old_results(axis_folder: Path, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "model.json").write_text("{}")
    with pytest.raises(KeyboardInterrupt):
        run_identify(axis_folder, tmp_path / "out", effects=[BOUC_WEN], n_jobs=1, listener=interrupted)
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["model.json"]
    assert (tmp_path / "out" / "model.json").read_text() == "{}"


def test_two_memories_of_one_spring_are_refused(axis_folder: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="do not tell bouc_wen_hysteresis and iwan_hysteresis"):
        run_identify(
            axis_folder, tmp_path / "out", effects=[BOUC_WEN, effect_named("iwan_hysteresis")], n_jobs=1
        )
    assert not (tmp_path / "out").exists()


def test_a_rig_without_a_spring_has_no_hysteresis_to_calibrate() -> None:
    parameters = ("k", "x_off")
    declaration = {**tomllib.loads(rig_file_text("axis")), "name": "cart"}
    declaration["parameters"] = {n: p for n, p in declaration["parameters"].items() if n not in parameters}
    joint = declaration["joints"]["dynamics"]
    joint = {key: law for key, law in joint.items() if key not in ("stiffness", "rest")}
    cart = rig_of_tables({**declaration, "joints": {"dynamics": joint}}, "cart.toml")
    t = np.linspace(0.0, 1.0, 50)
    record = Record("one", 0.02, {"u": np.sin(t), "x": np.cos(t)}, {"u": "N", "x": "m"})
    campaign = make_campaign(cart, [record])
    assert not hysteresis.has_hysteresis(campaign, [BOUC_WEN])

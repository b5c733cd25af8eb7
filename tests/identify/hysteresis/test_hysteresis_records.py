"""Hysteresis parameters come back from noisy records of several amplitudes, from no start at all."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.effects import effect_named
from rigsight.errors import InputError
from rigsight.excitation import log_sweep
from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.identify.hysteresis import Calibration, calibrate_to_records, derived_quantities, loop_area
from rigsight.identify.hysteresis.calibration import free_parameters
from rigsight.identify.hysteresis.derived import record_amplitudes
from rigsight.records import Record
from rigsight.rigs import AXIS, RUNNING_GEAR
from rigsight.rigs.published import published_sets
from rigsight.simulate import Structure, compose, parameter_vector, simulate

from ...tiers import slow_but

NOISE = 2e-5
CONSTANTS = {"v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27}
LATERAL = {"l_0": 0.25, "c_y": 0.98}
BOUC_WEN = effect_named("bouc_wen_hysteresis")
SETS = {name: published_sets()[f"hysteresis_{name}"].values() for name in "rbp"}
SETS["made_up"] = {
    **SETS["r"], "J_z": 0.58, "k_d": 0.5, "k_c": 700.0, "a": 0.09, "beta": 2660.0, "gamma": -660.0
}  # fmt: skip


def sweeps(values: dict[str, float], rng: np.random.Generator, structure: Structure) -> list[Record]:
    t = 5e-3 * np.arange(5000)
    records = []
    for amplitude in (0.25, 0.5, 1.0):
        u = log_sweep(t, amplitude, 0.7, 90.0)
        record = Record(f"sweep {amplitude} A", 5e-3, {"u": u}, {"u": "A", "psi": "rad"}, kind="sweep")
        psi = simulate(structure, values, record)["psi"]
        records.append(record.with_signals(psi=psi + NOISE * rng.standard_normal(t.size)))
    return records


def with_unit_scale(values: dict[str, float]) -> dict[str, float]:
    """Return what records determine: A is redundant, z -> z / A changes no motion."""
    scaled = values["k_c"] * (1.0 - values["a"]) * values["A"]
    power = values["A"] ** (values["n"] - 1.0)
    return {
        "J_z": values["J_z"],
        "k_d": values["k_d"],
        "far": values["k_c"] * values["a"],
        "near": values["k_c"] * values["a"] + scaled,
        "sum": (values["beta"] + values["gamma"]) * power,
        "difference": (values["beta"] - values["gamma"]) * power,
    }


def calibrated(values: dict[str, float], n: float | None, seed: int) -> tuple[Calibration, list[Record]]:
    rng = np.random.default_rng(seed)
    structure = compose(RUNNING_GEAR, [BOUC_WEN], {} if n is None else {"n": n})
    records = sweeps(values, rng, structure)
    found = calibrate_to_records(
        structure, records, CONSTANTS, rng, start=LATERAL, output_noise={"psi": NOISE}
    )
    return found, records


@pytest.mark.slow
@pytest.mark.parametrize("name", slow_but("r", of=SETS))
def test_the_sets_of_the_thesis_come_back(name: str) -> None:
    found, _ = calibrated(SETS[name], 1.0, seed=3)
    assert found.fit.weighted_rms == pytest.approx(1.0, abs=0.02)
    truth, values = with_unit_scale(SETS[name]), with_unit_scale({**found.values, "n": 1.0})
    assert values["J_z"] == pytest.approx(truth["J_z"], rel=2e-3)
    assert values["k_d"] == pytest.approx(truth["k_d"], rel=1e-2, abs=0.01)
    assert values["near"] == pytest.approx(truth["near"], rel=1e-2)
    assert values["far"] == pytest.approx(truth["far"], rel=1e-2, abs=0.3)
    assert values["difference"] == pytest.approx(truth["difference"], rel=0.05)
    assert values["sum"] == pytest.approx(truth["sum"], rel=0.03, abs=0.002 * truth["difference"])


@pytest.mark.slow
def test_intervals_of_pair_saturation_and_loop_areas_hold_the_truth() -> None:
    structure = compose(RUNNING_GEAR, [BOUC_WEN], {"n": 1.0})
    truth = {**dict.fromkeys(structure.names, 0.0), **LATERAL, **CONSTANTS, **SETS["made_up"]}
    truth = {name: truth[name] for name in structure.names}
    free = free_parameters(structure, ["psi"])
    held, pulls = [], []
    for seed in range(6):
        rng = np.random.default_rng([11, seed])
        records = sweeps(truth, rng, structure)
        scales = characteristic_scales(RUNNING_GEAR, records, truth)
        # Begun at the truth: whether a search gets there is not the question here.
        fit = GreyBoxFit(structure, records, scales, {"psi": NOISE}).fit(truth, free)
        found = derived_quantities(fit, record_amplitudes(structure, records, truth), scales, rng)
        assert found.saturation is not None
        p = parameter_vector(structure, truth)[:, None]
        exact = [2660.0 - 660.0, 2660.0 + 660.0, 1.0 / 2000.0]
        exact += [loop_area(structure, p, area.amplitude)[0] for area in found.loop_areas]
        derived = [*found.pairs, found.saturation, *(area.energy for area in found.loop_areas)]
        assert found.saturation.upper - found.saturation.lower < 0.05 * found.saturation.value
        held.append([d.lower <= value <= d.upper for d, value in zip(derived, exact, strict=True)])
        pulls.append(
            [2.0 * 1.96 * (d.value - v) / (d.upper - d.lower) for d, v in zip(derived, exact, strict=True)]
        )
    # Per quantity 6 draws miss three or more times by chance in 0.2 % of all cases; six quantities are hardly independent.
    assert np.all(np.sum(held, axis=0) >= 4)
    # At least three of the six quantities are independent: 18 pulls of unit variance.
    assert np.sqrt(np.mean(np.square(pulls))) == pytest.approx(1.0, abs=3.0 / np.sqrt(36.0))


@pytest.mark.slow
def test_an_exponent_that_is_no_whole_number_comes_back() -> None:
    truth = {**SETS["made_up"], "n": 1.5, "beta": 5320.0, "gamma": -1320.0}
    found, _ = calibrated(truth, None, seed=2)
    assert found.fit.weighted_rms == pytest.approx(1.0, abs=0.02)
    assert found.values["n"] == pytest.approx(1.5, abs=0.03)
    assert abs(found.values["n"] - 1.5) < 4.0 * found.standard_errors["n"]
    saturation = found.derived.saturation
    assert saturation is not None
    assert saturation.value == pytest.approx(4000.0 ** (-1.0 / 1.5), rel=0.02)


@pytest.mark.slow
def test_sliders_that_a_search_takes_for_their_neighbors_come_back() -> None:
    """Nearly all slip at every amplitude: the search alone ends at 58 times their reach, whatever its seed."""
    truth = {
        "gain": 1.0, "m": 2.0, "d": 6.0, "k": 3000.0, "x_off": 1e-4, "force_off": 0.0, "a": 0.2, "x_s": 1e-3, "q": -0.3,
    }  # fmt: skip
    structure, rng = compose(AXIS, [effect_named("iwan_hysteresis")]), np.random.default_rng(5)
    t = 5e-3 * np.arange(1200)
    records = []
    for amplitude in (1.0, 3.0, 10.0):
        record = Record(f"{amplitude} N", 5e-3, {"u": log_sweep(t, amplitude, 3.0, 90.0)}, {}, kind="sweep")
        x = simulate(structure, truth, record)["x"]
        records.append(record.with_signals(x=x + NOISE * rng.standard_normal(t.size)))
    found = calibrate_to_records(structure, records, {"gain": 1.0}, rng, output_noise={"x": NOISE})
    assert found.fit.weighted_rms == pytest.approx(1.0, abs=0.03)
    for name, error in found.standard_errors.items():
        assert abs(found.values[name] - truth[name]) < 4.0 * error, name


def test_what_cannot_be_calibrated_is_explained() -> None:
    rng = np.random.default_rng(0)
    structure = compose(RUNNING_GEAR, [BOUC_WEN], {"n": 1.0})
    with pytest.raises(InputError, match="at least one record"):
        calibrate_to_records(structure, [], CONSTANTS, rng)
    records = sweeps(SETS["r"], rng, structure)[:1]
    with pytest.raises(InputError, match="Did you mean 'beta'"):
        calibrate_to_records(structure, records, CONSTANTS, rng, start=LATERAL, free=["bta"])
    with pytest.raises(InputError, match="at least one free parameter"):
        calibrate_to_records(structure, records, CONSTANTS, rng, start=LATERAL, free=[])

"""Are the equations behind synthetic records found again, with honest intervals, and nothing that is not there?"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from rigsight.campaign import Campaign
from rigsight.discover.bench import Bench, Trial
from rigsight.discover.discovery import discover
from rigsight.discover.records import DiscoveryData
from rigsight.discover.result import Discovery
from rigsight.discover.selection import Selection, select
from rigsight.effects import effect_named
from rigsight.errors import SimulationError
from rigsight.records import Record
from rigsight.rigs import ELEMENT, RUNNING_GEAR, Rig
from rigsight.simulate import compose, simulate

Make = Callable[..., tuple[dict[str, float], DiscoveryData]]
Discovered = Callable[[str, float], tuple[dict[str, float], DiscoveryData, Discovery]]
Z_MAX = 4.5
"""Standard errors by which an estimate may be off: one in 10^5 by chance."""

# The effect, and how far its coefficients may be off at 2e-5 m of noise, where the displacement is a few millimeters.
CASES = {
    "linear": (set(), 0.001),
    "cubic": ({"cubic_stiffness"}, 0.005),
    "Coulomb": ({"coulomb_friction"}, 0.005),
    "quadratic": ({"quadratic_damping"}, 0.01),
    "Bouc-Wen, n = 1": ({"bouc_wen_hysteresis"}, 0.05),
    "Bouc-Wen, n = 1.5": ({"bouc_wen_hysteresis"}, 0.3),
    "Iwan": ({"iwan_hysteresis"}, 0.005),
    "monomial": ({"monomial_x1_v1"}, 0.05),
}


@pytest.fixture(scope="module")
def discovered(make_data: Make) -> Discovered:
    """Return true values, data and discovery of an axis, discovered once for all tests of this file that look at it."""

    @cache
    def found(truth: str, noise: float) -> tuple[dict[str, float], DiscoveryData, Discovery]:
        values, data = make_data(truth, noise)
        return values, data, discover(data)

    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("truth", "noise"),
    [*((truth, 2e-4) for truth in CASES), ("cubic", 2e-5), ("Bouc-Wen, n = 1", 2e-5), ("Iwan", 2e-5)],
)
def test_support_and_coefficients_are_recovered(truth: str, noise: float, discovered: Discovered) -> None:
    effects, tolerance = CASES[truth]
    values, _, found = discovered(truth, noise)
    assert {term.name for term in found.kept} == effects
    assert found.held_out_error < 1.1
    coefficients = dict(found.rig_parameters)
    for term in found.kept:
        coefficients |= term.coefficients
        assert term.inclusion > 0.9
        assert term.otherwise > found.held_out_error
    assert {"m", "d", "k"} <= set(coefficients)
    for name, coefficient in coefficients.items():
        assert abs(coefficient.value - values[name]) < Z_MAX * coefficient.std, name
        if noise <= 2e-5 and values[name] != 0.0:
            assert coefficient.value == pytest.approx(values[name], rel=tolerance), name


@pytest.mark.slow
@pytest.mark.parametrize(
    ("truth", "there", "rival"),
    [
        ("Iwan", "iwan_hysteresis", "bouc_wen_hysteresis"),
        pytest.param("Bouc-Wen, n = 1", "bouc_wen_hysteresis", "iwan_hysteresis", marks=pytest.mark.slow),
    ],
)
def test_one_hysteresis_is_not_taken_for_the_other(
    truth: str, there: str, rival: str, discovered: Discovered
) -> None:
    found = discovered(truth, 2e-5)[2]
    assert [term.name for term in found.kept] == [there]
    assert found.held_out_error < 1.1
    other = next(a for a in found.alternatives if a.terms == (rival,))
    assert other.held_out > 1.5 * found.held_out_error


@pytest.mark.slow
def test_too_much_noise_to_decide_is_said(make_data: Make) -> None:
    # Noise as large as the motion at the middle amplitude hides the friction.
    _, data = make_data("Coulomb", 5e-3, seconds=5.0)
    found = discover(data)
    assert found.kept == ()
    assert any(
        "too high to decide" in warning and "every omitted term is in doubt" in warning
        for warning in found.warnings
    )
    # Less of it shows the friction, and that its size is vague.
    _, data = make_data("Coulomb", 2e-3, seconds=5.0)
    (friction,) = discover(data).kept
    assert friction.name == "coulomb_friction"
    assert "T_c is known to" in friction.doubt


@pytest.mark.slow
def test_one_amplitude_is_warned_of(make_data: Make) -> None:
    _, data = make_data("linear", 2e-5, seconds=5.0, amplitudes=(0.6,))
    assert any("one amplitude" in warning for warning in discover(data).warnings)
    # What can be told apart there, and what cannot, is said with it.
    _, data = make_data("quadratic", 2e-5, seconds=5.0, amplitudes=(0.6,))
    assert any(
        "the terms are distinguished" in w and "at others they are untested" in w
        for w in discover(data).warnings
    )
    _, data = make_data("Coulomb", 1e-3, amplitudes=(0.6,), seconds=5.0)
    assert any("is nearly as good" in warning for warning in discover(data).warnings)


@pytest.mark.slow
def test_a_held_out_record_with_the_input_of_a_fitted_one_is_warned_of(make_data: Make) -> None:
    _, data = make_data("linear", 2e-5, seconds=5.0, amplitudes=(0.3, 0.6))
    assert not any("input of fitted ones" in warning for warning in discover(data).warnings)
    # Another measurement of the same sweep: other noise, and it starts a second later.
    _, again = make_data("linear", 2e-5, seconds=5.0, amplitudes=(0.6,), seed=1, validation=False)
    twin = replace(again.records[0].slice(200, None), name="again", role="validation")
    estimation = tuple(record for record in data.records if record.role == "estimation")
    found = discover(replace(data, windows=(*estimation, twin)))
    assert any("'again' as 'sweep_0.6'" in warning for warning in found.warnings)


@pytest.mark.slow
def test_the_held_out_error_is_that_of_the_polished_equation(
    make_data: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The fits that choose the terms stop short here.
    monkeypatch.setattr("rigsight.discover.bench._FIRST_EVALUATIONS", 1)
    monkeypatch.setattr("rigsight.discover.bench._EVALUATIONS", 2)
    _, data = make_data("cubic", 2e-5)
    found = discover(data)
    before = next(a for a in found.alternatives if set(a.terms) == {term.name for term in found.kept})
    assert found.held_out_error < 1.1 < before.held_out
    (run,) = found.runs
    left = np.sqrt(np.mean((run.measured - run.simulated) ** 2)) / data.noise["x"]
    assert left == pytest.approx(found.held_out_error)


@pytest.mark.slow
def test_equations_that_cannot_be_simulated_are_told(
    make_data: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    def diverged(self: Bench, trial: Any, tolerance: float = 0.0) -> Trial:
        return Trial(trial.support, trial.fit, float("inf"), np.zeros(0))

    monkeypatch.setattr(Bench, "_finely_scored", diverged)
    monkeypatch.setattr("rigsight.discover.bench._RoughTrial.error_over_noise", float("inf"))
    _, data = make_data("linear", 2e-5, amplitudes=(0.3, 0.6), seconds=2.0)
    with pytest.raises(SimulationError, match="equations of axis cannot be simulated near these records"):
        discover(data)


@pytest.mark.slow
def test_a_chosen_equation_whose_score_stayed_rough_is_scored(
    make_data: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    def rough(*args: Any) -> Selection:
        selection = select(*args)
        return replace(selection, best=replace(selection.best, residuals=np.zeros(0)))

    monkeypatch.setattr("rigsight.discover.discovery.select", rough)
    _, data = make_data("linear", 2e-5, seconds=5.0, validation=False)
    found = discover(data)
    assert found.held_out_error == pytest.approx(1.0, abs=0.1)
    assert [run.record for run in found.runs] == [own.record for own in found.held_out]


@pytest.mark.slow
def test_without_validation_a_record_is_set_aside_and_this_is_said(make_data: Make) -> None:
    _, data = make_data("cubic", 2e-5, seconds=5.0, validation=False)
    found = discover(data)
    assert [own.record for own in found.held_out] == ["sweep_0.6"]
    assert any("set aside" in warning for warning in found.warnings)
    assert [term.name for term in found.kept] == ["cubic_stiffness"]


@pytest.mark.slow
def test_the_same_seed_gives_the_same_discovery_with_any_number_of_jobs(make_data: Make) -> None:
    _, data = make_data("Coulomb", 2e-5, amplitudes=(0.3, 0.8), seconds=5.0)
    first, second = discover(data, seed=3), discover(data, seed=3, n_jobs=2)
    assert first.to_json() == second.to_json()
    assert np.isfinite(first.held_out_error)


OTHER_RIGS = {
    "running gear": (
        RUNNING_GEAR,
        "bouc_wen_hysteresis",
        {"v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27},
        {"J_z": 0.56, "k_c": 500.0, "k_d": 2.0, "psi_off": 1e-3, "l_0": 0.25, "c_y": 0.98, "y_off": 0.0,
         "A": 1.0, "a": 0.2, "beta": 1100.0, "gamma": 600.0, "n": 1.0},
        {"psi": 1e-5, "y": 2e-5},
        (0.25, 0.5, 1.0),
    ),
    "element": (
        ELEMENT,
        "quadratic_damping",
        {},
        {"d": 20.0, "k": 3e3, "force_off": 1.0, "c_2": 800.0},
        {"force": 0.05},
        (0.005, 0.01, 0.02),
    ),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("case", OTHER_RIGS)
def test_the_other_rigs_are_discovered_too(case: str, sweep: Callable[[float, float], np.ndarray]) -> None:
    rig: Rig
    rig, effect, constants, values, noise, amplitudes = OTHER_RIGS[case]
    rng = np.random.default_rng(0)
    structure = compose(rig, [effect_named(effect)])
    records = []
    for number, amplitude in enumerate((*amplitudes, 0.7 * amplitudes[-1])):
        role = "estimation" if number < len(amplitudes) else "validation"
        u = sweep(amplitude, 15.0)
        driven = Record(
            name=f"{role}_{amplitude}", dt=5e-3, signals={rig.inputs[0].name: u}, units={}, role=role
        )
        record = simulate(structure, {**constants, **values}, driven)
        seen = {name: record[name] + rng.normal(scale=std, size=u.size) for name, std in noise.items()}
        records.append(record.with_signals(**seen))
    found = discover(DiscoveryData(Campaign(case, rig, constants, {}, tuple(records)), noise))
    assert [term.name for term in found.kept] == [effect]
    coefficients = {**found.rig_parameters, **found.kept[0].coefficients}
    assert set(coefficients) == set(values) - {"A", "n"}
    for name, coefficient in coefficients.items():
        assert abs(coefficient.value - values[name]) < Z_MAX * coefficient.std, name
        if values[name] != 0.0:
            assert coefficient.value == pytest.approx(values[name], rel=0.03), name

"""One motion: effects whose push goes with the gap are looked at first, the others where none of these explains the records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest

from rigsight.campaign import Campaign
from rigsight.diagnose.diagnosis import diagnose
from rigsight.diagnose.fit_context import FitContext
from rigsight.diagnose.result import Diagnosis
from rigsight.diagnose.search.screening import Shortlist
from rigsight.diagnose.search.single_effects import reidentify
from rigsight.diagnose.search.worth_fitting import Search, search_places
from rigsight.effects import CATALOGUE, Effect, Family, effect_named
from rigsight.effects import symbols as canonical
from rigsight.excitation import linear_sweep
from rigsight.identify import characteristic_scales
from rigsight.identify.fit.windows import liveliest
from rigsight.records import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate

from ...tiers import slow_but

DT, N, NOISE = 5e-3, 2000, 2e-5
VALUES = {"gain": 1.0, "m": 2.0, "d": 5.0, "k": 800.0, "x_off": 0.0, "force_off": 0.0}
HIDDEN: list[tuple[str, Mapping[str, float]]] = [
    ("cubic_stiffness", {"k_3": 3e4}),
    ("cubic_stiffness", {"k_3": -1e4}),
    ("coulomb_friction", {"T_c": 0.3}),
    ("input_dead_zone", {"u_0": 0.4}),
    ("sensor_lag", {"T_m": 0.01}),
]


def records(effects: Sequence[Effect], values: Mapping[str, float]) -> tuple[Record, ...]:
    """Sweeps after a second of rest: two to fit and one to score."""
    rng, t = np.random.default_rng(0), DT * np.arange(N)
    structure = compose(AXIS, effects)
    found = []
    for name, role, amplitude in (
        ("1", "estimation", 2.0),
        ("2", "estimation", 4.0),
        ("3", "validation", 3.0),
    ):
        u = np.concatenate([np.zeros(200), linear_sweep(t[200:], amplitude, 3.0, 60.0)])
        driven = Record(name, DT, {"u": u}, {"u": "N"}, role=role, kind="sweep", amplitude=amplitude)
        clean = simulate(structure, {**VALUES, **values}, driven)
        found.append(clean.with_signals(x=clean["x"] + rng.normal(scale=NOISE, size=N)))
    return tuple(found)


def diagnosed(effects: Sequence[str], values: Mapping[str, float], tried: Sequence[str]) -> Diagnosis:
    hidden = [effect_named(name) for name in effects]
    campaign = Campaign("stage", AXIS, {"gain": 1.0}, {}, records(hidden, values))
    return diagnose(campaign, [effect_named(name) for name in tried])


def examined(name: str, values: Mapping[str, float]) -> tuple[Search, list[Effect]]:
    fitted = tuple(record for record in records([effect_named(name)], values) if record.role == "estimation")
    scales = characteristic_scales(AXIS, fitted, VALUES)
    context = FitContext(AXIS, fitted, fitted, fitted, scales, {"x": NOISE}, frozenset(), VALUES)
    offered = context.offered(CATALOGUE)
    return search_places(context, reidentify(context, VALUES), offered), offered


@pytest.mark.slow
@pytest.mark.parametrize(("name", "values"), slow_but(HIDDEN[0], HIDDEN[3], of=HIDDEN), ids=str)
def test_the_true_one_is_looked_at_first_and_its_push_tells_its_size(
    name: str, values: Mapping[str, float]
) -> None:
    search, offered = examined(name, values)
    first = {effect.name for effect in search.effects}
    assert name in first
    assert search.others
    assert first | {effect.name for effect in search.others} == {effect.name for effect in offered}
    # What pulsates by itself goes with no motion; a relative starts from the fit of the simpler one.
    assert "periodic_disturbance" in first
    parents = {parent for effect in search.effects for parent in effect.parents}
    assert parents & {effect.name for effect in offered} <= first
    for own, true in values.items():
        assert 0.5 < search.starts[name][own] / true < 2.0


def test_no_push_claims_what_other_numbers_of_the_equations_take_away() -> None:
    """Numbers that suit all records do not suit the stretches of resonance in them: any push comes with other ones there."""
    fitted = tuple(
        r for r in records([effect_named("cubic_stiffness")], {"k_3": 2e7}) if r.role == "estimation"
    )
    scales = characteristic_scales(AXIS, fitted, VALUES)
    context = FitContext(
        AXIS, fitted, fitted, liveliest(fitted, AXIS, 600), scales, {"x": NOISE}, frozenset(), VALUES
    )
    at_the_drive = [effect_named(name) for name in ("input_delay", "actuator_lag", "input_dead_zone")]
    lineup = Shortlist(context, reidentify(context, VALUES), liveliest=True)
    assert all(suspect.share < 0.1 for suspect in lineup.suspects(at_the_drive))


@pytest.mark.slow
def test_what_the_motion_rules_out_is_not_fitted_for_a_remainder() -> None:
    """No law of the catalogue is this spring, but no friction or damping explains the force along the motion."""
    cubic = effect_named("cubic_stiffness")
    law = replace(cubic, torque=cubic.torque / (1 + 1e4 * canonical.x**2))
    campaign = Campaign("stage", AXIS, {"gain": 1.0}, {}, records([law], {"k_3": 5e6}))
    found = diagnose(campaign, CATALOGUE)
    fitted = {effect_named(name).family for candidate in found.candidates for name in candidate.effects}
    assert fitted == {Family.SPRING_LAW, Family.PLAY_AND_STOPS}
    assert min(candidate.error_over_noise for candidate in found.candidates) > 3.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("at_once", "values"),
    slow_but(
        ("input_dead_zone", {"u_0": 0.4}),
        of=[("input_dead_zone", {"u_0": 0.4}), ("input_saturation", {"u_max": 2.2})],
    ),
)
def test_a_lag_beside_a_limited_drive_is_no_other_form_of_it(
    at_once: str, values: Mapping[str, float]
) -> None:
    hidden = (at_once, "actuator_lag")
    tried = (*hidden, "coulomb_friction", "cubic_stiffness", "quadratic_damping")
    found = diagnosed(hidden, {**values, "T_a": 0.01}, tried)
    assert set(found.effects) == set(hidden)

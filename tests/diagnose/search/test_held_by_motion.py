"""A fit that tracks the sensors may not hide a missing force behind a mass that the measured motion rules out."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.campaign import Campaign
from rigsight.diagnose.fit_context import (
    FitContext,
    FittedModel,
    candidates_on,
    fit_context_of,
    start_values_of,
)
from rigsight.diagnose.search.fitted_models import held_by_motion
from rigsight.diagnose.search.single_effects import fit_candidate, reidentify
from rigsight.effects import CATALOGUE, effect_named
from rigsight.identify import IdleThreads
from rigsight.identify.fit.windows import Observer, Windowing
from rigsight.inverse import Proposal, propose
from rigsight.records import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate

VALUES = {"gain": 1.0, "m": 0.002, "d": 0.2, "k": 0.0, "x_off": 0.0, "force_off": 0.0, "T_c": 0.3}
DT, STEP = 0.02, 1.5e-3
NOISE = {"x": STEP / np.sqrt(12.0)}


@pytest.fixture(scope="module")
def servo() -> Campaign:
    """Return a light joint with dry friction: coarse encoder, and a drive that differs a little from its log."""
    rng, t = np.random.default_rng(0), DT * np.arange(1500)
    records = []
    for i in range(2):
        tones = zip(
            rng.uniform(0.1, 0.25, 6), rng.uniform(0.5, 6.0, 6), rng.uniform(0.0, 6.3, 6), strict=True
        )
        u = sum(size * np.sin(pulsation * t + phase) for size, pulsation, phase in tones)
        driven = Record(f"run {i}", DT, {"u": u + 0.02 * rng.standard_normal(t.size)}, {}, hold="zoh")
        run = simulate(compose(AXIS, [effect_named("coulomb_friction")]), VALUES, driven)
        read = STEP * np.round(run["x"] / STEP)
        records.append(Record(f"run {i}", DT, {"u": u, "x": read}, {}, hold="zoh"))
    return Campaign("servo", AXIS, {"gain": 1.0}, {}, tuple(records))


def fitted(servo: Campaign, noise: dict[str, float]) -> tuple[FitContext, FittedModel, Proposal]:
    """Return the equations fitted to the sensors alone, and what the motion says of the force that they leave."""
    start, tracking = start_values_of(servo), Windowing(observer=Observer(("x",), 10.0))
    context = fit_context_of(servo, noise, tracking, None, IdleThreads(1), start)
    alone = reidentify(context, start)
    known = {**servo.constants, **alone.fit.values}
    proposal = propose(servo, known, candidates_on(AXIS, CATALOGUE), noise)
    assert proposal is not None
    return context, alone, proposal


def test_friction_shows_beside_the_mass_of_the_measured_motion_alone(servo: Campaign) -> None:
    context, alone, proposal = fitted(servo, NOISE)
    held, after = held_by_motion(context, alone, proposal)
    assert held.along_motion is not None
    assert after.fit.values["m"] < 0.3 * alone.fit.values["m"], "the large mass hides the friction"
    friction = effect_named("coulomb_friction")
    left = [
        fit_candidate(own, (friction,), base.fit).error_over_noise / base.error_over_noise
        for own, base in ((context, alone), (held, after))
    ]
    assert left[0] > 0.9, "beside it friction seems to be of no use"
    assert left[1] < 0.5


def test_equations_that_follow_the_sensors_are_fitted_to_them_alone(servo: Campaign) -> None:
    context, alone, proposal = fitted(servo, {"x": 1.0})
    held, after = held_by_motion(context, alone, proposal)
    assert held.along_motion is None
    assert after is alone

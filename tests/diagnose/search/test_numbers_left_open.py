"""Where a fit without the missing effect leaves the numbers of a servo open, the search goes on from those given."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.campaign import Campaign
from rigsight.diagnose.fit_context import FitContext, fit_context_of
from rigsight.diagnose.search.first_look import look_at
from rigsight.diagnose.search.fitted_models import single_models
from rigsight.diagnose.search.single_effects import reidentify
from rigsight.effects import effect_named, placed
from rigsight.identify import IdleThreads
from rigsight.identify.fit.windows import Windowing
from rigsight.records import Record
from rigsight.rigs.reading.rig_file import rig_of_text
from rigsight.simulate import compose, simulate

ARM = rig_of_text(
    """
name = "arm"
summary = "A position servo holds a pendulum."
[inputs.goal]
unit = "rad"
[constants.k_v]
unit = "N m s/rad"
[constants.weight]
unit = "N m"
[parameters.k_p]
unit = "N m/rad"
[parameters.d]
unit = "N m s/rad"
lower = 0.0
[parameters.J]
unit = "kg m^2"
lower = 0.0
[coordinates.q]
unit = "rad"
[energy]
kinetic = "J*d(q)^2/2"
potential = "-weight*cos(q)"
[joints.hinge]
motion = "q"
damping = "d"
[drives.servo]
signal = "goal"
force = "k_p*(servo - q) - k_v*d(q)"
along = "q"
[sensors.angle]
reads = "q"
unit = "rad"
""",
    "arm.toml",
)
KNOWN = {"k_v": 0.3, "weight": 0.6}
GIVEN = {"k_p": 25.0, "d": 0.15, "J": 0.022}
DT, NOISE, RECIPROCAL = 0.01, 2e-4, 2.4
INTEGRAL, SPEED_LOOP = (
    placed(effect_named(name), "servo") for name in ("integral_action", "speed_loop_integral")
)


@pytest.fixture(scope="module")
def pi_controlled() -> tuple[Campaign, FitContext]:
    t, rng, records = DT * np.arange(800), np.random.default_rng(0), []
    for number, amplitude in enumerate((0.4, 0.8)):
        goal = amplitude * np.sin((2.0 + number) * t) * np.sin(0.5 * t) + 0.1 * np.sin(9.0 * t)
        values = {**KNOWN, **GIVEN, "r_i": RECIPROCAL}
        run = simulate(compose(ARM, [INTEGRAL]), values, Record(f"run {number}", DT, {"goal": goal}, {}))
        records.append(run.with_signals(angle=run["angle"] + NOISE * rng.standard_normal(t.size)))
    own = Campaign("arm", ARM, KNOWN, GIVEN, tuple(records))
    start = {**KNOWN, **GIVEN}
    return own, fit_context_of(own, {"angle": NOISE}, Windowing(), None, IdleThreads(1), start)


def test_causes_are_sought_along_the_motion_at_the_numbers_given(
    pi_controlled: tuple[Campaign, FitContext],
) -> None:
    own, context = pi_controlled
    assert context.leaves_numbers_open(reidentify(context, context.start).fit)
    models = single_models(own, context, Windowing(), [INTEGRAL, SPEED_LOOP], lambda _: None)
    assert models.proposal is not None
    (first, *_) = models.proposal.taken
    assert first.effect.name == INTEGRAL.name
    assert first.values["r_i"] == pytest.approx(RECIPROCAL, rel=0.01)


def test_a_start_along_the_motion_is_beside_the_numbers_given(
    pi_controlled: tuple[Campaign, FitContext],
) -> None:
    _, context = pi_controlled
    base = reidentify(context, context.start).fit
    found = look_at(context, (INTEGRAL,), base, {}, [{"r_i": 1.0}], are_enough=True)
    assert found.fits[0].values["k_p"] == pytest.approx(GIVEN["k_p"], rel=0.05)

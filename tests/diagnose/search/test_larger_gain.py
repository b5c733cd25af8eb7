"""A linear fit to a drive in its limit takes what is cut off for a small gain: fits of the limit start from a larger one."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.campaign import Campaign
from rigsight.diagnose.fit_context import FitContext, candidates_on, fit_context_of
from rigsight.diagnose.policy import SEARCH
from rigsight.diagnose.search.single_effects import fit_candidate, reidentify
from rigsight.diagnose.search.starts import start_values
from rigsight.effects import effect_named, placed
from rigsight.identify import IdleThreads
from rigsight.identify.fit.windows import Windowing
from rigsight.records import Record
from rigsight.rigs.reading.rig_file import rig_of_text
from rigsight.simulate import compose, simulate

from ...inverse.test_drive_gain import PAYLOAD
from ...inverse.test_drive_gain import SERVO as WEIGHED_SERVO
from ...inverse.test_proposal import campaign

SERVO = rig_of_text(
    """
name = "servo"
summary = "A servo turns an arm of known inertia."
[inputs.goal]
unit = "rad"
[constants.J]
unit = "kg m^2"
default = 0.005
[parameters.k_p]
unit = "N m/rad"
lower = 1e-3
log = true
[parameters.d]
unit = "N m s/rad"
lower = 0.0
[coordinates.q]
unit = "rad"
[energy]
kinetic = "J*d(q)^2/2"
[joints.gearbox]
motion = "q"
damping = "d"
[drives.motor]
signal = "k_p*(goal - angle)"
force = "motor"
along = "q"
[sensors.angle]
reads = "q"
unit = "rad"
""",
    "servo.toml",
)
LIMIT = placed(effect_named("input_saturation"), "motor")
VALUES = {"J": 0.005, "k_p": 3.0, "d": 0.06, "u_max": 0.03}
DT, NOISE = 0.01, 1e-3


@pytest.fixture(scope="module")
def context() -> FitContext:
    t, rng, records = DT * np.arange(600), np.random.default_rng(0), []
    for number, amplitude in enumerate((0.6, 1.2)):
        goal = amplitude * np.sign(np.sin((2.0 + number) * t)) + 0.2 * np.sin(9.0 * t)
        run = simulate(compose(SERVO, [LIMIT]), VALUES, Record(f"run {number}", DT, {"goal": goal}, {}))
        records.append(run.with_signals(angle=run["angle"] + NOISE * rng.standard_normal(t.size)))
    campaign = Campaign("servo", SERVO, {"J": 0.005}, {}, tuple(records))
    start = {"J": 0.005, "k_p": 0.05, "d": 0.01}
    return fit_context_of(campaign, {"angle": NOISE}, Windowing(), None, IdleThreads(1), start)


def test_one_start_has_a_larger_gain_and_the_same_limit_of_the_force(context: FitContext) -> None:
    base = reidentify(context, context.start).fit
    structure = context.simplest((LIMIT,), base.structure)
    (*_, last), first = list(start_values(context, structure, LIMIT, base, {})), base.values["k_p"]
    assert last["k_p"] == pytest.approx(SEARCH.larger_gain * first)
    friction = placed(effect_named("coulomb_friction"), "gearbox")
    with_friction = context.simplest((friction,), base.structure)
    assert all(v["k_p"] == first for v in start_values(context, with_friction, friction, base, {}))


def test_the_limit_of_a_drive_that_is_nearly_always_in_it_is_found(context: FitContext) -> None:
    base = reidentify(context, context.start)
    assert base.error_over_noise > 10.0
    found = fit_candidate(context, (LIMIT,), base.fit)
    assert found.error_over_noise < 1.2
    assert found.fit.values["u_max"] == pytest.approx(VALUES["u_max"], rel=0.02)


def test_a_limit_of_what_drives_a_gain_is_smaller_where_the_gain_is_larger() -> None:
    limit, names = effect_named("input_saturation"), {**PAYLOAD, "J": 2e-3, "k_v": 0.6, "d": 0.02}
    own = campaign(WEIGHED_SERVO, names, [], (0.3, 0.5))
    context = fit_context_of(own, {"angle": NOISE}, Windowing(), None, IdleThreads(1), names)
    (placed_limit,) = candidates_on(WEIGHED_SERVO, [limit])
    base = reidentify(context, context.start).fit
    structure = context.simplest((placed_limit,), base.structure)
    first, *_, last = start_values(context, structure, placed_limit, base, {})
    assert last["k_v"] == pytest.approx(SEARCH.larger_gain * first["k_v"])
    assert last["k_v"] * last["u_max"] == pytest.approx(first["k_v"] * first["u_max"])

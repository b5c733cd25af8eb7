"""No effect alone ends above the equations without it, wherever its declared starts lead."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rigsight.campaign import Campaign
from rigsight.diagnose.fit_context import fit_context_of, start_values_of
from rigsight.diagnose.search.single_effects import fit_candidates, reidentify
from rigsight.effects import effect_named, placed
from rigsight.identify import IdleThreads
from rigsight.identify.fit.windows import Windowing
from rigsight.records import Record
from rigsight.rigs import read_rig_file
from rigsight.simulate import compose, simulate

PENDULUM = """
name = "pendulum"
summary = "A pendulum swings freely; its angle counts from upright, so that it hangs at pi."

[constants.J]
unit = "kg m^2"
about = "inertia about the pivot"
default = 1.0

[parameters.c_g]
unit = "N m"
lower = 1e-3
log = true
about = "weight times lever"
[parameters.d]
unit = "N m s/rad"
lower = 0.0
about = "viscous friction"

[coordinates.q]
unit = "rad"

[energy]
kinetic = "J*d(q)^2/2"
potential = "c_g*cos(q)"

[joints.pivot]
motion = "q"
damping = "d"

[sensors.angle]
reads = "q"
unit = "rad"
"""


@pytest.mark.slow
def test_a_law_about_zero_does_no_harm_to_a_pendulum_that_hangs_at_pi(tmp_path: Path) -> None:
    path = tmp_path / "pendulum.toml"
    path.write_text(PENDULUM, encoding="utf-8")
    rig, dt, noise = read_rig_file(path), 0.004, 4e-5
    rng, t, records = np.random.default_rng(0), 0.004 * np.arange(2300), []
    drag = placed(effect_named("quadratic_damping"), "pivot")
    values = {"J": 1.0, "c_g": 64.0, "d": 0.05, "c_2": 2e-3}
    for i, swing in enumerate((1.6, 1.1, 0.8, 0.5)):
        still = Record(f"decay_{i}", dt, {"angle": np.full(t.size, np.pi)}, {"angle": "rad"})
        angle = simulate(compose(rig, [drag]), values, still, np.array([np.pi + swing, 0.0]))["angle"]
        role = "validation" if i == 3 else "estimation"
        records.append(
            Record(f"decay_{i}", dt, {"angle": angle + noise * rng.standard_normal(t.size)}, {}, role=role)
        )
    campaign = Campaign("pendulum", rig, {"J": 1.0}, {}, tuple(records))
    context = fit_context_of(
        campaign, {"angle": noise}, Windowing(), None, IdleThreads(1), start_values_of(campaign)
    )
    reidentified = reidentify(context, context.start)
    (model,) = fit_candidates(context, reidentified, [effect_named("cubic_stiffness")])
    assert model.fit.cost < 1.01 * reidentified.fit.cost

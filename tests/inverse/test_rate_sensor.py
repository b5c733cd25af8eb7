"""Does the regression see a motion that a rate sensor with a zero of its own shows?"""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.campaign import Campaign
from rigsight.diagnose.fit_context import candidates_on
from rigsight.effects import CATALOGUE, effect_named
from rigsight.inverse import propose, record_motion
from rigsight.inverse.equation_fit import EquationFit
from rigsight.inverse.missing_force import forces_along
from rigsight.records import Record
from rigsight.rigs.reading.rig_file import rig_of_text
from rigsight.simulate import compose, simulate

PENDULUM = rig_of_text(
    """
name = "pendulum"
summary = "A pendulum with a rate gyro."
[constants.J]
unit = "kg m^2"
default = 1.0
[parameters.k]
unit = "N m/rad"
lower = 0.0
[parameters.d]
unit = "N m s/rad"
lower = 0.0
[parameters.zero]
unit = "rad/s"
[coordinates.phi]
unit = "rad"
[energy]
kinetic = "J*d(phi)^2/2"
[joints.pivot]
motion = "phi"
stiffness = "k"
damping = "d"
[sensors.gyro]
reads = "d(phi) + zero"
unit = "rad/s"
""",
    "pendulum.toml",
)
DT = 0.02
VALUES = {"J": 1.0, "k": 15.7, "d": 0.02, "zero": 1.36, "T_c": 0.03}


def swings() -> tuple[Record, ...]:
    """Free decays by friction at the pivot, with the noise of a gyro."""
    structure, rng = compose(PENDULUM, [effect_named("coulomb_friction")]), np.random.default_rng(0)
    still = {"gyro": np.zeros(500)}
    records = []
    for i, angle in enumerate((0.25, 0.18)):
        released = np.array([angle, 0.0])
        run = simulate(structure, VALUES, Record(f"swing {i}", DT, still, {}), released)
        records.append(run.with_signals(gyro=run["gyro"] + 8e-3 * rng.standard_normal(500)))
    return tuple(records)


def test_the_motion_is_that_without_the_zero_of_the_sensor() -> None:
    swing = swings()[0]
    motion = record_motion(PENDULUM, swing, VALUES)
    assert motion is not None
    assert motion.drifts
    assert motion.z[1] == pytest.approx(swing["gyro"] - VALUES["zero"], abs=0.05)
    assert float(np.max(motion.z[0])) == pytest.approx(0.25, rel=0.1)


@pytest.mark.parametrize("zero", [1.36, 1.358])
def test_friction_is_found_beside_the_drift_of_the_integrated_reading(zero: float) -> None:
    own = Campaign("swings", PENDULUM, {"J": 1.0}, {}, swings())
    found = propose(own, {**VALUES, "zero": zero}, candidates_on(PENDULUM, CATALOGUE))
    assert found is not None
    assert found.alone[0].family == "dry_friction"


def test_the_missing_force_of_a_motion_that_drifts_has_its_true_size() -> None:
    motions = [motion for swing in swings() if (motion := record_motion(PENDULUM, swing, VALUES)) is not None]
    assert all(motion.drifts for motion in motions)
    (along,) = forces_along(EquationFit(PENDULUM, motions, (), (), VALUES), VALUES, None)
    force = np.concatenate([motion.some(own) for motion, own in zip(motions, along.force, strict=True)])
    # Friction of 0.03 N m; the noise of the gyro, differentiated, adds to it.
    assert 0.02 < float(np.sqrt(np.mean(force**2))) < 0.1
    assert float(np.corrcoef(force, np.concatenate([m.some(np.sign(m.z[1])) for m in motions]))[0, 1]) > 0.5


def test_rows_of_a_motion_that_drifts_count_wherever_it_moves() -> None:
    t = DT * np.arange(1000)
    moves = t > 4.0
    swing = swings()[0].with_signals(gyro=VALUES["zero"] + np.where(moves, np.sin(4.0 * t), 0.0))
    motion = record_motion(PENDULUM, swing, VALUES)
    assert motion is not None
    assert motion.drifts
    assert np.mean(motion.row_weights > 0.0) == pytest.approx(np.mean(moves), abs=0.05)

"""One motion that two sensors read: what the second one does wrong is a candidate, and the equations do not judge it."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.campaign import Campaign
from rigsight.diagnose.diagnosis import diagnose
from rigsight.diagnose.fit_context import candidates_on
from rigsight.effects import CATALOGUE, effect_named, placed
from rigsight.inverse import propose
from rigsight.records import Record
from rigsight.rigs import RIGS
from rigsight.rigs.reading.rig_file import rig_of_text
from rigsight.simulate import compose, simulate

FLYWHEEL = rig_of_text(
    """
name = "flywheel"
summary = "A motor turns a flywheel; an encoder and a gyro read its motion."
[inputs.tau]
unit = "N m"
[parameters.J]
unit = "kg m^2"
lower = 1e-7
log = true
[parameters.b]
unit = "N m s/rad"
lower = 0.0
[coordinates.q]
unit = "rad"
[energy]
kinetic = "J*d(q)^2/2"
[joints.bearing]
motion = "q"
damping = "b"
[drives.motor]
signal = "tau"
force = "motor"
along = "q"
[sensors.angle]
reads = "q"
unit = "rad"
[sensors.gyro]
reads = "d(q)"
unit = "rad/s"
""",
    "flywheel.toml",
)
DT, N = 2e-3, 4000
T = DT * np.arange(N)
TRUTH = {"J": 4e-3, "b": 0.01, "c_2": 6e-4, "T_s": 0.007}


@pytest.fixture(scope="module")
def campaign() -> Campaign:
    """Return records of a flywheel with fluid drag, whose gyro is 7 ms late."""
    late = placed(effect_named("sensor_delay"), "gyro")
    structure = compose(FLYWHEEL, [effect_named("quadratic_damping"), late])
    records = []
    for i, role in enumerate(("estimation", "estimation", "validation")):
        rng = np.random.default_rng(i)
        tones = zip(rng.uniform(0.2, 2.0, 6), rng.uniform(0.0, 2.0 * np.pi, 6), strict=True)
        drive = 0.14 * np.minimum(T / 0.5, 1.0) * sum(np.sin(2.0 * np.pi * f * T + p) for f, p in tones)
        run = simulate(structure, TRUTH, Record(f"run {i}", DT, {"tau": drive}, {}, hold="zoh"))
        angle = run["angle"] + 1e-4 * rng.standard_normal(N)
        gyro = run["gyro"] + 0.02 * rng.standard_normal(N)
        records.append(
            Record(f"run {i}", DT, {"tau": drive, "angle": angle, "gyro": gyro}, {}, hold="zoh", role=role)
        )
    return Campaign("flywheel", FLYWHEEL, {}, {"J": 4e-3, "b": 0.012}, tuple(records))


def test_of_several_sensors_the_further_ones_are_places() -> None:
    names = {effect.name for effect in candidates_on(FLYWHEEL, CATALOGUE)}
    assert {"sensor_delay", "sensor_delay@gyro", "encoder_eccentricity", "quadratic_damping"} <= names
    places = [
        FLYWHEEL.where(effect)
        for effect in (effect_named("sensor_delay"), placed(effect_named("sensor_delay"), "gyro"))
    ]
    assert places == ["angle", "gyro"]
    # The gyro shows no position, and what follows the motion of the running gear has effects of its own.
    assert "encoder_eccentricity@gyro" not in names
    assert not any("@" in effect.name for effect in candidates_on(RIGS["running_gear"], CATALOGUE))


def test_the_equations_do_not_judge_sensors_of_which_there_are_too_many(campaign: Campaign) -> None:
    found = propose(campaign, campaign.given, candidates_on(FLYWHEEL, CATALOGUE))
    assert found is not None
    assert found.taken[0].effect.name == "quadratic_damping"
    assert not any(name.startswith(("sensor_", "encoder_", "time_shift")) for name in found.judged)


@pytest.mark.slow
def test_a_late_gyro_is_named_beside_drag(campaign: Campaign) -> None:
    found = diagnose(campaign, CATALOGUE)
    probable = {(str(own.family), own.where) for own in found.families if own.probability > 0.5}
    assert probable == {("damping_law", "bearing"), ("delay_or_lag", "gyro")}

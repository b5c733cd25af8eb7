"""Where no effect explains the gap of a rig of several joints, the force that is missing is traced to its joint."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rigsight.campaign import Campaign
from rigsight.diagnose.diagnosis import diagnose
from rigsight.diagnose.verdict.judgement import traced_to
from rigsight.effects import effect_named, placed
from rigsight.identify.fit.windows import liveliest
from rigsight.inverse import MissingForce
from rigsight.records.record import Record
from rigsight.rigs import RIGS

TRAIN = RIGS["drive_train"]
HIDDEN = [placed(effect_named("quadratic_damping"), "load_bearing")]


def force(joint: str, share: float) -> MissingForce:
    nothing = np.zeros(0)
    return MissingForce(joint, "rad", "N m", share, 1.0, (), nothing, nothing, nothing, nothing)


def without(record: Record, sensor: str) -> Record:
    return replace(record, signals={n: s for n, s in record.signals.items() if n != sensor})


@pytest.mark.slow
def test_a_missing_force_is_traced_to_its_joint(train: Any) -> None:
    """Neither candidate is the quadratic damping of the load; no push of theirs takes much of the gap away."""
    records = replace(train, n_samples=240).records(HIDDEN, {"c_2": 1e-3})
    found = diagnose(Campaign("train", TRAIN, {"k_t": 0.05}, {}, records), [effect_named("sensor_lag")])
    assert (found.verdict, found.where) == ("unknown", ("load_bearing",))
    reported = json.loads(json.dumps(found.to_json(), allow_nan=False))["missing_force"]
    first, *others = reported["joints"]
    assert (first["where"], {one["where"] for one in others}) == ("load_bearing", {"shaft", "motor_bearing"})
    assert first["share"] > 0.9
    at, force = (np.array(first["over_velocity"][key]) for key in ("signal", "force"))
    # The damping of the re-identified equations holds part of it.
    coefficients = np.linalg.lstsq(np.column_stack([at * np.abs(at), at]), force, rcond=None)[0]
    assert coefficients[0] == pytest.approx(1e-3, rel=0.3)


def test_only_a_single_force_that_agrees_with_all_sensors_is_evidence() -> None:
    shaft, load = force("shaft", 0.4), force("load_bearing", 0.9)
    assert traced_to(TRAIN, [load, shaft]) == ("load_bearing",)
    assert traced_to(TRAIN, [load, force("shaft", 0.85)]) == ()
    assert traced_to(TRAIN, [force("load_bearing", 0.45), force("shaft", 0.1)]) == ()
    assert traced_to(TRAIN, []) == ()


def test_a_force_where_a_drive_acts_may_be_the_drive() -> None:
    assert traced_to(TRAIN, [force("motor_bearing", 0.9), force("shaft", 0.4)]) == ("motor_bearing", "motor")


def test_long_records_need_no_sensor_in_common() -> None:
    angles = {"motor_angle": np.sin(np.arange(5000.0)), "load_angle": np.linspace(0.0, 1.0, 5000)}
    both = Record("both", 1e-3, {"u": np.zeros(5000), **angles}, {})
    found = liveliest((without(both, "load_angle"), without(both, "motor_angle")), TRAIN, 2000)
    assert [one.n_samples for one in found] == [1000, 1000]

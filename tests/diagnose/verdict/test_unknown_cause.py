"""Where no effect explains the gap of a rig of several joints, the force that is missing is traced to its joint."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rigsight.campaign import Campaign
from rigsight.diagnose import diagnose
from rigsight.diagnose.fitting.fit_context import FitContext, FittedModel, liveliest
from rigsight.diagnose.verdict.main_cause import force_of_one_motion, traced_to
from rigsight.discover import JointForce, JointLaw
from rigsight.effects import effect_named, placed
from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.records.record import Record
from rigsight.rigs import AXIS, RIGS
from rigsight.simulate import compose, simulate

TRAIN = RIGS["drive_train"]
HIDDEN = [placed(effect_named("quadratic_damping"), "load_bearing")]


def force(joint: str, left: float) -> JointForce:
    return JointForce(joint, "rad", "N m", (), 0.9, left, 1e-3, JointLaw((), 0.0, {}), {}, 1.0)


def without(record: Record, sensor: str) -> Record:
    return replace(record, signals={n: s for n, s in record.signals.items() if n != sensor})


@pytest.mark.slow
def test_a_missing_force_is_traced_to_its_joint(train: Any) -> None:
    """Neither candidate is the quadratic damping of the load; no push of theirs takes much of the gap away."""
    records = replace(train, n_samples=240).records(HIDDEN, {"c_2": 1e-3})
    found = diagnose(Campaign("train", TRAIN, {"k_t": 0.05}, {}, records), [effect_named("sensor_lag")])
    assert (found.verdict, found.where) == ("unknown", ("load_bearing",))
    reported = json.loads(json.dumps(found.to_json(), allow_nan=False))
    assert reported["missing_force"] is None
    first, *others = reported["missing_force_by_joint"]
    assert {one["where"] for one in others} == {"shaft", "motor_bearing"}
    assert first["error_in_noise_floors"] < 1.2
    (term,) = first["terms"]
    assert (term["name"], term["where"]) == ("quadratic_damping", "load_bearing")
    assert term["coefficients"]["c_2"]["value"] == pytest.approx(1e-3, rel=0.1)


@pytest.mark.slow
def test_sensor_zeros_of_single_records_do_not_bend_the_missing_force() -> None:
    values = {"gain": 1.0, "m": 2.0, "d": 3.0, "k": 800.0, "x_off": 0.0, "force_off": 0.0}
    noise, rng = {"x": 1e-6}, np.random.default_rng(1)
    records = []
    for name, amplitude, zero in (("a", 1.0, 5e-3), ("b", 1.5, -5e-3)):
        t = 0.01 * np.arange(1500)
        u = amplitude * sum(np.sin(2 * np.pi * f * t + rng.uniform(0, 6)) for f in np.linspace(0.5, 6.0, 20))
        record = Record(name, 0.01, {"u": u}, {})
        shown = simulate(compose(AXIS, [effect_named("cubic_stiffness")]), {**values, "k_3": 4e6}, record)
        read = shown["x"] + zero + 1e-6 * rng.standard_normal(t.size)
        records.append(record.with_signals(x=read).with_free_offsets(["x"]))
    scales = characteristic_scales(AXIS, records, values)
    fit = GreyBoxFit(compose(AXIS), records, scales, noise).fit(values, ["m", "d", "k"])
    several = tuple(records)
    context = FitContext(AXIS, several, several, several, scales, noise, frozenset())
    found = force_of_one_motion(context, FittedModel((), fit, fit, 100.0), True, np.random.default_rng(0))
    assert found is not None
    assert [term.term for term in found.terms] == ["x^3"]
    assert found.terms[0].coefficient == pytest.approx(4e6, rel=0.1)


def test_only_a_single_force_that_agrees_with_all_sensors_is_evidence() -> None:
    shaft, load = force("shaft", 40.0), force("load_bearing", 1.1)
    assert traced_to(TRAIN, [load, shaft]) == ("load_bearing",)
    assert traced_to(TRAIN, [load, force("shaft", 1.3)]) == ()
    assert traced_to(TRAIN, [force("load_bearing", 4.0), shaft]) == ()
    assert traced_to(TRAIN, []) == ()


def test_a_force_where_a_drive_acts_may_be_the_drive() -> None:
    assert traced_to(TRAIN, [force("motor_bearing", 1.1), force("shaft", 40.0)]) == ("motor_bearing", "motor")


def test_long_records_need_no_sensor_in_common() -> None:
    angles = {"motor_angle": np.sin(np.arange(5000.0)), "load_angle": np.linspace(0.0, 1.0, 5000)}
    both = Record("both", 1e-3, {"u": np.zeros(5000), **angles}, {})
    found = liveliest((without(both, "load_angle"), without(both, "motor_angle")), TRAIN, 2000)
    assert [one.n_samples for one in found] == [1000, 1000]

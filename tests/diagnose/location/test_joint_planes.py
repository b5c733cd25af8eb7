"""Each joint of a rig with several has its plane of states, with the force that the equations lack if it acts there."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.location import state_plane
from rigsight.diagnose.location.gap_parts import StatePart
from rigsight.diagnose.location.state_plane import joint_parts
from rigsight.diagnose.location.trace import Trace
from rigsight.diagnose.policy import MAPS
from rigsight.effects import effect_named, placed
from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.records.record import Record

FRICTION = 0.01


def reported(train: Any, records: tuple[Record, ...]) -> tuple[FitContext, FittedModel, list[Trace]]:
    """The true numbers without the friction on the record that judges."""
    fitted, scored = records[:2], records[2:]
    context = FitContext(
        train.rig, fitted, scored, fitted, characteristic_scales(train.rig, fitted, train.values),
        {signal.name: train.noise for signal in train.rig.outputs}, frozenset(),
    )  # fmt: skip
    fit = GreyBoxFit(context.composed(), fitted, context.scales, context.noise).fit(train.values, [])
    reidentified = context.score((), fit)
    traces = []
    for record, residual in zip(scored, reidentified.residuals, strict=True):
        shown = {s.name: record[s.name] for s in train.rig.outputs if s.name in record}
        names = [s.name for s in train.rig.outputs]
        left = {name: shown[name] - residual[:, names.index(name)] for name in shown}
        driven = {"u": record["u"]}
        traces.append(
            Trace(record.name, record.role, "sweep", None, record.t, driven, shown, left, left, left)
        )
    return context, reidentified, traces


@pytest.fixture(scope="module")
def hidden(train: Any) -> tuple[tuple[StatePart, ...], list[Trace]]:
    records = train.records([placed(effect_named("coulomb_friction"), "load_bearing")], {"T_c": FRICTION})
    context, reidentified, traces = reported(train, records)
    return joint_parts(context, reidentified, traces), traces


@pytest.mark.slow
def test_the_joint_of_the_friction_comes_first_and_lacks_it(
    hidden: tuple[tuple[StatePart, ...], list[Trace]],
) -> None:
    parts, _ = hidden
    assert parts[0].joint == "load_bearing"
    own = [part for part in parts if part.joint == "load_bearing" and part.output == "load_angle"]
    size = max(part.v_high for part in own)
    fast = [part for part in own if min(abs(part.v_low), abs(part.v_high)) > 0.2 * size]
    along = [-part.force_mean * np.sign(part.v_low + part.v_high) for part in fast]
    assert np.average(along, weights=[part.n_samples for part in fast]) == pytest.approx(FRICTION, rel=0.15)
    assert own[0].units["force_mean"] == "N m"


@pytest.mark.slow
def test_the_cells_of_each_plane_add_up_to_the_gap(hidden: tuple[tuple[StatePart, ...], list[Trace]]) -> None:
    parts, (trace,) = hidden
    for joint in ("shaft", "motor_bearing", "load_bearing"):
        for output in trace.measured:
            own = [part for part in parts if (part.joint, part.output) == (joint, output)]
            squares = sum(part.n_samples * part.reidentified**2 for part in own)
            gap = trace.residual("reidentified", output) / np.std(trace.measured[output])
            assert squares == pytest.approx(np.sum(gap**2), rel=1e-6)


@pytest.mark.slow
def test_of_long_records_the_stretch_with_the_largest_gap_is_mapped(
    train: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(state_plane, "MAPS", replace(MAPS, mapped_samples=300))
    context, reidentified, (trace,) = reported(train, train.records())
    late = {name: np.where(trace.t > 4.0, samples + 1.0, samples) for name, samples in trace.before.items()}
    parts = joint_parts(context, reidentified, [replace(trace, before=late, reidentified=late)])
    own = [part for part in parts if (part.joint, part.output) == ("shaft", "load_angle")]
    assert sum(part.n_samples for part in own) == 300
    assert min(part.reidentified for part in own) * np.std(trace.measured["load_angle"][-300:]) > 0.5


@pytest.mark.slow
def test_without_a_gap_no_force_is_lacking(train: Any) -> None:
    parts = joint_parts(*reported(train, train.records()))
    assert {part.joint for part in parts} == {"shaft", "motor_bearing", "load_bearing"}
    assert all(np.isnan(part.force_mean) for part in parts)


def test_beside_a_modelled_effect_there_is_none(train: Any) -> None:
    context, reidentified, traces = reported(train, train.records())
    modelled = replace(context, modelled=(placed(effect_named("coulomb_friction"), "shaft"),))
    assert joint_parts(modelled, reidentified, traces) == ()

"""A sensor that was zeroed anew between records is seen by its level, on a rig of several motions too."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from rigsight.diagnose.data_quality.finding import Finding
from rigsight.diagnose.data_quality.offsets_by_record import levels_apart
from rigsight.diagnose.fit_context import FitContext
from rigsight.records.record import Record
from rigsight.rigs import Rig

NUMBERS = {"m": 1.0, "k": 40.0, "c": 20.0, "d": 1.0}
T = 0.01 * np.arange(500)


def reported(rig: Rig, records: Sequence[Record], given: Mapping[str, float] = NUMBERS) -> list[Finding]:
    noise = {signal.name: 1e-4 for signal in rig.outputs}
    shown = tuple(records)
    return levels_apart(FitContext(rig, shown, shown, shown, {}, noise, frozenset(), given=given), shown)


def runs(zero: float, push: float = 0.0) -> list[Record]:
    moving = {"f_1": np.sin(T), "f_2": np.cos(T), "first_place": np.sin(T), "second_place": np.cos(T)}
    first = Record("first", T[1], moving, {})
    again = first.with_signals(second_place=moving["second_place"] + zero, f_1=moving["f_1"] + push)
    return [first, replace(again, name="again")]


def test_a_sensor_that_lies_elsewhere_in_another_record_is_named(two_masses: Rig) -> None:
    (found,) = reported(two_masses, runs(5.0))
    assert (found.kind, found.signal) == ("offset", "second_place")
    assert "'first' and 'again'" in found.sentence


def test_nothing_is_said_of_a_level_that_moves_less_than_the_rig(two_masses: Rig) -> None:
    assert reported(two_masses, runs(0.5)) == []


def test_what_another_push_or_payload_moves_is_no_offset(two_masses: Rig) -> None:
    assert reported(two_masses, runs(5.0, push=9.0)) == []
    first, again = runs(5.0)
    assert reported(two_masses, [first, replace(again, constants={"m": 2.0})]) == []


def test_a_rig_that_can_rest_anywhere_may_lie_anywhere(two_masses: Rig) -> None:
    assert reported(two_masses, runs(5.0), {**NUMBERS, "k": 0.0}) == []


def test_runs_forward_and_backward_are_no_other_zero(two_masses: Rig) -> None:
    assert reported(two_masses, runs(3.0, push=1.8)) == []
    assert len(reported(two_masses, runs(3.0))) == 1


def test_records_that_go_opposite_ways_from_one_place_have_the_same_zero(two_masses: Rig) -> None:
    first, again = runs(0.0)
    ways = [r.with_signals(second_place=way * 9.0 * T) for r, way in ((first, 1.0), (again, -1.0))]
    assert reported(two_masses, ways) == []
    shifted = [ways[0], ways[1].with_signals(second_place=ways[1]["second_place"] - 90.0)]
    assert len(reported(two_masses, shifted)) == 1

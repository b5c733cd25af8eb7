"""Whether parameters change with the amplitude is decided by their intervals, and said in one sentence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rigsight.identify.amplitude_dependence import amplitude_dependence
from rigsight.identify.identification import PathIdentification, RecordIdentification
from rigsight.identify.transfer.physical_parameters import PhysicalEstimates
from rigsight.records import Kind, Record

UNITS = {"k": "N/m", "d": "N s/m", "u": "A", "tau": "N m"}


def found(
    amplitude: float, k: float, d: float, kind: Kind = "sweep", error: float = 0.01
) -> RecordIdentification:
    record = Record(f"{kind}_{amplitude}", 0.01, {"u": np.arange(5.0)}, {}, kind=kind)
    values = {"k": k, "d": d}
    covariance = np.diag(np.square([error * k, error * d]))
    physical = PhysicalEstimates(("k", "d"), values, covariance, "by hand")
    return RecordIdentification(record, amplitude, (PathIdentification("u", "x", physical=physical),))


def test_a_change_beyond_the_intervals_is_told_with_its_direction() -> None:
    records = [found(1.0, 80.0, 2.0), found(0.25, 800.0, 2.01), found(0.5, 400.0, 1.99)]
    statement, changing = amplitude_dependence(records, UNITS)
    assert changing == ("k",)
    assert "from 0.25 to 1 A" in statement
    assert "k falls from 800 to 80 N/m" in statement
    assert "rigsight diagnose" in statement


def test_a_change_that_turns_back_is_no_fall() -> None:
    statement, _ = amplitude_dependence(
        [found(1.0, 80.0, 2.0), found(2.0, 160.0, 2.0), found(3.0, 90.0, 2.0)], UNITS
    )
    assert "k moves between 80 and 160 N/m" in statement


def test_an_inertia_that_changes_points_to_units_and_not_to_an_effect_alone() -> None:
    def weighed(amplitude: float, scale: float) -> RecordIdentification:
        one = found(amplitude, 80.0 * scale, 2.0 * scale)
        values = {"m": 40.0 * scale, "d": 2.0 * scale}
        physical = PhysicalEstimates(("m", "d"), values, np.diag([0.1, 0.01]), "by hand")
        return replace(one, paths=(PathIdentification("u", "x", physical=physical),))

    units = {"m": "kg", "d": "N s/m"}
    statement, _ = amplitude_dependence([weighed(1.0, 1.0), weighed(2.0, 1.0), weighed(3.0, 0.1)], units)
    assert "m differs by a factor of 10" in statement
    assert "check units and scales of input and output, first of record sweep_3.0" in statement
    alike, _ = amplitude_dependence([weighed(1.0, 1.0), weighed(2.0, 1.2)], units)
    assert "factor" not in alike


def test_scatter_inside_the_intervals_is_no_change() -> None:
    statement, changing = amplitude_dependence([found(1.0, 80.0, 2.0), found(2.0, 81.0, 1.98)], UNITS)
    assert changing == ()
    assert statement.startswith("No parameter changes")


def test_a_resonance_that_moves_is_told_where_intervals_are_too_wide() -> None:
    resonances = {1.0: 30.0, 2.0: 31.0, 3.0: 37.0}
    records = [
        replace(found(amplitude, 80.0 + amplitude, 2.0, error=0.5), resonance=resonance)
        for amplitude, resonance in resonances.items()
    ]
    statement, changing = amplitude_dependence(records, UNITS)
    assert changing == ()
    assert "is between 30 and 37 rad/s" in statement
    steady, _ = amplitude_dependence([replace(r, resonance=30.0) for r in records], UNITS)
    assert "resonance" not in steady


def test_a_step_is_not_compared_with_a_sweep() -> None:
    statement, changing = amplitude_dependence([found(1.0, 80.0, 2.0), found(2.0, 160.0, 2.0, "step")], UNITS)
    assert changing == ()
    # Two amplitudes they have.
    assert statement.startswith("No two records of the same kind have different amplitudes")


def test_why_records_cannot_be_compared_is_told_as_it_is() -> None:
    def statement(*records: RecordIdentification) -> str:
        return amplitude_dependence(records, UNITS)[0]

    one, other = found(1.0, 80.0, 2.0), found(2.0, 80.0, 2.0)
    assert statement(one, one).startswith("The records have only one amplitude")
    turned = replace(other, paths=(replace(other.motion, source="tau"),))
    assert statement(one, turned).startswith("No two records drive the same inputs at different amplitudes")
    unread = replace(other, paths=(replace(other.motion, physical=None),))
    assert statement(one, unread).startswith("Parameters were found at only one amplitude")


def test_amplitudes_have_the_unit_of_the_input_that_is_compared() -> None:
    first = found(0.5, 80.0, 2.0)
    first = replace(first, paths=(replace(first.motion, source="tau"),))
    records = [first, found(1.0, 80.0, 2.0), found(2.0, 160.0, 2.0)]
    assert "With amplitudes from 1 to 2 A" in amplitude_dependence(records, UNITS)[0]


def test_false_alarms_are_rare() -> None:
    rng = np.random.default_rng(5)
    alarms = 0
    for _ in range(300):
        scatter = 1.0 + 0.01 * rng.normal(size=(4, 2))
        records = [
            found(a, 80.0 * f, 2.0 * g) for a, (f, g) in zip((1.0, 2.0, 3.0, 4.0), scatter, strict=True)
        ]
        alarms += bool(amplitude_dependence(records, UNITS)[1])
    # One in a thousand is allowed for; three of 300 has a probability below 0.004 then.
    assert alarms <= 2

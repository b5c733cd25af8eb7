"""The amplitude of a record has the unit of its own source."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

from rigsight.identify.identification import Identification
from rigsight.report.identification import record_rows


def identified(**amplitudes: float) -> Identification:
    """Records by their source, each with its amplitude."""
    records = [SimpleNamespace(source=source, amplitude=value) for source, value in amplitudes.items()]
    return cast("Identification", SimpleNamespace(records=records, units={"u": "N", "x": "m"}))


def test_a_common_unit_stands_once() -> None:
    driven = identified(u=1.0)
    assert next(record_rows(driven, driven.records)) == ["amplitude [N]", "1"]


def test_each_amplitude_has_its_unit_where_a_record_decays_freely() -> None:
    both = identified(u=1.0, x=0.0177)
    assert next(record_rows(both, both.records)) == ["amplitude", "1 N", "0.0177 m"]
    assert next(record_rows(both, both.records[1:])) == ["amplitude", "0.0177 m"]

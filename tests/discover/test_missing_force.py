"""The force that is lacking is described by its shape along the motion, whatever its cause."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from rigsight.discover import RegressionData, missing_force
from rigsight.discover.missing_force import MissingForce
from rigsight.errors import InputError
from rigsight.identify import characteristic_scales, linear_start
from rigsight.records import Record


def shape_of(data: RegressionData, records: Sequence[Record] | None = None) -> MissingForce:
    """Return the shape on some records, with the linear values of all of them."""
    estimation = [record for record in data.records if record.role == "estimation"]
    values = {**data.campaign.constants, **linear_start(data.rig, estimation, data.campaign.constants, {})}
    scales = characteristic_scales(data.rig, estimation, values)
    rng = np.random.default_rng(0)
    return missing_force(data.rig, records or estimation, values, scales, data.noise["x"], rng)


def test_a_cube_is_seen_as_a_cube(make_data) -> None:
    values, data = make_data("cubic", 2e-5)
    found = shape_of(data)
    (term,) = found.terms
    assert term.term == "x^3"
    assert term.coefficient == pytest.approx(values["k_3"], rel=0.05)
    assert term.unit == "N/m^3"
    assert found.share > 0.9
    assert "x^3" in found.sentence


def test_a_product_that_no_effect_has_is_seen(make_data) -> None:
    values, data = make_data("monomial", 2e-5)
    (term,) = shape_of(data).terms
    assert set(term.term.split()) == {"x", "v"}
    assert term.coefficient == pytest.approx(values["c_11"], rel=0.05)


def test_nothing_is_seen_where_nothing_is_lacking(make_data) -> None:
    found = shape_of(make_data("linear", 2e-5)[1])
    assert found.terms == ()
    assert found.to_json()["terms"] == []
    assert found.sentence.startswith("No product")


@pytest.mark.parametrize("dt", [2.5e-3, 1e-2])
def test_records_of_different_sample_times_show_the_same_force(make_data, dt: float) -> None:
    values, data = make_data("cubic", 2e-5, sample_times={0.6: dt})
    (term,) = shape_of(data).terms
    assert term.term == "x^3"
    assert term.coefficient == pytest.approx(values["k_3"], rel=0.05)


def test_a_record_shorter_than_a_window_changes_nothing(make_data) -> None:
    _, data = make_data("cubic", 2e-5, validation=False)
    tail = replace(data.records[0].slice(-40, None), name="tail")
    assert shape_of(data, [*data.records, tail]).terms == shape_of(data).terms


def test_records_that_are_all_too_short_are_refused(make_data) -> None:
    _, data = make_data("cubic", 2e-5, validation=False)
    with pytest.raises(InputError, match=r"too short for a regression: the longest has 0\.2 s"):
        shape_of(data, [record.slice(-40, None) for record in data.records])

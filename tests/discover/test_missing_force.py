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
from rigsight.rigs.built_in import rig_file_text
from rigsight.rigs.reading.rig_file import rig_of_text

LINEAR = {"gain": 0.8, "m": 0.5, "d": 1.5, "k": 120.0, "x_off": 0.0, "force_off": 0.0}


def shape_of(data: RegressionData, records: Sequence[Record] | None = None) -> MissingForce:
    """Return the shape on some records, with the linear values of all of them."""
    estimation = [record for record in data.records if record.role == "estimation"]
    values = {**data.campaign.constants, **linear_start(data.rig, estimation, data.campaign.constants, {})}
    scales = characteristic_scales(data.rig, estimation, values)
    rng = np.random.default_rng(0)
    return missing_force(data.rig, records or estimation, values, scales, data.noise["x"], rng)


@pytest.mark.slow
def test_a_cube_is_seen_as_a_cube(make_data) -> None:
    values, data = make_data("cubic", 2e-5)
    found = shape_of(data)
    (term,) = found.terms
    assert term.term == "x^3"
    assert term.coefficient == pytest.approx(values["k_3"], rel=0.05)
    assert term.unit == "N/m^3"
    assert found.share > 0.9
    assert "x^3" in found.sentence


@pytest.mark.slow
def test_a_product_that_no_effect_has_is_seen(make_data) -> None:
    values, data = make_data("monomial", 2e-5)
    (term,) = shape_of(data).terms
    assert set(term.term.split()) == {"x", "v"}
    assert term.coefficient == pytest.approx(values["c_11"], rel=0.05)


@pytest.mark.slow
def test_nothing_is_seen_where_nothing_is_lacking(make_data) -> None:
    found = shape_of(make_data("linear", 2e-5)[1])
    assert found.terms == ()
    assert found.to_json()["terms"] == []
    assert found.sentence.startswith("No product")


@pytest.mark.slow
@pytest.mark.parametrize("dt", [2.5e-3, 1e-2])
def test_records_of_different_sample_times_show_the_same_force(make_data, dt: float) -> None:
    values, data = make_data("cubic", 2e-5, sample_times={0.6: dt})
    (term,) = shape_of(data).terms
    assert term.term == "x^3"
    assert term.coefficient == pytest.approx(values["k_3"], rel=0.05)


@pytest.mark.slow
def test_a_record_shorter_than_a_window_changes_nothing(make_data) -> None:
    _, data = make_data("cubic", 2e-5, validation=False)
    tail = replace(data.records[0].slice(-40, None), name="tail")
    assert shape_of(data, [*data.records, tail]).terms == shape_of(data).terms


def test_records_that_are_all_too_short_are_refused(make_data) -> None:
    _, data = make_data("cubic", 2e-5, validation=False)
    with pytest.raises(InputError, match=r"too short for a regression: the longest has 0\.2 s"):
        shape_of(data, [record.slice(-40, None) for record in data.records])


@pytest.mark.slow
def test_each_record_has_its_own_drive_gain(make_data) -> None:
    values, data = make_data("cubic", 2e-5, validation=False)
    strong, *others = data.records
    other_unit = replace(strong.with_signals(u=strong["u"] / 3.0), constants={"gain": 3.0 * values["gain"]})
    (term,) = shape_of(data, [other_unit, *others]).terms
    assert term.coefficient == pytest.approx(values["k_3"], rel=0.05)


@pytest.mark.slow
def test_records_of_different_inertia_are_refused(make_data) -> None:
    _, data = make_data("cubic", 2e-5, validation=False)
    text = rig_file_text("axis").replace("m*d(x)^2/2", "(m + payload)*d(x)^2/2")
    loaded = rig_of_text(text + '\n[constants.payload]\nunit = "kg"\ndefault = 0.0\n', "loaded axis")
    first, *others = data.records
    records = [first, *(replace(record, constants={"payload": 0.5}) for record in others)]
    values = {**LINEAR, "payload": 0.0}
    scales = characteristic_scales(data.rig, data.records, LINEAR)
    with pytest.raises(InputError, match=f"constants of record '{others[0].name}'"):
        missing_force(loaded, records, values, scales, data.noise["x"], np.random.default_rng(0))
    # Constants that all records share are their own common ones.
    alike = [replace(record, constants={"payload": 0.0}) for record in data.records]
    found = missing_force(
        loaded, alike, {**values, "payload": 0.2}, scales, data.noise["x"], np.random.default_rng(0)
    )
    assert [term.term for term in found.terms] == ["x^3"]

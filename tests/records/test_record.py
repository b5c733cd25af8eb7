from __future__ import annotations

import pickle

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.records import Record


def ramp(**changes: object) -> Record:
    arguments = {
        "name": "ramp",
        "dt": 0.5,
        "signals": {"u": np.arange(5.0), "x": np.arange(5.0) ** 2},
        "units": {"u": "A"},
    }
    return Record(**{**arguments, **changes})


def test_time_runs_from_t0_in_steps_of_dt() -> None:
    record = ramp(t0=2.0)
    np.testing.assert_array_equal(record.t, [2.0, 2.5, 3.0, 3.5, 4.0])
    assert record.n_samples == 5
    assert record.duration == 2.0


def test_samples_cannot_be_written_and_do_not_follow_the_callers_array() -> None:
    u = np.arange(5.0)
    record = ramp(signals={"u": u})
    u[0] = 99.0
    assert record["u"][0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        record["u"][0] = 1.0
    with pytest.raises(TypeError):
        record.signals["x"] = u


def test_slice_keeps_the_time_of_its_samples() -> None:
    part = ramp(t0=2.0).slice(1, -1)
    np.testing.assert_array_equal(part.t, [2.5, 3.0, 3.5])
    np.testing.assert_array_equal(part["x"], [1.0, 4.0, 9.0])


def test_empty_slice_is_refused() -> None:
    with pytest.raises(InputError, match=r"no samples in \[3, 3\) of 5"):
        ramp().slice(3, 3)


def test_with_signals_returns_a_new_record() -> None:
    record = ramp()
    extended = record.with_signals(force=np.ones(5))
    assert "force" in extended
    assert "force" not in record


def test_unknown_signal_names_the_nearest() -> None:
    record = ramp(signals={"force": np.ones(3)})
    with pytest.raises(InputError, match=r"no signal 'fource'\. Did you mean 'force'"):
        record["fource"]


def test_a_record_travels_to_another_process_unchanged() -> None:
    record = ramp(notes=("resampled",))
    copy = pickle.loads(pickle.dumps(record))
    np.testing.assert_array_equal(copy["x"], record["x"])
    assert (copy.name, copy.dt, dict(copy.units), copy.notes) == ("ramp", 0.5, {"u": "A"}, ("resampled",))
    assert not copy["x"].flags.writeable


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"dt": 0.0}, "dt must be a positive number"),
        ({"dt": float("nan")}, "dt must be a positive number"),
        ({"signals": {}}, "has no signals"),
        ({"signals": {"u": np.zeros(3), "x": np.zeros(4)}}, "u 3, x 4"),
        ({"signals": {"u": np.zeros((3, 1))}}, r"must have shape \(n_samples,\), got \(3, 1\)"),
        ({"signals": {"u": np.array([0.0, np.inf])}}, "signal 'u' is inf at sample 1"),
        ({"role": "test"}, "role is 'test'"),
        ({"hold": "fho"}, "Did you mean 'foh'"),
    ],
)
def test_impossible_records_are_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        ramp(**changes)

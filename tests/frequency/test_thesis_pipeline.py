from __future__ import annotations

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.frequency import thesis_response


def test_the_phase_is_rescaled_to_the_drop_believed_in(second_order) -> None:
    plain = second_order().record()
    found = thesis_response(plain, "u", "psi", np.pi, upper_cut=50.0, lower_cut=1.0)
    assert found.omega[0] >= 1.0
    assert found.omega[-1] <= 50.0
    assert found.phase[0] == 0.0
    assert np.mean(found.phase[:15]) - np.mean(found.phase[-15:]) == pytest.approx(np.pi)
    assert found.variance is None


def test_the_rescaling_hides_a_dead_time(second_order) -> None:
    cuts = {"upper_cut": 50.0, "lower_cut": 1.0}
    plain = thesis_response(second_order().record(), "u", "psi", np.pi, **cuts)
    late = thesis_response(second_order().record(delay=8), "u", "psi", np.pi, **cuts)
    assert np.mean(late.phase[-15:]) == pytest.approx(np.mean(plain.phase[-15:]), abs=0.1)


def test_the_magnitude_is_the_plain_ratio(second_order) -> None:
    record = second_order().record()
    found = thesis_response(record, "u", "psi", np.pi, upper_cut=50.0)
    ratio = np.abs(np.fft.rfft(record["psi"]) / np.fft.rfft(record["u"]))
    np.testing.assert_allclose(found.magnitude, ratio[1 : found.omega.size + 1])
    middle = found.band(5.0, 30.0)
    np.testing.assert_allclose(middle.magnitude, np.abs(second_order().response(middle.omega)), rtol=0.2)


def test_a_phase_that_cannot_be_rescaled_is_told(second_order) -> None:
    record = second_order().record(duration=20.0)
    with pytest.raises(InputError, match="the thesis's phase needs 30"):
        thesis_response(record, "u", "psi", np.pi, upper_cut=5.0)
    with pytest.raises(InputError, match="rises by"):
        thesis_response(record, "psi", "u", np.pi, upper_cut=50.0)
    with pytest.raises(InputError, match="no content"):
        thesis_response(record.with_signals(u=np.zeros(4000)), "u", "psi", np.pi, upper_cut=50.0)

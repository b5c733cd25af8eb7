"""Are stamps told apart, also where a clock counts from 1970?"""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.records.conditioning import time_base
from rigsight.records.stamps import digits_for, time_label, time_origin, written_span, written_stamp

EPOCH = 1.7e9 + 0.005 * np.arange(400)


def test_a_stamp_has_the_digits_that_its_distance_to_others_needs() -> None:
    assert written_stamp(12.34567, 1.0) == "12.35"
    assert written_stamp(1.7e9 + 0.005, 0.005) == "1700000000.005"
    assert written_span(1.7e9, 1.7e9 + 10.0) == "1700000000 s to 1700000010 s"
    for stamp, resolution in ((0.0, 1.0), (1.0, 0.0), (1.0, np.inf), (np.nan, 1.0)):
        assert digits_for(stamp, resolution, 4) == 4


def test_an_axis_counts_from_the_first_stamp_only_where_stamps_are_large() -> None:
    assert (time_origin(EPOCH), time_label(EPOCH)) == (1.7e9, "time [s] since 1700000000 s")
    near = 5.0 + 0.005 * np.arange(400)
    assert (time_origin(near), time_label(near)) == (0.0, "time [s]")
    assert time_origin(np.zeros(0)) == 0.0


def test_messages_tell_different_stamps_apart() -> None:
    lines = np.arange(2, 402)
    swapped = EPOCH.copy()
    swapped[[7, 8]] = swapped[[8, 7]]
    with pytest.raises(InputError, match=r"1700000000\.03\d* follows 1700000000\.04"):
        time_base(swapped, lines, "run.csv")
    with pytest.raises(InputError, match=r"jumps from 1700000000\.03\d* to 1700000000\.05"):
        time_base(np.delete(EPOCH, [8, 9]), lines[2:], "run.csv")

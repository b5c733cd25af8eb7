"""A clock that pauses: stretches are records of their own, nothing is put between, and what cannot be parted is told."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.records import ReadingOptions, read_record
from rigsight.records.conditioning import pauses
from rigsight.records.read_record import read_stretches
from rigsight.workflow.campaign.read_campaign import read_campaign

from .test_read_record import INPUTS, OUTPUTS, Named

WriteCsv = Callable[..., Path]
T = 0.01 * np.arange(400)
HEAD = 'title = "paused"\n[rig]\nmodel = "axis"\n'


def table(*pauses: tuple[int, float], kept: np.ndarray | None = None) -> np.ndarray:
    """Return rows whose clock stands still for some seconds behind samples, or of which some were lost."""
    shift = np.zeros(T.size)
    for sample, seconds in pauses:
        shift[sample + 1 :] += seconds
    rows = np.column_stack([T + shift, np.sin(9.0 * T), np.cos(9.0 * T), np.sin(4.0 * T)])
    return rows if kept is None else rows[kept]


def read(write_csv: WriteCsv, rows: np.ndarray):
    return read_stretches(write_csv(rows=rows), INPUTS, OUTPUTS)


def test_stretches_keep_their_times_and_samples(write_csv: WriteCsv) -> None:
    rows = table((149, 3.0), (299, 0.01))
    found = read(write_csv, rows)
    assert [record.n_samples for record in found] == [150, 150, 100]
    assert [record.t0 for record in found] == pytest.approx([0.0, 4.5, 6.01])
    assert {record.dt for record in found} == {0.01}
    np.testing.assert_allclose(np.concatenate([record["psi"] for record in found]), rows[:, 2], atol=1e-8)
    assert [record.name.partition(" ")[2] for record in found] == ["part 1", "part 2", "part 3"]
    (note,) = found[0].notes
    assert "between lines 151 and 152 (300; the time jumps from 1.49 to 4.5), and at 1 more place" in note
    assert "3 records, each with its own initial state; nothing was interpolated" in note
    assert found[1].notes == ()


def test_a_stretch_that_is_too_short_is_left_out_and_said(write_csv: WriteCsv) -> None:
    found = read(write_csv, table((9, 1.0), (299, 1.0)))
    assert [record.n_samples for record in found] == [290, 100]
    assert "10 samples in shorter stretches were left out" in found[0].notes[0]


def test_a_stretch_in_which_nothing_moves_is_left_out_and_said(write_csv: WriteCsv) -> None:
    rows = table((299, 1.0))
    rows[300:, 2:] = 0.5
    (found,) = read(write_csv, rows)
    assert found.n_samples == 300
    assert (
        "100 samples in stretches that are shorter, or in which no output changes, were left out"
        in found.notes[0]
    )


def test_lost_samples_part_a_record_like_a_pause(write_csv: WriteCsv) -> None:
    found = read(write_csv, table(kept=np.delete(np.arange(400), [200, 201])))
    assert [record.n_samples for record in found] == [200, 198]
    assert "(2; the time jumps" in found[0].notes[0]


def test_a_single_record_is_refused_with_what_a_campaign_does(write_csv: WriteCsv) -> None:
    with pytest.raises(InputError, match=r"between lines 151 and 152.*a campaign reads each stretch"):
        read_record(write_csv(rows=table((149, 3.0))), INPUTS, OUTPUTS)


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (
            table(kept=np.flatnonzero(np.arange(400) % 25 > 2)),
            r"Only 0 of 352 samples lie in stretches of 50 or more",
        ),
        # Two decimals of a sample time of 10.4 ms: what seems to jump is rounding.
        (np.column_stack([np.round(0.0101 * np.arange(400), 2), table()[:, 1:]]), "1 samples are missing"),
    ],
    ids=["dropouts everywhere", "coarse stamps"],
)
def test_what_cannot_be_parted_is_told(write_csv: WriteCsv, rows: np.ndarray, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read(write_csv, rows)


@pytest.mark.parametrize("lost", [np.arange(3, 400, 9), np.flatnonzero(np.arange(400) % 40 < 2)[2:]])
def test_samples_lost_everywhere_are_interpolated_where_few_are_lost_at_once(
    write_csv: WriteCsv, lost: np.ndarray
) -> None:
    (record,) = read(write_csv, table(kept=np.delete(np.arange(400), lost)))
    np.testing.assert_allclose(record["psi"], np.cos(9.0 * record.t), atol=1e-3)
    assert "jitter" in record.notes[0]


def test_a_late_stamp_is_no_gap(write_csv: WriteCsv) -> None:
    rows = table()
    rows[200, 0] += 0.0094
    (record,) = read(write_csv, rows)
    assert (record.dt, record.n_samples) == (0.01, 400)


def test_a_gap_of_one_clock_ends_the_others_there_as_well(tmp_path: Path) -> None:
    from scipy.io import savemat

    drive, stage = T, np.delete(T + 0.002, np.arange(200, 220))
    content = {"a": {"t": drive, "u": np.sin(9 * drive)}, "b": {"t": stage, "x": np.cos(9 * stage)}}
    savemat(tmp_path / "run.mat", content)
    found = read_stretches(tmp_path / "run.mat", INPUTS, (Named("x", "m"),))
    assert [(r.t[0], r.t[-1]) for r in found] == [
        pytest.approx((0.01, 1.99)),
        pytest.approx((2.21, 3.99)),
    ]
    for record in found:
        np.testing.assert_allclose(record["x"], np.cos(9 * record.t), atol=1e-6)
    later = read_stretches(tmp_path / "run.mat", INPUTS, (Named("x", "m"),), ReadingOptions(start=1.0))
    assert "between samples 200 and 201" in found[0].notes[0]
    assert "between samples 200 and 201" in later[0].notes[0]


@pytest.mark.parametrize(
    ("start", "end", "span"), [(1.0, 2.0, (1.0, 2.0)), (None, 1.5, (0.0, 1.5)), (3.0, None, (3.0, 3.99))]
)
def test_start_and_end_choose_a_stretch(write_csv: WriteCsv, start, end, span) -> None:
    (record,) = read_stretches(write_csv(rows=table()), INPUTS, OUTPUTS, ReadingOptions(start=start, end=end))
    assert (record.t[0], record.t[-1]) == pytest.approx(span)
    np.testing.assert_allclose(record["psi"], np.cos(9.0 * record.t), atol=1e-8)


def test_a_stretch_outside_the_record_is_told_with_its_span(write_csv: WriteCsv) -> None:
    with pytest.raises(InputError, match=r"start = 5, end = 9 .*0 s to 3.99 s"):
        read_stretches(write_csv(rows=table()), INPUTS, OUTPUTS, ReadingOptions(start=5.0, end=9.0))


def test_a_campaign_holds_the_stretches(tmp_path: Path) -> None:
    rows = table((199, 2.0))[:, :3]
    for name in ("run", "other"):
        np.savetxt(tmp_path / f"{name}.csv", rows, "%.9g", ",", header="t,u,x", comments="")
    records = '[[records]]\nfile = "run.csv"\n[[records]]\nfile = "other.csv"\nname = "run part 1"\nrole = "validation"\n'
    (tmp_path / "campaign.toml").write_text(HEAD + records, encoding="utf-8")
    campaign = read_campaign(tmp_path)
    assert [r.n_samples for r in campaign.records] == [200] * 4
    assert len({r.name for r in campaign.records}) == 4
    assert [r.role for r in campaign.records] == ["estimation"] * 2 + ["validation"] * 2


def test_events_of_a_shaft_that_slows_down_have_no_gap() -> None:
    turn = np.arange(163)
    # Of a coast-down by dry friction: 2 pi turn = w t - a t^2 / 2.
    speed, slowing = 40.0, 0.78
    t = (speed - np.sqrt(speed**2 - 4.0 * np.pi * slowing * turn)) / slowing
    assert np.diff(t).max() > 6.0 * np.median(np.diff(t))
    assert pauses(t).size == 0

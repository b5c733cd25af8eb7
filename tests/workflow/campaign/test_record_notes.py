"""What is noticed about the records of a campaign before any fit."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from rigsight.workflow.campaign.read_campaign import read_campaign

from .campaign_text import HEAD, RECORDS, Lines


def test_a_record_in_another_unit_is_asked_about(campaign: Callable[..., Path]) -> None:
    folder = campaign(HEAD + RECORDS)
    assert not any("another unit" in note for note in read_campaign(folder).notes)
    sweep = folder / "sweep.csv"
    header, *rows = sweep.read_text(encoding="utf-8").splitlines()
    cells = [row.split(",") for row in rows]
    place = header.split(",").index("psi")
    larger = [",".join([*row[:place], repr(1e3 * float(row[place])), *row[place + 1 :]]) for row in cells]
    (folder / "other.csv").write_text("\n".join([header, *larger]), encoding="utf-8")
    found = read_campaign(campaign(HEAD + RECORDS + '[[records]]\nfile = "other.csv"\n')).notes
    assert any("'psi' moves 1e+03 times as far per unit of 'u' in record 'other'" in note for note in found)


@pytest.mark.parametrize(("stated", "n_notes"), [(0.25, 0), (1.0, 0), (3.9, 0), (250.0, 1), (1e-3, 1)])
def test_an_amplitude_that_cannot_be_is_asked_about(
    stated: float, n_notes: int, campaign: Callable[..., Path]
) -> None:
    notes = read_campaign(campaign(HEAD + RECORDS.replace("0.25", f"{stated}"))).notes
    assert len(notes) == n_notes
    assert all(f"amplitude = {stated:g}" in note for note in notes)


def test_sample_times_a_thousand_apart_are_asked_about(campaign: Callable[..., Path]) -> None:
    def change(lines: Lines) -> None:
        for i, line in enumerate(lines[1:], 1):
            t, _, rest = line.partition(",")
            lines[i] = f"{1e3 * float(t):.9g},{rest}"

    (note,) = read_campaign(campaign(change=change)).notes
    assert "factor of 1e+03" in note
    assert "'sweep' 10 s" in note
    assert 'unit = "ms"' in note


def test_a_fitted_record_that_is_to_validate_too_is_told(campaign: Callable[..., Path]) -> None:
    folder = campaign(HEAD + RECORDS.replace('"step.csv"', '"sweep.csv"'))
    (note,) = read_campaign(folder).notes
    assert "the validation record 'sweep_2' has exactly the samples of 'sweep', which is fitted" in note


def test_fitted_records_that_differ_in_hold_are_told_of(campaign: Callable[..., Path]) -> None:
    both = RECORDS.replace('role = "validation"\n', "")
    alike, other = (read_campaign(campaign(HEAD + text)).notes for text in (both.replace("zoh", "foh"), both))
    assert len(other) == len(alike) + 1
    assert any("hold (foh, zoh)" in note for note in other)

"""The table of formats: none is missed by tests and documents, and what it says of channels holds whatever a reader gives."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.records.formats.channel import Channel, ChannelFile
from rigsight.records.formats.channel_file import open_channels
from rigsight.records.formats.known import FORMATS as KNOWN
from rigsight.records.formats.known import HEAD, Format, recognized

from .files import FORMATS, UNITS, rows, write_tdms

DOCUMENTED = (Path(__file__).parents[3] / "docs/records.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("known", KNOWN, ids=lambda known: known.key)
def test_no_known_format_is_missed(known: Format) -> None:
    """Each has a writer in formats.py, so that the tests of formats cover it, and each suffix is documented."""
    assert not known.suffixes or {suffix for suffix, _ in FORMATS.values()} & set(known.suffixes)
    undocumented = [suffix for suffix in known.suffixes if f"`{suffix}`" not in DOCUMENTED]
    assert undocumented == []
    assert known.suffixes == tuple(suffix.lower() for suffix in known.suffixes)


def test_the_writers_write_every_known_format_and_one_format_recognizes_each_file(
    tmp_path: Path,
) -> None:
    found = []
    for i, (suffix, write) in enumerate(FORMATS.values()):
        path = tmp_path / f"run{i}{suffix}"
        write(path, rows(), UNITS)
        with path.open("rb") as file:
            head = file.read(HEAD)
        (one,) = (known for known in KNOWN if re.match(known.signature, head, re.DOTALL))
        assert one is recognized(head)
        found.append(one)
    assert {known.key for known in found} == {known.key for known in KNOWN}


def test_every_suffix_belongs_to_one_format() -> None:
    suffixes = [suffix for known in KNOWN for suffix in known.suffixes]
    assert len(suffixes) == len(set(suffixes))


def test_names_are_made_distinct_and_printable_whatever_a_reader_gives(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def opened(_: Path) -> Iterator[ChannelFile]:
        channels = [Channel(name, 3, lambda: np.arange(3.0)) for name in ("u", "u", "x\x1b", "u_2")]
        channels.append(Channel("short\x1b", 3, lambda: np.arange(2.0)))
        yield ChannelFile(tuple(channels))

    write_tdms(tmp_path / "run.tdms", rows(), UNITS)
    monkeypatch.setattr("rigsight.records.formats.read_tdms.open_tdms", opened)
    with open_channels(tmp_path / "run.tdms") as file:
        assert [channel.name for channel in file.channels] == ["u", "u_3", "x\ufffd", "u_2", "short\ufffd"]
        assert file.format == "TDMS"
        with pytest.raises(InputError, match="channel 'short\ufffd': 2 of 3 samples"):
            file.channels[-1].load()

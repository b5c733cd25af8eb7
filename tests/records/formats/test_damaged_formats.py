"""A file that is cut short or damaged becomes one message, whatever its format."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.records import read_record

from ...tiers import slow_but
from .files import FORMATS, Write, write_matlab, write_text


@dataclass(frozen=True)
class Named:
    name: str
    unit: str


SIGNALS = {"u": "A", "psi": "rad", "y": "m"}
# A process is started for every such file.
TRIALS = {"MDF4": 3, "HDF5": 8, "MATLAB 7.3": 8, "MATLAB 5": 8, "MATLAB 7": 8, "Parquet": 8}
formats = pytest.mark.parametrize("name", FORMATS)
read_often = pytest.mark.parametrize(
    "name", slow_but(*(name for name in FORMATS if name not in TRIALS), of=FORMATS)
)
"""`make test` reads a format in a process of its own once: to start one takes a second or two."""


def read(path: Path) -> None:
    read_record(path, (Named("u", "A"),), (Named("psi", "rad"), Named("y", "m")))


def contents(tmp_path: Path, name: str) -> tuple[Path, bytes]:
    suffix, write = FORMATS[name]
    t = 0.01 * np.arange(60)
    path = tmp_path / f"run{suffix}"
    write(path, {"t": t, "u": np.sin(9 * t), "psi": np.cos(9 * t), "y": np.sin(9 * t + 1)}, SIGNALS)
    return path, path.read_bytes()


def reported(path: Path) -> str | None:
    """Return the message, None if the file could be read; anything but a message fails the test."""
    try:
        read(path)
    except InputError as error:
        message = str(error)
    else:
        return None
    assert path.name in message
    return message


@read_often
def test_a_file_cut_short_is_told(tmp_path: Path, name: str) -> None:
    path, good = contents(tmp_path, name)
    read(path)
    unseen = 0
    for length in np.linspace(1, len(good) - 64, TRIALS.get(name, 60)).astype(int):
        path.write_bytes(good[:length])
        unseen += reported(path) is None
    # Between two variables or datasets such a file may end as well; then y is missing, which a record may lack. A flight log ends
    # where the power was switched off.
    assert unseen <= {"MATLAB 5": 2, "UFF": 2, "ULog": 60}.get(name, 0)


@read_often
def test_flipped_bytes_are_told_or_read(tmp_path: Path, name: str) -> None:
    path, good = contents(tmp_path, name)
    rng = np.random.default_rng(7)
    for trial in range(TRIALS.get(name, 150)):
        damaged = bytearray(good)
        # Half of the damage goes to the beginning, where formats declare what follows.
        end = len(good) if trial % 2 else min(len(good), 1024)
        for _ in range(int(rng.integers(1, 6))):
            damaged[int(rng.integers(end))] = int(rng.integers(256))
        path.write_bytes(damaged)
        reported(path)


@pytest.mark.slow
@formats
def test_damaged_files_are_not_said_to_be_a_defect_of_the_program(tmp_path: Path, name: str) -> None:
    path, good = contents(tmp_path, name)
    path.write_bytes(good[: len(good) * 3 // 5])
    message = reported(path)
    assert message is not None
    if name == "ULog":
        # What is there is read, and is too short for a record.
        assert "at least 50" in message
        return
    assert len(message) < 600
    assert "Export it again" in message


def test_flipped_text_is_told_or_read(tmp_path: Path) -> None:
    t = 0.01 * np.arange(60)
    path = tmp_path / "run.csv"
    write_text(path, {"t": t, "u": np.sin(9 * t), "psi": np.cos(9 * t)}, {})
    good = path.read_bytes()
    rng = np.random.default_rng(8)
    for _ in range(150):
        damaged = bytearray(good[: int(rng.integers(1, len(good)))])
        for _ in range(int(rng.integers(0, 4))):
            damaged[int(rng.integers(len(damaged)))] = int(rng.integers(256))
        path.write_bytes(damaged)
        reported(path)


HEADER = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"


def element(kind: int, data: bytes) -> bytes:
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def matrix(kind: int, shape: tuple[int, ...], rest: bytes, name: bytes = b"u") -> bytes:
    dims = struct.pack(f"<{len(shape)}i", *shape)
    return element(14, element(6, struct.pack("<II", kind, 0)) + element(5, dims) + element(1, name) + rest)


DOUBLE, STRUCT, CELL, CHAR = 6, 2, 1, 4
FIELDS = element(5, struct.pack("<i", 8)) + element(1, b"a\0\0\0\0\0\0\0")
NESTED = matrix(DOUBLE, (1, 1), element(9, bytes(8)), b"")
for _ in range(40):
    NESTED = matrix(CELL, (1, 1), NESTED, b"")
BOMBS = {
    "numbers": matrix(DOUBLE, (30000, 30000), element(9, bytes(8))),
    "structs": matrix(STRUCT, (1 << 15, 1 << 15), FIELDS),
    "cells": matrix(CELL, (1 << 15, 1 << 15), b""),
    "cells in a struct": matrix(STRUCT, (1, 1), FIELDS + matrix(CELL, (1 << 15, 1 << 15), b"", b"")),
    "text": matrix(CHAR, (1 << 15, 1 << 15), element(4, b"")),
    "nested": NESTED,
    "negative": matrix(DOUBLE, (-1, 5), element(9, bytes(8))),
    "packed": element(15, zlib.compress(matrix(DOUBLE, (30000, 30000), element(9, bytes(8))))),
}


def flagged(flags: int, rest: bytes) -> bytes:
    head = element(6, struct.pack("<II", DOUBLE | flags, 0)) + element(5, struct.pack("<2i", 1, 60))
    return element(14, head + element(1, b"u") + rest)


@pytest.mark.parametrize(
    ("flags", "n_parts", "is_sound"),
    [(0, 1, True), (0, 0, False), (0x800, 2, True), (0x800, 1, False)],
)
def test_a_matlab_variable_without_its_parts_is_refused(
    tmp_path: Path, flags: int, n_parts: int, is_sound: bool
) -> None:
    """Found by fuzzing: scipy took the variable behind it for the missing part, and crashed."""
    path = tmp_path / "run.mat"
    behind = matrix(DOUBLE, (1, 60), element(9, bytes(480)), b"psi")
    path.write_bytes(HEADER + flagged(flags, n_parts * element(9, bytes(480))) + behind)
    message = reported(path)
    assert message is not None
    assert ("damaged" in message) == (not is_sound)


@pytest.mark.slow
@pytest.mark.parametrize("bomb", BOMBS)
def test_a_matlab_file_that_declares_more_than_it_holds_is_refused(tmp_path: Path, bomb: str) -> None:
    path = tmp_path / "run.mat"
    path.write_bytes(HEADER + BOMBS[bomb])
    assert reported(path) is not None


def test_a_matlab_4_file_is_told_how_to_be_saved(tmp_path: Path) -> None:
    from scipy.io import savemat

    savemat(tmp_path / "run.mat", {"u": np.arange(9.0)}, format="4")
    with pytest.raises(InputError, match="save -v7"):
        read(tmp_path / "run.mat")


def test_a_struct_whose_size_is_no_array_is_no_signal(tmp_path: Path) -> None:
    write: Write = write_matlab
    write(tmp_path / "run.mat", {"t": np.arange(60.0), "u": np.arange(3.0)}, {})
    with pytest.raises(InputError, match="no channel 'psi'"):
        read(tmp_path / "run.mat")


@pytest.mark.parametrize("name", ["MATLAB 5", "MATLAB 7.3", "HDF5", "MDF4", "Parquet"])
def test_a_library_that_does_not_come_back_is_ended_and_told(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, _ = contents(tmp_path, name)
    monkeypatch.setattr("rigsight.records.formats.channel_file.LONGEST_WAIT", 0.0)
    message = reported(path)
    assert message is not None
    assert "crashes or does not finish" in message

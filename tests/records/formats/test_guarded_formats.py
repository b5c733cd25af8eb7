"""What a record file may not do, and which library it needs."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.records.formats.channel_file import file_format, open_channels
from rigsight.records.formats.known import FORMATS as KNOWN

from .channels_of_formats import formats, read
from .files import (
    Write,
    rows,
    write_hdf5,
    write_matlab,
    write_matlab_hdf5,
    write_parquet,
    write_tdms,
    write_uff,
)

OPTIONAL = {known.package for known in KNOWN} - {"scipy", None}
"""Packages of the extra `formats`."""


@formats
def test_a_missing_library_is_told_with_the_extra(
    tmp_path: Path, suffix: str, write: Write, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / f"run{suffix}"
    write(path, rows(), {})
    known = file_format(path)
    assert known is not None
    if known.package not in OPTIONAL:
        assert read(path).n_samples == 120
        return
    for module in [m for m in sys.modules if m.partition(".")[0] == known.package]:
        monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.setitem(sys.modules, known.package, None)
    with pytest.raises(InputError) as caught:
        read(path)
    assert f'pip install "rigsight[{known.extra}]"' in str(caught.value)
    assert known.package in str(caught.value)


@pytest.mark.parametrize("write", [write_matlab, write_matlab_hdf5])
def test_matlab_needs_no_extra_before_7_3(
    tmp_path: Path, write: Write, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path / "run.mat", rows(), {})
    for package in OPTIONAL:
        monkeypatch.setitem(sys.modules, package, None)
    if write is write_matlab:
        assert read(tmp_path / "run.mat").n_samples == 120
    else:
        with pytest.raises(InputError, match="formats"):
            read(tmp_path / "run.mat")


def test_references_and_data_in_other_files_are_not_followed(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    (tmp_path / "secret").write_bytes(np.arange(120.0).tobytes())
    path = tmp_path / "run.h5"
    write_hdf5(path, rows(), {})
    with h5py.File(path, "r+") as file:
        file["refs"] = np.array([file["run 1/u"].ref], dtype=h5py.ref_dtype)
        file.create_dataset("outside", (120,), "f8", external=[(str(tmp_path / "secret"), 0, 960)])
        file["link"] = h5py.ExternalLink("secret.h5", "/x")
    with open_channels(path) as opened:
        assert [channel.short_name for channel in opened.channels] == ["psi", "t", "u", "y"]
        refused = {one.name: one.reason for one in opened.refused}
    assert "references" in refused["refs"]
    assert "another file" in refused["outside"]
    assert "link" not in refused


@pytest.mark.slow
def test_a_formula_in_a_file_is_not_executed(tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    signals = [
        asammdf.Signal(rows()[name], rows()["t"], name=name, conversion=conversion)
        for name, conversion in {"u": None, "psi": None, "y": {"formula": "X1 * 2"}}.items()
    ]
    with asammdf.MDF(version="4.10") as file:
        file.append(signals)
        file.save(tmp_path / "run.mf4")
    with open_channels(tmp_path / "run.mf4") as opened:
        assert [(one.name, "not executed" in one.reason) for one in opened.refused] == [("y", True)]
    with pytest.raises(InputError, match="formula"):
        read(tmp_path / "run.mf4")


@pytest.mark.parametrize(
    "write", [write_matlab, write_matlab_hdf5, write_hdf5, write_tdms, write_parquet, write_uff]
)
def test_too_many_samples_are_refused_before_they_are_read(
    tmp_path: Path, write: Write, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path / "run", rows(), {})
    monkeypatch.setattr("rigsight.records.formats.channel.MOST_SAMPLES", 100)
    with pytest.raises(InputError, match=r"run.*120 .*more than the 100 that are read"):
        read(tmp_path / "run")


def test_too_large_a_file_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_matlab(tmp_path / "run.mat", rows(), {})
    small = tuple(replace(known, largest=10) for known in KNOWN)
    monkeypatch.setattr("rigsight.records.formats.known.FORMATS", small)
    with pytest.raises(InputError, match="more than the 1e-08 GB"):
        read(tmp_path / "run.mat")

"""Whatever bytes or text a measured file holds: it is read, or one message tells why not."""

from __future__ import annotations

import contextlib
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rigsight.errors import InputError
from rigsight.records.formats.known import BY_SUFFIX, reader_of
from rigsight.workflow.inspect import run_inspect

from .files import FORMATS
from .test_damaged_formats import SIGNALS, read

# Their libraries crash over damaged files, and are only called in a process of their own.
FEW = {"MDF4", "HDF5", "MATLAB 7.3"}
drawn = settings(
    derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=30
)
cells = st.sampled_from(
    ["0", "1.5", "1,5", "nan", "1e308", "1e-320", "", '"', "x", "t", "psi", "#", "٣", "\x0c", "-"]
)
tables = st.lists(st.lists(cells, min_size=1, max_size=4), max_size=12)


def check(path: Path) -> None:
    for reading in (read, lambda file: tomllib.loads(run_inspect(file).proposal)):
        with contextlib.suppress(InputError):
            reading(path)


@pytest.mark.parametrize("suffix", [".csv", *BY_SUFFIX])
@settings(drawn, max_examples=10)
@given(data=st.binary(max_size=400))
def test_any_bytes(tmp_path: Path, suffix: str, data: bytes) -> None:
    path = tmp_path / f"run{suffix}"
    path.write_bytes(data)
    check(path)


@drawn
@given(text=st.text("tupsi,;|\"'#%/0123456789.eE+-nafx \t\r\n\x00\x0c\x1b\x85\u2028é٣😀", max_size=300))
def test_any_text(tmp_path: Path, text: str) -> None:
    path = tmp_path / "run.csv"
    path.write_text(text, encoding="utf-8", newline="")
    check(path)


@drawn
@given(rows=tables, separator=st.sampled_from(",;\t| "), times=st.sampled_from([1, 60]))
def test_any_table(tmp_path: Path, rows: list[list[str]], separator: str, times: int) -> None:
    path = tmp_path / "run.csv"
    lines = ["t,u,psi".replace(",", separator), *(separator.join(row) for row in rows)]
    path.write_text("\n".join(lines[:1] + lines[1:] * times), encoding="utf-8")
    check(path)


@pytest.mark.parametrize("name", [name for name in FORMATS if name not in FEW])
@settings(drawn, max_examples=20)
@given(data=st.data())
def test_a_sound_file_with_any_damage(
    tmp_path: Path, name: str, data: st.DataObject, monkeypatch: pytest.MonkeyPatch
) -> None:
    # In this process: what the readers themselves make of it is the question.
    monkeypatch.setattr(
        "rigsight.records.formats.channel_file.open_isolated", lambda known, file: reader_of(known.key)(file)
    )
    suffix, write = FORMATS[name]
    path = tmp_path / f"run{suffix}"
    t = 0.01 * np.arange(60)
    write(path, {"t": t, "u": np.sin(9 * t), "psi": np.cos(9 * t)}, SIGNALS)
    good = bytearray(path.read_bytes())
    start, stop = sorted(data.draw(st.tuples(*[st.integers(0, len(good))] * 2)))
    manner = data.draw(st.sampled_from(["cut out", "repeated", "replaced", "swapped"]))
    part = bytes(good[start : min(stop, start + 64)])
    kept = {
        "cut out": b"",
        "repeated": 2 * part,
        "replaced": data.draw(st.binary(max_size=16)),
        "swapped": part[::-1],
    }
    good[start : start + len(part)] = kept[manner]
    path.write_bytes(good)
    check(path)

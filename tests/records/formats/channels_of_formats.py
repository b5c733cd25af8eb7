"""Signals that every format holds, and how a test reads them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest

from rigsight.records import ReadingOptions, Record, read_record

from .files import FORMATS


@dataclass(frozen=True)
class Named:
    name: str
    unit: str


INPUTS = (Named("u", "A"),)
OUTPUTS = (Named("psi", "rad"), Named("y", "m"))
formats = pytest.mark.parametrize(("suffix", "write"), FORMATS.values(), ids=FORMATS)


def read(path: Path, **options: object) -> Record:
    return read_record(path, INPUTS, OUTPUTS, ReadingOptions(**options))

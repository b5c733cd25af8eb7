"""Where do a board's records come from: the loader of nonlinear_benchmarks, with files that are there or that it downloads."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from declared import Board

from rigsight.errors import InputError
from rigsight.records.record import Floats, Record, Role


def official_records(board: Board, folder: Path | None) -> tuple[list[Record], list[Record]]:
    """Return the training and the test records of a board."""
    try:
        import nonlinear_benchmarks
        from nonlinear_benchmarks import not_splitted_benchmarks
    except ImportError as error:
        raise InputError(
            "nonlinear_benchmarks reads the official records, and is not installed: pip install nonlinear_benchmarks==1.0.1"
        ) from error
    loader = getattr(nonlinear_benchmarks, board.loader, None)
    loader = loader or getattr(not_splitted_benchmarks, board.loader)
    with tempfile.TemporaryDirectory() as place:
        found = _laid_out(board, folder, Path(place)) if folder else False
        try:
            loaded = loader(dir_placement=place if found else None)
        except Exception as error:  # The loader raises whatever its downloads and readers do.
            raise InputError(
                f"nonlinear_benchmarks could not load {board.loader} ({error}). Put {_names(board)} into a folder and name it "
                "with --data, or train on records of your own with --records."
            ) from error
    # There are no official training records of the Bouc-Wen board.
    train, test = ([], loaded) if isinstance(loaded, list) else loaded
    return _records(board, train, "estimation"), _records(board, test, "validation")


def _names(board: Board) -> str:
    return " and ".join(Path(file).name for file in board.files)


def _laid_out(board: Board, folder: Path, place: Path) -> bool:
    """Lay the board's files of a folder out as the loader does after its download; return False if one is missing."""
    home = place / board.loader
    for file in board.files:
        there = next(iter(sorted(folder.rglob(Path(file).name))), None)
        if there is None:
            return False
        (home / file).parent.mkdir(parents=True, exist_ok=True)
        (home / file).symlink_to(there.resolve())
    (home / board.archive).touch()
    return True


def _records(board: Board, loaded: Any, role: Role) -> list[Record]:
    several = loaded if isinstance(loaded, list | tuple) else (loaded,)
    return [
        record_of(board, f"{role}_{i}", data.u, data.y, data.sampling_time or board.dt, role)
        for i, data in enumerate(several, start=1)
    ]


def record_of(board: Board, name: str, u: Floats, y: Floats, dt: float | None, role: Role) -> Record:
    """Return a record under the names of the board's rig."""
    if dt is None:
        raise InputError(f"{board.loader} states no sample time.")
    signals = {"u": np.ravel(u), board.output: np.ravel(y)}
    if board.clock is not None:
        signals[board.clock] = dt * np.arange(signals["u"].size)
    return Record(name, float(dt), signals, {}, role=role, hold=board.hold)


def records_of_files(board: Board, files: Iterable[Path], role: Role) -> list[Record]:
    """Return the records of files with three columns: time, input, output."""
    records = []
    for file in files:
        try:
            table = np.loadtxt(file, delimiter=",", skiprows=1)
        except (OSError, ValueError) as error:
            raise InputError(f"{file} cannot be read as lines of t, u, y below a header: {error}") from error
        if table.ndim != 2 or table.shape[1] < 3:
            raise InputError(f"{file} must have three columns: time, input, output.")
        dt = float((table[-1, 0] - table[0, 0]) / (len(table) - 1))
        records.append(record_of(board, file.stem, table[:, 1], table[:, 2], dt, role))
    return records

"""Files and records that many tests need."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

SHARED_DATA = Path(__file__).parents[1] / "../shared/data"


@pytest.fixture
def shared_data() -> Path:
    """The third-party records, which are not part of the repository."""
    if not SHARED_DATA.is_dir():
        pytest.skip(f"the third-party records are not at {SHARED_DATA}")
    return SHARED_DATA


def sweep_rows(n_samples: int = 200, dt: float = 0.01) -> np.ndarray:
    """Time, current, yaw angle and lateral displacement, shape (n_samples, 4)."""
    t = dt * np.arange(n_samples)
    return np.column_stack([t, np.sin(3 * t**2), 0.1 * np.sin(3 * t**2 - 0.4), 0.01 * np.cos(2 * t)])


@pytest.fixture
def write_csv(tmp_path: Path) -> Callable[..., Path]:
    """Write rows of a sweep as a delimited file and return its path."""

    def write(
        name: str = "sweep.csv",
        rows: np.ndarray | None = None,
        header: str | None = "t,u,psi,y",
        separator: str = ",",
        change: Callable[[list[str]], None] | None = None,
    ) -> Path:
        rows = sweep_rows() if rows is None else rows
        lines = [] if header is None else [header]
        lines += [separator.join(f"{value:.9g}" for value in row) for row in rows]
        if change is not None:
            change(lines)
        path = tmp_path / name
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path

    return write

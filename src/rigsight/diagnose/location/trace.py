"""Measured and simulated outputs of one record at each stage of a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Stage = Literal["before", "reidentified", "after"]
STAGES: tuple[Stage, ...] = ("before", "reidentified", "after")


@dataclass(frozen=True)
class Trace:
    """Measured and simulated outputs of one record.

    Attributes
    ----------
    record, role, kind, amplitude
        As in the campaign.
    t
        Shape (n_samples,) [s].
    inputs, measured, before, reidentified, after
        Signal name -> shape (n_samples,).
    """

    record: str
    role: str
    kind: str
    amplitude: float | None
    t: NDArray[np.float64]
    inputs: Mapping[str, NDArray[np.float64]]
    measured: Mapping[str, NDArray[np.float64]]
    before: Mapping[str, NDArray[np.float64]]
    reidentified: Mapping[str, NDArray[np.float64]]
    after: Mapping[str, NDArray[np.float64]]

    @property
    def dt(self) -> float:
        """Sample time [s]."""
        return float(self.t[-1] - self.t[0]) / max(1, self.t.size - 1)

    def residual(self, stage: Stage, output: str) -> NDArray[np.float64]:
        """Return measured minus simulated of a stage, shape (n_samples,)."""
        simulated = {"before": self.before, "reidentified": self.reidentified, "after": self.after}[stage]
        return np.asarray(self.measured[output] - simulated[output], dtype=np.float64)

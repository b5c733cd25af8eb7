"""A score of a comparison, and the kinds of scores."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Quantity = Literal["magnitude_rmse", "phase_rmse", "magnitude_db", "step_rmse", "free_run_nrmse"]

QUANTITIES: dict[Quantity, str] = {
    "magnitude_rmse": "RMSE (5.1) of the magnitude of the frequency response",
    "phase_rmse": "RMSE (5.1) of its phase",
    "magnitude_db": "RMS of the ratio of simulated to measured magnitude in dB",
    "step_rmse": "RMSE after the step, with the offset before it removed",
    "free_run_nrmse": "RMS(measured - simulated) / RMS(measured - mean) in free run",
}


@dataclass(frozen=True)
class Column:
    """What is compared."""

    quantity: Quantity  # a key of `QUANTITIES`
    signal: str  # signal path (``"u -> psi"``) or output
    unit: str  # unit of the error


@dataclass(frozen=True)
class Score:
    """One error of one model on one record."""

    # Their names.
    model: str
    record: str
    column: Column  # what was compared
    value: float  # the error in the column's unit
    # What noise alone makes of it, in the same unit; None where the record does not tell.
    noise_floor: float | None
    n_values: int  # lines or samples that the error is of

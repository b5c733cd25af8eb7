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
    """What is compared.

    Attributes
    ----------
    quantity
        A key of `QUANTITIES`.
    signal
        Signal path (``"u -> psi"``) or output.
    unit
        Unit of the error.
    """

    quantity: Quantity
    signal: str
    unit: str


@dataclass(frozen=True)
class Score:
    """One error of one model on one record.

    Attributes
    ----------
    model, record
        Their names.
    column
        What was compared.
    value
        The error in the column's unit.
    noise_floor
        What noise alone makes of it, in the same unit; None where the record does not tell.
    n_values
        Lines or samples that the error is of.
    """

    model: str
    record: str
    column: Column
    value: float
    noise_floor: float | None
    n_values: int

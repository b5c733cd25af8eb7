"""How large is the error of a model's free run over a record, by the metric of the board?"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from declared import Beginning, Board

import rigsight as rs
from rigsight.records.record import Record
from rigsight.simulate.model import Model


def free_run_error(board: Board, model: Model, record: Record, begins: Beginning = "samples") -> float:
    """Return the root mean square of the error after the initial samples, in the unit of the board."""
    left_out = board.initial_samples if begins == "samples" else 0
    if begins == "samples":
        first = replace(record, starting_samples=min(left_out, record.n_samples))
        run = rs.simulate_model(model, first, "estimated")[board.output]
    elif begins == "rest":
        run = rs.simulate_model(model, record)[board.output]
    else:
        # One period of a steady state: the first one of two lets the transient die away.
        twice = {name: np.tile(samples, 2) for name, samples in record.signals.items()}
        run = rs.simulate_model(model, replace(record, signals=twice))[board.output][record.n_samples :]
    error = (run - record[board.output])[left_out:]
    return board.scale * float(np.sqrt(np.mean(error**2)))

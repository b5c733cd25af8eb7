"""Which initial state does the beginning of a record speak for? From a guess over ever longer stretches to the whole record.

What a state does is known over a short stretch better than over a long one, above all where the motion is unstable or chaotic: a
descent that begins with the whole record would not come back from a guess that is a little off.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rigsight.identify.fit_data import FitData, RecordData, weighted
from rigsight.simulate import simulate_sets

Floats = NDArray[np.float64]

_FIRST_SAMPLES = 25
"""Samples of the first stretch; each further one is twice as long."""
_STEP = 1e-6
"""Difference of a state in units of its size."""
_STEPS = 4
"""Gauss-Newton steps on each stretch."""
_DAMPINGS = (1.0, 0.3, 0.1, 0.03)
"""Shares of a step that are tried side by side."""
_PULL = 1e-3
"""Weight of the guess against an error of size one: it decides what the stretch does not tell."""
_SUBSTEPS = 4
_LOST = 2.0
"""Growth of the error per sample at which a longer stretch is not followed: the parameters are not good enough for it."""


def settled_state(data: FitData, record: RecordData, p: Floats, guess: Floats) -> Floats:
    """Return the initial state that fits a record from its beginning on as far as the parameters can follow it.

    Parameters
    ----------
    data
        What is fitted.
    record
        The record.
    p
        Parameters, shape (n_parameters,); the record's own constants replace those in it.
    guess
        Shape (n_states,).

    Returns
    -------
    Shape (n_states,).
    """
    own = record.parameters(p)
    sizes = data.state_sizes(own[:, None])[:, 0]
    sizes = np.where(sizes > 0.0, sizes, 1.0)
    state, n_samples, before = guess, min(_FIRST_SAMPLES, record.record.n_samples), np.inf
    while True:
        found, error = _fitted(data, record, own, state, sizes, n_samples)
        if not error <= _LOST * max(before, 1.0):
            return state
        state, before = found, error
        if n_samples == record.record.n_samples:
            return state
        n_samples = min(2 * n_samples, record.record.n_samples)


def _fitted(
    data: FitData, record: RecordData, p: Floats, start: Floats, sizes: Floats, n_samples: int
) -> tuple[Floats, float]:
    """Return the state that fits the first samples best, and the root mean square of the weighted error there."""
    n, place, beginning = start.size, np.zeros(start.size), record.first(n_samples)

    def errors(places: Floats) -> Floats:
        lanes = start[:, None] + sizes[:, None] * places
        sets = np.repeat(p[:, None], lanes.shape[1], axis=1)
        with np.errstate(all="ignore"):
            out = simulate_sets(data.structure, beginning.held, sets, lanes, n_samples, _SUBSTEPS)
            first, against = weighted(beginning, out)
            left = np.column_stack([first, first[:, None] + against])
        return np.vstack([np.nan_to_num(left, nan=1e9, posinf=1e9, neginf=-1e9), _PULL * places])

    cost = np.inf
    for _ in range(_STEPS):
        lanes = errors(place[:, None] + np.column_stack([np.zeros(n), _STEP * np.eye(n)]))
        cost = float(lanes[:, 0] @ lanes[:, 0])
        step = np.linalg.lstsq((lanes[:, 1:] - lanes[:, :1]) / _STEP, -lanes[:, 0], rcond=None)[0]
        tried = place[:, None] + np.outer(step, _DAMPINGS)
        costs = np.sum(errors(tried) ** 2, axis=0)
        best = int(np.argmin(costs))
        if not costs[best] < cost:
            break
        gained, cost, place = cost - float(costs[best]), float(costs[best]), tried[:, best]
        if gained < 1e-3 * cost:
            break
    n_measured = max(1, n_samples * int(np.count_nonzero(record.weights)))
    return start + sizes * place, float(np.sqrt(cost / n_measured))

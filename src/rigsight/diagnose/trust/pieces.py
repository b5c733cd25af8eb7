"""Information of each record, and of each window of it, on the fitted parameters, linearized at the common fit.

The free initial state of a window is projected out of residual and derivatives (Frisch and Waugh); the normal equations of pieces
then add up to those of any group of pieces.

References
----------
R. Frisch and F. V. Waugh, Econometrica 1 (1933) 387, for projecting out free parameters of a piece. L. Ljung, *System
Identification* (Prentice Hall 1999), chapter 9, for the covariance beside colored residuals.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.policy import TRUST
from rigsight.identify import Coordinates, FitResult, RecordDerivatives, derivatives, own_derivatives
from rigsight.records.record import Floats, Record

_UNDETERMINED = 1e-7
"""Share of the largest singular value below which a direction of the numbers is not told by a record."""
_TOLERANCE = 1e-3
"""Initial states of windows follow from one linearization: near the best place is near enough."""


@dataclass(frozen=True)
class Piece:
    """A record or a window of one."""

    record: str  # name of the whole record
    place: tuple[int, int]  # which window of it, counted from 0, and of how many
    rows: Floats  # derivatives after projecting out its initial state, shape (n_measured * n_samples, n_free)
    # Residuals after the same projection, shape (n_measured * n_samples,): of a whole record at the common
    # parameters, of a window at those of its record alone, so that differences between records do not affect
    # windows.
    residuals: Floats
    noise: Floats  # residuals after projecting out parameters and state of this piece, same shape
    n_measured: int  # number of stacked outputs
    n_own: int  # number of projected parameters: free parameters and initial states


@dataclass(frozen=True)
class Pieces:
    """Whole records, their halves and quarters."""

    free: tuple[str, ...]
    values: Floats  # of the common fit, shape (n_free,)
    place: Floats  # the same in the coordinates of the rows, shape (n_free,)
    coordinates: Coordinates  # conversion from coordinates to values
    derivative_error: float  # relative error of the rows
    # One of each record, or its windows where the diagnosis itself is done in windows.
    whole: tuple[Piece, ...]
    # Number of windows in a record -> the windows of all records; without those too short.
    cut: dict[int, tuple[Piece, ...]]
    # Number of windows in each record that can be evaluated individually, 1 where they are too short.
    portions: int = 1


def pieces(context: FitContext, model: FittedModel) -> Pieces | None:
    """Return the information of records and their windows; None where the model cannot be simulated in one of them."""
    free, records, fit = model.fit.free, context.records, context.on_all_records(model)
    found = derivatives(context.problem(fit.structure, records), fit, free)
    whole: list[Piece] = []
    own: list[FitResult] = []
    for index, (record, common) in enumerate(zip(records, found.records, strict=True)):
        name = record.origin
        alone = replace(
            fit, initial_states=(fit.initial_states[index],), substeps=(fit.substeps[index],), residuals=()
        )
        piece = _piece(name, (0, 1), common)
        if piece is not None and _asks_for_other_numbers(piece):
            problem = context.problem(fit.structure, [record])
            there = own_derivatives(problem, alone, free, TRUST.own_steps, TRUST.worth_a_step)
            if there is not None:
                piece, alone = _piece(name, (0, 1), there.derivatives), there.fit
        if piece is None:
            return None
        whole.append(piece)
        own.append(alone)
    values = np.array([fit.values[name] for name in free])
    made = Pieces(free, values, found.place, found.coordinates, found.error, tuple(whole), {})
    # The initial state of a hysteresis sticks and slips: its effect is not linear.
    remembers = bool(np.any(context.problem(fit.structure, records[:1]).data.limited))
    if remembers or any(record.window_of for record in records):
        return made
    cut: dict[int, tuple[Piece, ...]] = {}
    for count in TRUST.windows:
        windows = [_windows(context, record, count) for record in records]
        parts = [
            _in_windows(context, alone, part, free, piece, found.place)
            for alone, part, piece in zip(own, windows, whole, strict=True)
            if part
        ]
        if len(parts) < len(records) or any(part is None for part in parts):
            break
        cut[count] = tuple(piece for part in parts for piece in part or ())
    shortest = min(record.n_samples * record.dt for record in records) / context.period
    wide = [count for count in cut if shortest >= count * TRUST.periods_alone]
    return replace(made, cut=cut, portions=max(wide, default=1))


def pseudo_inverse(rows: Floats) -> Floats:
    """Return the pseudoinverse that maps residuals to parameters, shape (n_free, n); zero in undetermined directions."""
    size = np.linalg.norm(rows, axis=0)
    size[size == 0.0] = 1.0
    base, triangle = np.linalg.qr(rows / size)
    return np.asarray(np.linalg.pinv(triangle, rcond=_UNDETERMINED) @ base.T / size[:, None])


def _asks_for_other_numbers(piece: Piece) -> bool:
    remainder, here = float(piece.noise @ piece.noise), float(piece.residuals @ piece.residuals)
    return remainder < (1.0 - TRUST.worth_a_step) * here


def _windows(context: FitContext, record: Record, count: int) -> list[Record]:
    """Return a record cut into so many windows; nothing where one would be too short."""
    edges = np.linspace(0, record.n_samples, count + 1).astype(int)
    shortest = int(np.min(np.diff(edges)))
    if shortest < TRUST.window_samples or shortest * record.dt < TRUST.window_periods * context.period:
        return []
    return [record.slice(int(a), int(b)) for a, b in itertools.pairwise(edges)]


def _in_windows(
    context: FitContext,
    alone: FitResult,
    windows: Sequence[Record],
    free: Sequence[str],
    whole: Piece,
    common: Floats,
) -> tuple[Piece, ...] | None:
    """Return the windows of a record, evaluated at the parameters of the whole record."""
    problem = context.problem(alone.structure, windows)
    started = problem.fit(
        alone.values, [], max_evaluations=TRUST.state_evaluations, tolerance=_TOLERANCE, finish=False
    )
    if not np.isfinite(started.cost):
        return None
    found = derivatives(problem, started, free)
    beyond = common - pseudo_inverse(whole.rows) @ whole.residuals - found.place
    made = []
    for index, own in enumerate(found.records):
        moved = replace(own, residuals=own.residuals + own.by_coordinate @ beyond)
        piece = _piece(whole.record, (index, len(windows)), moved)
        if piece is None:
            return None
        made.append(piece)
    return tuple(made)


def _piece(name: str, place: tuple[int, int], own: RecordDerivatives) -> Piece | None:
    together = np.column_stack([own.by_state, own.by_coordinate])
    if not (np.all(np.isfinite(together)) and np.all(np.isfinite(own.residuals))):
        return None
    of_state, of_all = _basis(own.by_state), _basis(together)
    return Piece(
        record=name,
        place=place,
        rows=own.by_coordinate - of_state @ (of_state.T @ own.by_coordinate),
        residuals=own.residuals - of_state @ (of_state.T @ own.residuals),
        noise=own.residuals - of_all @ (of_all.T @ own.residuals),
        n_measured=own.n_measured,
        n_own=of_all.shape[1],
    )


def _basis(columns: Floats) -> Floats:
    """Return an orthonormal basis of columns, shape (n, rank); of many samples and few columns this takes a fifth of an SVD."""
    size = np.linalg.norm(columns, axis=0)
    size[size == 0.0] = 1.0
    base, triangle = np.linalg.qr(columns / size)
    turned, singular, _ = np.linalg.svd(triangle)
    return np.asarray(
        base @ turned[:, singular > _UNDETERMINED * max(float(np.max(singular, initial=0.0)), 1e-300)]
    )

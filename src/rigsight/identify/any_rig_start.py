"""Parameters of a rig of any shape straight from its records, as start values of a grey-box fit.

Where sensors show all states, the error of the equations of motion is made small (`weak_equations`); in any case that of the
linearization against the spectra (`linearized_responses`). Both search over decades and cost no simulation. The best few of their
minima are fitted roughly by simulation, and the one that leaves least is the start.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.identify.first_states import rig_state
from rigsight.identify.fit_result import FitResult
from rigsight.identify.grey_box import GreyBoxFit
from rigsight.identify.linearized_responses import LinearizedResponses
from rigsight.identify.place_scales import scales_at_places
from rigsight.identify.rig_equations import equations_of
from rigsight.identify.spread_search import balanced, ends_of_search
from rigsight.identify.typical_size import size_of_signal
from rigsight.identify.weak_equations import WeakEquations
from rigsight.parameters import Parameter
from rigsight.records.record import Record
from rigsight.rigs import Rig
from rigsight.simulate import compose
from rigsight.simulate.prescribed_motion import smooth_motion

Floats = NDArray[np.float64]

_SEED = 0
"""The same records give the same start."""
_LIKELY = 2
"""Minima of each search that are fitted by simulation."""
_ROUGH_EVALUATIONS = 15
_ROUGH_TOLERANCE = 1e-3
_PIECES = (32, 16, 8, 4, 2)
"""Into how many pieces each record is cut, in turn."""
_MOST_PIECES = 16
_MOST_SAMPLES = 10000
"""Samples of all records together that are simulated for a start."""
_EXPLAINED = 2.0
"""Residual over what is rough in the sensors at which nothing further is tried: a spline leaves half of the noise at least."""
_LEAST_NOISE = 1e-4
"""Noise of a sensor that shows none, relative to its size: a fit that comes so near has found its place."""


def any_rig_start(
    rig: Rig, records: Sequence[Record], constants: Mapping[str, float], known: Mapping[str, float]
) -> dict[str, float]:
    """Return a value for every parameter of a rig without effects.

    Parameters
    ----------
    rig
        The rig.
    records
        Estimation records.
    constants
        The rig's constants by name.
    known
        Parameters that keep their value.

    Raises
    ------
    InputError
        If no record holds a sensor of the rig that moves.
    """
    _check_moves(rig, records)
    sought = [p for p in rig.parameters if p.name not in known]
    if not sought:
        return dict(known)
    values = {**constants, **known}
    rough = _Rough(rig, records, values, [p.name for p in sought])
    tried: list[FitResult] = []
    starts: list[dict[str, float]] = []
    for start in _minima(rig, records, values, sought):
        starts.append(start)
        tried.append(rough.whole(start))
        if rough.explains(tried[-1]):
            break
    best = min(tried, key=lambda fit: fit.cost)
    if not rough.explains(best):
        ways = [starts[0]] if best is tried[0] else [starts[0], dict(best.values)]
        best = min([best, *map(rough.lengthening, ways)], key=lambda fit: fit.cost)
    return {p.name: float(best.values[p.name]) for p in rig.parameters}


def _minima(
    rig: Rig, records: Sequence[Record], values: Mapping[str, float], sought: Sequence[Parameter]
) -> Iterator[dict[str, float]]:
    """Yield values from which simulations may start: of the equations' error, then of the linearization's."""
    equations, names = equations_of(rig), [p.name for p in sought]
    rng = np.random.default_rng(_SEED)

    def named(found: Floats) -> dict[str, float]:
        return {**values, **dict(zip(names, map(float, found), strict=True))}

    weak = WeakEquations(equations, records, values, names)
    space = balanced(sought, weak.term_sizes)
    if weak.n_records:
        for _, found in ends_of_search(space, weak.errors, rng)[:_LIKELY]:
            yield named(found)
    expected = named(space.values(space.start()))
    middle = [rig_state(equations, record, expected, resting=record.n_samples) for record in records]
    linear = LinearizedResponses(equations, records, values, names, middle)
    for _, found in ends_of_search(space, linear.errors, rng)[:_LIKELY]:
        yield named(found)


class _Rough:
    """Rough fits by simulation from one start after the other."""

    def __init__(
        self, rig: Rig, records: Sequence[Record], values: Mapping[str, float], free: Sequence[str]
    ) -> None:
        most = max(1, _MOST_SAMPLES // len(records))
        self._rig, self._values, self._free = rig, values, list(free)
        self._records = [record.slice(0, min(most, record.n_samples)) for record in records]
        self._noise = {signal.name: _noise(signal.name, records) for signal in rig.outputs}

    def explains(self, fit: FitResult) -> bool:
        """Return True if a fit leaves not much more than noise."""
        return fit.cost <= _EXPLAINED**2 * fit.n_samples

    def whole(self, start: Mapping[str, float]) -> FitResult:
        """Fit the records as they are."""
        return self._fitted(1, start)

    def lengthening(self, start: Mapping[str, float]) -> FitResult:
        """Fit pieces of the records, of double length each time, then the whole.

        Over a short piece no motion is far from the one that was measured, however unstable or chaotic it is.
        """
        values = start
        for count in _PIECES:
            in_pieces = self._fitted(count, values)
            values = in_pieces.values if np.isfinite(in_pieces.cost) else values
        return self._fitted(1, values)

    def _fitted(self, count: int, start: Mapping[str, float]) -> FitResult:
        pieces = []
        for record in self._records:
            edges = np.unique(np.linspace(0, record.n_samples, count + 1).astype(int))
            pieces += [record.slice(int(a), int(b)) for a, b in pairwise(edges)]
        # Each has an initial state of its own: of many, some say enough.
        if count > 1:
            pieces = pieces[:: max(1, -(-len(pieces) // _MOST_PIECES))]
        scales = scales_at_places(self._rig, self._records, start)
        problem = GreyBoxFit(compose(self._rig), pieces, scales, self._noise)
        return problem.fit(
            start, self._free, None, _ROUGH_EVALUATIONS, tolerance=_ROUGH_TOLERANCE, finish=False
        )


def _noise(name: str, records: Sequence[Record]) -> float:
    """Return the standard deviation of what is rough in a sensor."""
    signals = [record[name] for record in records if name in record]
    if not signals:
        return 1.0
    rough = [r[name] - smooth_motion(r[name], r.dt)[0] for r in records if name in r]
    size = float(np.sqrt(np.mean(np.concatenate(rough) ** 2)))
    return max(size, _LEAST_NOISE * size_of_signal(signals)) or 1.0


def _check_moves(rig: Rig, records: Sequence[Record]) -> None:
    held = [record[s.name] for record in records for s in rig.outputs if s.name in record]
    if not held:
        listed = ", ".join(signal.name for signal in rig.outputs)
        raise InputError(f"No estimation record holds a sensor of the rig '{rig.name}'. It has: {listed}.")
    if all(np.ptp(signal) <= 1e-12 * np.max(np.abs(signal)) for signal in held):
        raise InputError("No sensor moves in any estimation record; nothing can be identified.")

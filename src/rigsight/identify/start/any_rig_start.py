"""Parameters of any rig directly from its records, as start values of a grey-box fit.

If sensors show all states, the error of the equations of motion is minimized (`weak_equations`); in any case also the error of
the linearization relative to the spectra (`linearized_responses`). Both searches cover decades and need no simulation. The best
few minima are fitted roughly by simulation, and the one with the lowest error is the start.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import qr

from rigsight.errors import InputError
from rigsight.identify.fit.covariance import symmetric_eigen
from rigsight.identify.fit.first_states import rig_state
from rigsight.identify.fit.fit_data import FitResult
from rigsight.identify.fit.grey_box import GreyBoxFit
from rigsight.identify.fit.windows import pieces
from rigsight.identify.rig_equations import RigEquations, equations_of
from rigsight.identify.start.linearized_responses import LinearizedResponses
from rigsight.identify.start.scales import scales_at_places
from rigsight.identify.start.spread_search import AGREEING, PERSISTENT, balanced, ends_of_search
from rigsight.identify.start.weak_equations import WeakEquations
from rigsight.parameters import Parameter
from rigsight.records.record import Floats, Record
from rigsight.records.signals import size_of_signal
from rigsight.rigs import Rig
from rigsight.simulate import compose, parameter_vector
from rigsight.simulate.prescribed_motion import smooth_motion

_SEED = 0
"""Fixed, so that the same records give the same start."""
_LIKELY = 2
"""Minima of each search that are fitted by simulation."""
_ROUGH_EVALUATIONS = 15
_ROUGH_TOLERANCE = 1e-3
_PIECES = (32, 16, 8, 4, 2)
"""Numbers of pieces into which each record is cut, in turn."""
_TOLD = 1.0
"""Error in units of the noise due to doubling a parameter, above which the records determine the parameter; else it is held."""
_LONG_PIECES = 8
"""Number of pieces of a record up to which they count as long; in shorter ones, free initial states mask wrong parameters."""
_GROWN = 2.0
"""Ratio of the residuals of the whole and of long pieces up to which another minimum would not be better."""
_MOST_PIECES = 16
_MOST_SAMPLES = 10000
"""Samples of all records together that are simulated for a start."""
_EXPLAINED = 2.0
"""Residual over the rough part of the readings at which the search ends; a spline leaves at least half of the noise."""
_HIGHEST = 0.9
"""Share of the spectrum above which it counts as noise."""
_LEAST_NOISE = 1e-4
"""Noise assumed for a sensor without visible noise, relative to its size: a fit with such a small residual has converged."""


def any_rig_start(
    rig: Rig, records: Sequence[Record], constants: Mapping[str, float], known: Mapping[str, float]
) -> dict[str, float]:
    """Return a value for every parameter of a rig without effects."""
    _check_moves(rig, records)
    sought = [p for p in rig.parameters if p.name not in known]
    if not sought:
        return dict(known)
    defaults = {p.name: p.default for p in sought if p.default is not None}
    if rig.mechanism.bodies_are_nonlinear and len(defaults) == len(sought):
        # Another simulator evaluates these equations, so their error is as costly as simulations.
        return {**known, **defaults}
    values = {**constants, **known}
    rough = _Rough(rig, records, values, [p.name for p in sought])
    best: FitResult | None = None
    for is_weak, is_close, start in _minima(rig, records, values, sought):
        found = rough.whole(start)
        if is_close and np.isfinite(found.cost) and not rough.explains(found):
            if is_weak and rough.holds_at_any_length(found):
                # The equations agree with all states of the records and errors do not grow: an effect is missing in the rig.
                best = found
                break
            pieces, whole = rough.lengthening(start)
            if pieces is not None and not rough.explains(whole):
                # The motion is chaotic: there are no values with which a simulation of the whole record is better.
                best = pieces
                break
            found = min(found, whole, key=lambda fit: fit.cost)
        best = found if best is None else min(best, found, key=lambda fit: fit.cost)
        if rough.explains(best):
            break
    assert best is not None
    return {p.name: float(best.values[p.name]) for p in rig.parameters}


def _minima(
    rig: Rig, records: Sequence[Record], values: Mapping[str, float], sought: Sequence[Parameter]
) -> Iterator[tuple[bool, bool, dict[str, float]]]:
    """Yield local minima as start values, each with two flags: from the error of the equations, and to be examined further."""
    # The flag for further examination is set for the lowest minimum of the searches with few starts. They come first; searches
    # with many starts follow if none of their minima explains the records.
    equations, names = equations_of(rig), [p.name for p in sought]
    rng = np.random.default_rng(_SEED)
    weak = WeakEquations(equations, records, values, names)
    space = balanced(sought, weak.term_sizes)
    sizes = {**values, **dict(zip(names, map(float, space.expected), strict=True))}
    space = balanced(_masses_positive(equations, sought, sizes), weak.term_sizes)

    def ends(
        errors: Callable[[Floats], Floats], agreeing: int, is_weak: bool
    ) -> Iterator[tuple[bool, bool, dict[str, float]]]:
        found = ends_of_search(space, errors, rng, agreeing)[:_LIKELY]
        for rank, (_, own) in enumerate(found):
            numbers = dict(zip(names, map(float, own), strict=True))
            yield is_weak, rank == 0 and agreeing != PERSISTENT, {**values, **numbers}

    if weak.n_records:
        yield from ends(weak.errors, AGREEING, True)
    expected = {**values, **dict(zip(names, map(float, space.values(space.start())), strict=True))}
    middle = [rig_state(equations, record, expected, resting=record.n_samples) for record in records]
    linear = LinearizedResponses(equations, records, values, names, middle)
    yield from ends(linear.errors, AGREEING, False)
    yield from ends(linear.errors, PERSISTENT, False)
    if weak.n_records:
        yield from ends(weak.errors, PERSISTENT, True)


def _masses_positive(
    equations: RigEquations, sought: Sequence[Parameter], sizes: Mapping[str, float]
) -> list[Parameter]:
    """Return the unknown parameters, with zero as the lower bound of those without which the mass matrix is singular."""
    still = np.zeros((equations.n_states, 1)), np.zeros((3 * len(equations.rig.inputs), 1))

    def is_massless(without: str) -> bool:
        p = parameter_vector(equations.structure, {**sizes, without: 0.0})
        masses = equations.mass(*still, p)
        return bool(np.all(np.isfinite(masses)) and np.linalg.matrix_rank(masses[0]) < masses.shape[1])

    return [replace(p, lower=0.0) if p.lower < 0.0 and is_massless(p.name) else p for p in sought]


class _Rough:
    """Rough fits by simulation from successive start values."""

    def __init__(
        self, rig: Rig, records: Sequence[Record], values: Mapping[str, float], free: Sequence[str]
    ) -> None:
        most = max(1, _MOST_SAMPLES // len(records))
        self._rig, self._values, self._free = rig, values, list(free)
        self._records = [record.slice(0, min(most, record.n_samples)) for record in records]
        # The initial state of a piece alone takes as many readings as it has states, and the input between samples takes two.
        self._most_cuts = min(r.n_samples for r in self._records) // (2 + len(compose(rig).states))
        self._noise = {signal.name: _noise(signal.name, records) for signal in rig.outputs}

    def explains(self, fit: FitResult) -> bool:
        """Return True if the residual of a fit is not much larger than the noise."""
        return fit.cost <= _EXPLAINED**2 * fit.n_samples

    def whole(self, start: Mapping[str, float]) -> FitResult:
        """Fit the whole records."""
        return self._fitted(1, start, scales_at_places(self._rig, self._records, start))

    def holds_at_any_length(self, whole: FitResult) -> bool:
        """Return True if a fit of whole records is not much worse than one of pieces, each with its own initial state."""
        if not np.isfinite(whole.cost):
            return False
        scales = scales_at_places(self._rig, self._records, whole.values)
        pieces = self._fitted(max(1, min(_LONG_PIECES, self._most_cuts)), whole.values, scales)
        return whole.cost / whole.n_samples <= _GROWN**2 * pieces.cost / max(1, pieces.n_samples)

    def lengthening(self, start: Mapping[str, float]) -> tuple[FitResult | None, FitResult]:
        """Fit pieces of the records, of double length each time, then the whole records."""
        # Over a short piece, even an unstable or chaotic motion stays close to the measured one.
        explained: FitResult | None = None
        values, scales = start, scales_at_places(self._rig, self._records, start)
        for count in (count for count in _PIECES if count <= self._most_cuts):
            in_pieces = self._fitted(count, values, scales)
            values = in_pieces.values if np.isfinite(in_pieces.cost) else values
            if count <= _LONG_PIECES and self.explains(in_pieces):
                explained = in_pieces
        return explained, self._fitted(1, values, scales)

    def _fitted(self, count: int, start: Mapping[str, float], scales: Mapping[str, float]) -> FitResult:
        fitted = [piece for record in self._records for piece in pieces(record, count)]
        # Each piece has its own initial state, so only some of many are used.
        if count > 1:
            fitted = fitted[:: max(1, -(-len(fitted) // _MOST_PIECES))]
        problem = GreyBoxFit(compose(self._rig), fitted, scales, self._noise)
        reported = _reported(problem.information(start, self._free), self._free)
        return problem.fit(
            start, reported, None, _ROUGH_EVALUATIONS, tolerance=_ROUGH_TOLERANCE, finish=False
        )


def _reported(information: Floats, free: Sequence[str]) -> list[str]:
    """Return as many parameters as combinations are determined by the records; they are determined if the others are held."""
    if not np.all(np.isfinite(information)):
        return list(free)
    values, vectors = symmetric_eigen(information)
    root = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    triangle, order = qr(root, mode="r", pivoting=True)
    rank = int(np.count_nonzero(np.abs(np.diag(triangle)) > _TOLD))
    return [name for index, name in enumerate(free) if index in order[:rank]]


def _noise(name: str, records: Sequence[Record]) -> float:
    """Return an estimate of a sensor's noise: from the residual of a spline, or from the end of its spectrum."""
    # The larger of the two is used, because the spline smooths little if the motion is fast.
    held = [record for record in records if name in record]
    if not held:
        return 1.0
    rough = [record[name] - smooth_motion(record[name], record.dt)[0] for record in held]
    remainder = float(np.sqrt(np.mean(np.concatenate(rough) ** 2)))
    ends = [_end_of_spectrum(record[name]) for record in held]
    size = size_of_signal([record[name] for record in held])
    return max(remainder, float(np.median(ends)), _LEAST_NOISE * size) or 1.0


def _end_of_spectrum(signal: Floats) -> float:
    """Return the standard deviation of white noise with the spectrum of the signal's highest frequencies."""
    window = np.hanning(signal.size)
    power = np.abs(np.fft.rfft((signal - np.mean(signal)) * window)) ** 2
    # The median of a line's power is log 2 times its mean.
    highest = np.median(power[int(_HIGHEST * power.size) :]) / np.log(2.0)
    return float(np.sqrt(highest / max(float(window @ window), 1e-300)))


def _check_moves(rig: Rig, records: Sequence[Record]) -> None:
    held = [record[s.name] for record in records for s in rig.outputs if s.name in record]
    if not held:
        listed = ", ".join(signal.name for signal in rig.outputs)
        raise InputError(f"No estimation record contains a sensor of the rig '{rig.name}'. It has: {listed}.")
    if all(np.ptp(signal) <= 1e-12 * np.max(np.abs(signal)) for signal in held):
        raise InputError("No sensor moves in any estimation record; nothing can be identified.")

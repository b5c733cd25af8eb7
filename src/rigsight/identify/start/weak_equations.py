"""Error of the equations of a rig along the measured motion, in the weak form and weighted by its noise.

``d/dt P = R`` for each coordinate (P its momentum, R all forces) and each own state is multiplied by ``w(t) e^{-j omega t}`` on
overlapping stretches and integrated by parts, so that no second derivative of a measured signal is needed. There is no
simulation: the error is a cheap sum and valid for large motion. Its covariance follows from the sensor noise through the
linearized equations, so that this is an errors-in-variables estimate: a stiff shaft whose twist is below the noise is not
estimated as soft.

References
----------
M. Shinbrot, Trans. ASME 79 (1957) 547, and A. E. Pearson and F. C. Lee, Control Theory Adv. Technol. 1 (1985) 241, for modulating
functions. R. Pintelon and J. Schoukens, *System Identification: A Frequency Domain Approach* (Wiley 2012), chapter 8, for errors
in variables.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.identify.rig_equations import FUNCTIONS, RigEquations, rows_of
from rigsight.identify.start.measured_states import (
    MeasuredStates,
    Projection,
    measured_states,
    projected,
    sensor_factors,
    supposed_states,
)
from rigsight.records.record import Floats, Record

_MOST_FACTORS = 6
"""Largest power that is expanded; energies contain squares, and potentials somewhat higher powers."""


Complexes = NDArray[np.complex128]

_MOST_POINTS = 400
"""Number of lines of all records together, evenly chosen, for some ten parameters."""
_MODEL_ERROR = 3e-3
"""Relative error of each term of an equation, due to rates from splines and inputs between samples."""


@dataclass(frozen=True)
class _Term:
    """``factor(p) * signal(z, u)``, part of the momentum (or the forces) of one equation; the unknowns are in the factor."""

    equation: int
    is_momentum: bool
    factor: sp.Expr
    signal: sp.Expr


@dataclass(frozen=True)
class _Block:
    """One record: the terms on its lines, and the response of the equations to noise of the states."""

    omega: Floats  # angular frequencies [rad/s], shape (n_points,)
    terms: Complexes  # projected signals of the terms, shape (n_terms, n_points)
    squares: Floats  # their squared absolute values
    # Derivatives of the terms by coordinates and own states, for each power of ``j omega``: (n_terms, 3, n_states').
    slopes: Floats
    # Square root of the covariance of coordinates and own states, shape (n_points, n_states', n_sensors).
    noise: Complexes
    p: Floats  # the record's parameter vector with its own constants
    # States, inputs and projection, for terms in which signals and unknown parameters cannot be separated.
    measured: MeasuredStates
    u: Floats
    projection: Projection


class WeakEquations:
    """The error of a rig's equations in records as a function of its free parameters, the values of all others being known.

    Records that do not show all states are not used here; if none does (`n_records` is zero), only `term_sizes` is meaningful.
    """

    def __init__(
        self,
        equations: RigEquations,
        records: Sequence[Record],
        values: Mapping[str, float],
        free: Sequence[str],
    ) -> None:
        self._equations = equations
        self._free = tuple(free)
        factors = sensor_factors(equations, frozenset(free))
        unknown = dict.fromkeys(free, 1.0)
        both = [(record, equations.parameters({**unknown, **values}, record)) for record in records]
        found = [(*own, measured_states(equations, *own, factors)) for own in both]
        shown = [(record, p, measured) for record, p, measured in found if measured is not None]
        self.n_records = len(shown)
        self._columns = [equations.structure.names.index(name) for name in free]
        if not shown:
            # Sizes of terms can still be estimated.
            shown = [(*both[0], supposed_states(equations, *both[0], factors))]
        self._terms, self._mixed = self._separated(shown[0][2])
        p = list(equations.structure.parameter_symbols)
        factors_of_terms = [term.factor for term in self._terms]
        self._factors_at = sp.lambdify(p, factors_of_terms, modules=[FUNCTIONS, "numpy"], cse=True)
        self._functions, self._mixed_functions = map(self._written, (self._terms, self._mixed))
        of_equation = np.array([term.equation for term in self._terms])
        self._of_equation = [np.flatnonzero(of_equation == i) for i in range(self.n_equations)]
        self._memberships = (of_equation == np.arange(self.n_equations)[:, None]).astype(np.float64)
        most = max(1, _MOST_POINTS // len(shown))
        self._blocks = [self._block(record, p, measured, most) for record, p, measured in shown]

    @property
    def n_equations(self) -> int:
        """Number of equations: one for each coordinate and own state."""
        return self._equations.n_states - self._equations.n_coordinates

    def errors(self, values: Floats) -> Floats:
        """Return the weighted errors for values of the free parameters, shape (n_errors,): of size one if due to noise."""
        found = []
        for block in self._blocks:
            p = block.p.copy()
            p[self._columns] = values
            with np.errstate(all="ignore"):
                white = self._whitened(block, p)
            found += [white.real.ravel(), white.imag.ravel()]
        return np.nan_to_num(np.concatenate(found), nan=1e6, posinf=1e6, neginf=-1e6)

    def term_sizes(self, values: Floats) -> list[tuple[int, float, Floats]]:
        """Return for each term its equation, its size for these values, and its powers in them, shape (n_free,)."""
        sizes = np.sqrt(np.mean(np.concatenate([np.abs(b.terms) ** 2 for b in self._blocks], axis=1), axis=1))
        p = self._blocks[0].p.copy()
        p[self._columns] = values
        factors = self._factors(p)
        powers = np.zeros((len(self._terms), len(self._free)))
        for i, column in enumerate(self._columns):
            moved = p.copy()
            moved[column] *= 1.01
            with np.errstate(all="ignore"):
                powers[:, i] = np.log(np.abs(self._factors(moved) / factors)) / np.log(1.01)
        return [
            (term.equation, float(np.abs(factor) * size), np.nan_to_num(power))
            for term, size, factor, power in zip(self._terms, sizes, factors, powers, strict=True)
        ]

    def _separated(self, measured: MeasuredStates) -> tuple[list[_Term], list[_Term]]:
        """Return the terms of all equations, and those in which signals and unknown parameters cannot be separated."""
        equations = self._equations
        structure = equations.structure
        symbols = dict(zip(structure.names, structure.parameter_symbols, strict=True))
        unknown = {symbols[name] for name in self._free}
        shift = self._offsets(measured, set(structure.parameter_symbols))
        signals = [*structure.states, *equations.inputs]
        terms: dict[tuple[int, bool, sp.Expr], sp.Expr] = {}
        mixed: list[_Term] = []
        momenta, forces = equations.momenta_and_forces
        if structure.elimination is not None:
            return _in_products((momenta, forces), shift, frozenset(unknown), frozenset(signals))
        for is_momentum, sides in ((True, momenta), (False, forces)):
            for index, side in enumerate(sides):
                moved = side.xreplace(shift)
                expanded = sp.expand(sp.expand_trig(moved) if shift else moved)
                for part in sp.Add.make_args(expanded):
                    factor, signal = part.as_independent(*signals, as_Add=False)
                    known, sought = factor.as_independent(*unknown, as_Add=False)
                    if signal.free_symbols & unknown:
                        mixed.append(_Term(index, is_momentum, sp.S.One, part))
                    elif part != 0:
                        key = (index, is_momentum, known * signal)
                        terms[key] = terms.get(key, sp.S.Zero) + sought
        return [_Term(i, m, factor, signal) for (i, m, signal), factor in terms.items()], mixed

    def _offsets(self, measured: MeasuredStates, known: set[sp.Symbol]) -> dict[sp.Symbol, sp.Expr]:
        """Return replacements of coordinates and own states that subtract the offsets of the sensors' readings."""
        equations = self._equations
        states = equations.structure.states
        n = equations.n_coordinates
        rest = dict.fromkeys(states, sp.S.Zero)
        added = [e.xreplace(rest) for e in equations.structure.outputs[: len(equations.sensor_names)]]
        shift = {}
        for row, state in zip(measured.by_reading, [*states[:n], *states[2 * n :]], strict=True):
            parts = [
                sp.Float(-f) * e
                for f, e in zip(row, added, strict=True)
                if f != 0.0 and e.free_symbols <= known
            ]
            offset = sp.Add(*parts)
            if offset != 0:
                shift[state] = state + offset
        return shift

    def _written(self, terms: Sequence[_Term]) -> tuple[Any, Any]:
        """Return functions for the signals of terms and for their derivatives by the states."""
        equations, signals = self._equations, [term.signal for term in terms]
        function = sp.lambdify(equations.arguments, signals, modules=[FUNCTIONS, "numpy"], cse=True)
        return function, equations.slopes(signals, equations.structure.states)

    def _factors(self, p: Floats) -> Floats:
        return np.array(self._factors_at(*p), dtype=np.float64).reshape(len(self._terms))

    def _block(self, record: Record, p: Floats, measured: MeasuredStates, most: int) -> _Block:
        equations = self._equations
        u = equations.inputs_of(record)[1].copy()
        if record.hold == "zoh":
            # At a sample, a held input is replaced by the mean of its values before and after it.
            u[0::3, 1:] = (u[0::3, 1:] + u[0::3, :-1]) / 2.0
        projection, floors = projected(equations, record, measured, most)
        terms, slopes = self._at_lines(self._terms, self._functions, projection, [*measured.z, *u, 0.0, *p])
        s = 1j * projection.omega[:, None, None]
        through = measured.by_reading + measured.by_integral / np.where(s == 0.0, 1.0, s)
        return _Block(
            omega=projection.omega,
            terms=terms,
            squares=np.abs(terms) ** 2,
            slopes=slopes,
            noise=np.asarray(through * np.sqrt(floors), dtype=np.complex128),
            p=p,
            measured=measured,
            u=u,
            projection=projection,
        )

    def _at_lines(
        self, terms: Sequence[_Term], functions: tuple[Any, Any], projection: Projection, at: Sequence[Any]
    ) -> tuple[Complexes, Floats]:
        """Return the terms on the lines of a record, and their derivatives, of the shapes in `_Block`."""
        n, n_states, n_samples = self._equations.n_coordinates, self._equations.n_states, at[0].size
        signals, by_states = (rows_of(function(*at), n_samples) for function in functions)
        means = np.mean(by_states.reshape(len(terms), n_states, n_samples), axis=2)
        found = np.empty((len(terms), projection.omega.size), dtype=np.complex128)
        slopes = np.zeros((len(terms), 3, self.n_equations))
        for row, own, term, signal, mean in zip(found, slopes, terms, signals, means, strict=True):
            row[:] = projection.of_rate(signal) if term.is_momentum else -projection.of(signal)
            first, sign = (1, 1.0) if term.is_momentum else (0, -1.0)
            own[first, :n] += sign * mean[:n]
            own[first + 1, :n] += sign * mean[n : 2 * n]
            own[first, n:] += sign * mean[2 * n :]
        return found, slopes

    def _whitened(self, block: _Block, p: Floats) -> Complexes:
        """Return the errors of a record divided by the root of their covariance, shape (n_points, n_equations)."""
        factors = self._factors(p)
        n_points, n = block.omega.size, self.n_equations
        error = np.empty((n_points, n), dtype=np.complex128)
        spread = np.empty((n_points, n))
        for equation, own in enumerate(self._of_equation):
            error[:, equation] = factors[own] @ block.terms[own]
            spread[:, equation] = factors[own] ** 2 @ block.squares[own]
        response = (self._memberships * factors) @ block.slopes.reshape(len(self._terms), 3 * n)
        response = response.reshape(n, 3, n).swapaxes(0, 1)
        if self._mixed:
            at = [*block.measured.z, *block.u, 0.0, *p]
            added, slopes = self._at_lines(self._mixed, self._mixed_functions, block.projection, at)
            for term, size, slope in zip(self._mixed, added, slopes, strict=True):
                error[:, term.equation] += size
                spread[:, term.equation] += np.abs(size) ** 2
                response[:, term.equation] += slope
        s = 1j * block.omega[:, None, None]
        through = (response[0] + s * response[1] + s**2 * response[2]) @ block.noise
        covariance = through @ np.conj(np.swapaxes(through, 1, 2))
        covariance[:, np.arange(n), np.arange(n)] += _MODEL_ERROR**2 * spread + 1e-300
        # Scaled to unit variances, so that the root exists for any units of the equations.
        size = np.sqrt(np.real(covariance[:, np.arange(n), np.arange(n)]))
        correlation = covariance / (size[:, :, None] * size[:, None, :])
        correlation[:, np.arange(n), np.arange(n)] += 1e-12
        try:
            root = np.linalg.cholesky(correlation)
        except np.linalg.LinAlgError:
            return np.full((n_points, n), np.nan, dtype=np.complex128)
        return np.asarray(np.linalg.solve(root, (error / size)[:, :, None])[:, :, 0])


def _in_products(
    sides: tuple[Sequence[sp.Expr], Sequence[sp.Expr]],
    shift: Mapping[sp.Symbol, sp.Expr],
    unknown: frozenset[sp.Symbol],
    signals: frozenset[sp.Symbol],
) -> tuple[list[_Term], list[_Term]]:
    """Return terms and mixed terms of equations that are too long to be expanded: one for each product of unknowns."""
    terms: dict[tuple[int, bool, sp.Expr], list[sp.Expr]] = {}
    mixed: list[_Term] = []
    for is_momentum, side in zip((True, False), sides, strict=True):
        for index, whole in enumerate(side):
            moved = sp.expand_trig(whole.xreplace(shift)) if shift else whole
            for part in sp.Add.make_args(moved):
                try:
                    products = parameter_products(part, unknown, signals)
                except MixedError:
                    mixed.append(_Term(index, is_momentum, sp.S.One, part))
                    continue
                for product, factor in products.items():
                    terms.setdefault((index, is_momentum, product), []).append(factor)
    return [_Term(*key, sp.Add(*factors)) for key, factors in terms.items() if sp.Add(*factors) != 0], mixed


class MixedError(ValueError):
    """Unknown parameters and signals cannot be separated."""


def parameter_products(
    expression: sp.Expr, unknown: frozenset[sp.Symbol], signals: frozenset[sp.Symbol]
) -> dict[sp.Expr, sp.Expr]:
    """Return the products of unknown parameters in an expression, each with its factor."""
    found: dict[sp.Expr, dict[sp.Expr, sp.Expr]] = {}

    def products(own: sp.Expr) -> dict[sp.Expr, sp.Expr]:
        if own not in found:
            found[own] = split_distinguishable(own)
        return found[own]

    def split_distinguishable(own: sp.Expr) -> dict[sp.Expr, sp.Expr]:
        if not own.free_symbols & unknown:
            return {sp.S.One: own}
        if own.is_Add:
            return _summed(pair for part in own.args for pair in products(part).items())
        if own.is_Mul:
            return _multiplied(map(products, own.args))
        if own.is_Pow and own.exp.is_Integer and 1 < own.exp <= _MOST_FACTORS:
            return _multiplied([products(own.base)] * int(own.exp))
        if own.free_symbols & signals:
            raise MixedError(str(own))
        return {own: sp.S.One}

    return products(expression)


def _summed(pairs: Iterable[tuple[sp.Expr, sp.Expr]]) -> dict[sp.Expr, sp.Expr]:
    parts: dict[sp.Expr, list[sp.Expr]] = {}
    for product, factor in pairs:
        parts.setdefault(product, []).append(factor)
    return {product: sp.Add(*factors) for product, factors in parts.items()}


def _multiplied(factors: Iterable[dict[sp.Expr, sp.Expr]]) -> dict[sp.Expr, sp.Expr]:
    whole: dict[sp.Expr, sp.Expr] = {sp.S.One: sp.S.One}
    for factor in factors:
        whole = _summed((a * b, x * y) for a, x in whole.items() for b, y in factor.items())
    return whole

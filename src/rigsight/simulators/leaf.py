"""Results of another program as functions in symbolic equations, with derivatives and numerical values."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.simulators.bodies import STEP, Bodies, bodies_of

Floats = NDArray[np.float64]

_MOST_REMEMBERED = 16
"""A place and the moved ones around it, of two rigs with few coordinates."""

_lock = threading.Lock()


class simulated(sp.Function):  # type: ignore[misc]  # noqa: N801
    """``simulated(key, index, *arguments)``: see `mass_leaf` and `force_leaf`."""

    is_real = True

    def fdiff(self, argindex: int = 1) -> sp.Expr:
        """Return the slope by one of the arguments."""
        key, index, *arguments = self.args
        if argindex < 3:
            return sp.Integer(0)
        return simulated_slope(key, index, sp.Integer(argindex - 3), *arguments)

    @staticmethod
    def _imp_(key: Any, index: Any, *arguments: Any) -> Any:
        return _shaped(_values(int(key), _is_force(key, index), arguments)[_row(key, index)], arguments)


class simulated_slope(sp.Function):  # type: ignore[misc]  # noqa: N801
    """``simulated_slope(key, index, argument, *arguments)``: its derivative by one argument; how that changes is left out."""

    is_real = True

    def fdiff(self, argindex: int = 1) -> sp.Expr:  # noqa: ARG002
        """Return zero: only first derivatives are asked for."""
        return sp.Integer(0)

    @staticmethod
    def _imp_(key: Any, index: Any, by: Any, *arguments: Any) -> Any:
        by = int(by)
        here = np.asarray(arguments[by], dtype=np.float64)
        step = STEP * np.maximum(np.abs(here), 1.0)
        moved = [*arguments[:by], here + step, *arguments[by + 1 :]]
        before, behind = (
            _values(int(key), _is_force(key, index), own)[_row(key, index)] for own in (arguments, moved)
        )
        return _shaped((behind - before) / step, arguments)


def mass_leaf(bodies: Bodies, row: int, column: int, q: Sequence[sp.Expr], p: Sequence[sp.Expr]) -> sp.Expr:
    """Return an entry of the mass matrix, of coordinates q and parameters p."""
    i, j = max(row, column), min(row, column)
    return simulated(sp.Integer(bodies.key), sp.Integer(i * (i + 1) // 2 + j), *q, *p)


def force_leaf(
    bodies: Bodies,
    row: int,
    q: Sequence[sp.Expr],
    v: Sequence[sp.Expr],
    f: Sequence[sp.Expr],
    p: Sequence[sp.Expr],
) -> sp.Expr:
    """Return the force along a coordinate that the bodies' weight, gyration and constraints put on it.

    It depends on coordinates q, rates v and parameters p, and on the forces f of drives and joints where bodies touch.
    """
    index = sp.Integer(bodies.n * (bodies.n + 1) // 2 + row)
    return simulated(sp.Integer(bodies.key), index, *q, *v, *(f if bodies.program.reads_forces else ()), *p)


def place_of(leaf: sp.Expr) -> tuple[int, ...]:
    """Return row and column of a leaf that is an entry of the mass matrix, and the row of one that is a force."""
    key, index = leaf.args[:2]
    if _is_force(key, index):
        return (_row(key, index),)
    row = next(i for i in range(bodies_of(int(key)).n) if int(index) < (i + 1) * (i + 2) // 2)
    return row, int(index) - row * (row + 1) // 2


def _n_mass(key: Any) -> int:
    n = bodies_of(int(key)).n
    return n * (n + 1) // 2


def _is_force(key: Any, index: Any) -> bool:
    return int(index) >= _n_mass(key)


def _row(key: Any, index: Any) -> int:
    return int(index) - (_n_mass(key) if _is_force(key, index) else 0)


def _shaped(values: Floats, arguments: Sequence[Any]) -> Any:
    shape = np.broadcast_shapes(*(np.shape(argument) for argument in arguments))
    return values.reshape(shape) if shape else float(values[0])


def _values(key: int, is_force: bool, arguments: Sequence[Any]) -> Floats:
    """Return the lower half of the mass matrix, or the forces, shape (n_values, n_points)."""
    columns = np.atleast_2d(
        np.stack(np.broadcast_arrays(*(np.asarray(a, dtype=np.float64).ravel() for a in arguments)))
    )
    return _answered(key, is_force, columns.shape, columns.tobytes())


@lru_cache(maxsize=_MOST_REMEMBERED)
def _answered(key: int, is_force: bool, shape: tuple[int, ...], content: bytes) -> Floats:
    """Return the same of points whose numbers are given as bytes; each entry of a mass matrix asks for the same."""
    with _lock:
        return bodies_of(key).answers.at(np.frombuffer(content).reshape(shape), is_force=is_force)


forget = _answered.cache_clear
"""Drops what is remembered: a function of Python may be another one now."""

"""Does a restoring force return the rig to a rest position, or does the rig drift?"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import sympy as sp
from scipy.linalg import null_space

from rigsight.effects.symbols import derivative
from rigsight.rigs import Rig
from rigsight.simulate import compose
from rigsight.simulate.equations.structure import TIME, input_symbols

_DRAWS = 3
_SINGULAR = 1e-9
"""Singular value of the scaled stiffness, relative to the largest, below which it counts as zero."""


def can_drift(rig: Rig, known: Mapping[str, float]) -> bool:
    """Return True if a rig can rest at different positions under the same force, and a sensor shows the difference."""
    structure = compose(rig)
    motion = structure.tree.motion
    if not motion.coordinates:
        return False
    states = [equation.symbol for equation in structure.equations if equation.symbol not in motion.velocities]
    rates = [*structure.out_of_balance, *(e.rate for e in structure.equations[2 * len(motion.coordinates) :])]
    still = {*motion.velocities, TIME, *(s for i in range(len(rig.inputs)) for s in input_symbols(i)[1:])}
    shown = list(structure.outputs)
    if structure.elimination is not None:
        # Without velocities and input rates the forces are short; otherwise their slopes would be too long.
        zero = dict.fromkeys(still, sp.S.Zero)
        rates, shown = ([e.xreplace(zero) for e in own] for own in (rates, shown))
    slopes = sp.Matrix([[derivative(e, state) for state in states] for e in (*rates, *shown)])
    symbols = sorted(slopes.free_symbols, key=str)
    function = sp.lambdify(symbols, slopes, [{"positive_part": lambda x: np.maximum(x, 0.0)}, "numpy"])
    rng = np.random.default_rng(0)
    defaults = {p.name: p.default for p in (*rig.constants, *rig.parameters) if p.default is not None}
    values = {f"parameter {name}": value for name, value in {**defaults, **known}.items()}
    for _ in range(_DRAWS):
        numbers = [
            0.0 if symbol in still else values.get(str(symbol), float(rng.uniform(0.2, 0.8)))
            for symbol in symbols
        ]
        with np.errstate(all="ignore"):
            matrix = np.asarray(function(*numbers), dtype=np.float64)
        if not np.all(np.isfinite(matrix)):
            continue
        balance, seen = matrix[: len(rates)], matrix[len(rates) :]
        size = np.linalg.norm(balance, axis=0)
        size[size == 0.0] = 1.0
        free = null_space(balance / size, rcond=_SINGULAR)
        if not np.any(np.abs((seen / size) @ free) > _SINGULAR * np.max(np.abs(seen), initial=1.0)):
            return False
    return True

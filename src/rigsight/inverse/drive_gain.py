"""Gains of drives that move a known mass or work against a known weight: the scale of their forces follows from it.

Residuals of equations count in units of the input there. Measured as a force, they would fall with the gain alone.

References
----------
M. Gautier and S. Briot, IEEE Trans. Robot. 30 (2014) 1220, for gains of drives from a known payload.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.effects.symbols import derivative
from rigsight.rigs import Drive, Rig

Floats = NDArray[np.float64]


def gains_of_known_scale(rig: Rig) -> dict[str, list[bool]]:
    """Return the parameters that are the gain of a drive against a known mass or weight, with whether it enters each equation."""
    mechanism = rig.mechanism
    along = {name: drive.along.free_symbols for name, drive in gains_of_drives(rig).items()}
    if not along:
        return {}
    scaled = _known_part(rig, mechanism.kinetic + mechanism.potential).free_symbols
    moved = {c.symbol for c in mechanism.free if {c.symbol, c.rate} & scaled}
    return {name: [c.symbol in own for c in mechanism.free] for name, own in along.items() if own & moved}


def weighed(rig: Rig) -> NDArray[np.bool_]:
    """Return for each equation whether a known weight or spring enters it, shape (n_coordinates,)."""
    known = _known_part(rig, rig.mechanism.potential)
    return np.array([derivative(known, c.symbol) != 0 for c in rig.mechanism.free], dtype=np.bool_)


def _known_part(rig: Rig, energy: sp.Expr) -> sp.Expr:
    """Return an energy where all parameters are zero; zero if it has no value there."""
    known = energy.xreplace({sp.Symbol(p.name, real=True): sp.Integer(0) for p in rig.parameters})
    return sp.Integer(0) if known.has(sp.zoo, sp.nan) else known


def gains_of_drives(rig: Rig) -> dict[str, Drive]:
    """Return the parameters to which the force of just one drive is proportional, with this drive."""
    found = {}
    for parameter in rig.parameters:
        gain = sp.Symbol(parameter.name, real=True)
        drives = [d for d in rig.mechanism.drives if gain in d.force.free_symbols | d.signal.free_symbols]
        if len(drives) != 1:
            continue
        force = drives[0].force.xreplace({sp.Symbol(drives[0].name, real=True): drives[0].signal})
        if sp.expand(force - gain * derivative(force, gain)) == 0:
            found[parameter.name] = drives[0]
    return found


def changed(start: Floats, change: Floats, is_gain: Sequence[bool] | NDArray[np.bool_]) -> Floats:
    """Return numbers after a change by a regression of residuals in units of the input; a gain of no sign stays.

    Parameters
    ----------
    start
        Numbers at which the slopes were taken, shape (n,).
    change
        Of the numbers, by the regression, shape (n,).
    is_gain
        Which of them are gains: residuals are linear in their reciprocals, and scale all forces.
    """
    own = np.asarray(is_gain, dtype=np.bool_)
    if not np.any(own):
        return start + change
    scale = 1.0 - change[own] / start[own]
    if np.any(scale <= 0.0):
        return start + np.where(own, 0.0, change)
    found = start + change / float(np.mean(scale))
    found[own] = start[own] / scale
    return found


def slopes_of_changes(start: Floats, found: Floats, is_gain: Sequence[bool] | NDArray[np.bool_]) -> Floats:
    """Return the derivatives of the change of each number by the numbers that follow from it, shape (n, n).

    Parameters
    ----------
    start, is_gain
        As for `changed`.
    found
        What it returned, shape (n,).
    """
    own = np.asarray(is_gain, dtype=np.bool_)
    slopes = np.eye(start.size)
    if np.any(own):
        scale = start[own] / found[own]
        slopes *= float(np.mean(scale))
        by_gain = -scale / found[own]
        slopes[:, own] = np.outer(found - start, by_gain / by_gain.size)
        slopes[np.ix_(own, own)] = np.diag(scale**2)
    return slopes

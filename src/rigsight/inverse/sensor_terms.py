"""Effects of a sensor along measured motions: what a small change of its reading changes in the equations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.effects import Effect
from rigsight.effects import symbols as canonical
from rigsight.effects.symbols import derivative
from rigsight.inverse.equation_fit import EquationFit
from rigsight.inverse.measured_motion import RecordMotion, along_change, shifted
from rigsight.inverse.parameter_grid import grid_of
from rigsight.inverse.term import Term, compiled

Floats = NDArray[np.float64]


def late_reading(
    name: str, late: float, motion: RecordMotion, by_motion: Floats, values: Mapping[str, float]
) -> Floats | None:
    """Return what a late reading takes from the equations, shape (n_equations, n_samples); None where it takes nothing."""
    if name not in motion.record:
        return None
    if not motion.equations.n_states:
        reading = motion.filtered(motion.record[name])
        return influence(motion, by_motion, values, name, shifted(reading, motion.record.dt, late) - reading)
    # As the smooth motion shows it: a late drive moves that motion, and noise of the reading would tell the two apart. Its rate
    # by itself: a reading that stands still beyond the end of the record would stop there.
    equations, own = motion.equations, motion.equations.sensor_names.index(name)
    at = motion.z, motion.u, equations.parameters(values, motion.record)
    shown = motion.filtered(np.array([equations.readings(*at)[own], equations.reading_slopes(*at)[own]]))
    change, rate = (shifted(row, motion.record.dt, late) - row for row in shown)
    return influence(motion, by_motion, values, name, change, rate)


def of_sensor(
    effect: Effect,
    fit: EquationFit,
    values: Mapping[str, float],
    scales: Mapping[str, float],
    by_motion: Sequence[Floats],
    points: Sequence[Mapping[str, float]] | None = None,
) -> Iterator[Term]:
    """Yield what small changes of the reading, which undo a unit of each linear parameter, change in the equations.

    At points of the nonlinear parameters, or on their grid.
    """
    name = fit.rig.acts_at(effect)
    if (
        effect.measured is None
        or effect.states
        or effect.loses_sign
        or any(name not in motion.record for motion in fit.motions)
    ):
        return
    fitted = [p for p in effect.parameters if p.fitted]
    slopes = {p: derivative(effect.measured, sp.Symbol(p.name, real=True)) for p in fitted}
    linear = [p for p in fitted if not slopes[p].has(sp.Symbol(p.name, real=True))]
    if any(slopes[p].has(sp.Symbol(other.name, real=True)) for p in linear for other in linear):
        return
    tried: list[Mapping[str, float]] = []
    changes: list[list[Floats]] = [[] for _ in fit.motions]
    for inner in grid_of(effect, linear, scales) if points is None else points:
        arguments = (canonical.reading, *(sp.Symbol(own, real=True) for own in inner))
        laws = [compiled(slopes[p], arguments) for p in linear]
        here = [np.array([-law(m.record[name], *inner.values()) for law in laws]) for m in fit.motions]
        if not all(np.all(np.any(change, axis=-1)) for change in here):
            break
        tried.append(inner)
        for own, change in zip(changes, here, strict=True):
            own.append(change)
    if not tried:
        return
    # All points at once: a filter costs as much for one of them as for all.
    columns = []
    for motion, by, own in zip(fit.motions, by_motion, changes, strict=True):
        rows = influence(motion, by, values, name, np.array(own))
        if rows is None:
            return
        columns.append(motion.thinned(rows))
    names, sided = tuple(p.name for p in linear), tuple(p.lower >= 0.0 for p in linear)
    for inner, *here in zip(tried, *columns, strict=True):
        yield Term(effect, inner, names, (1.0,) * len(linear), tuple(here), sided)


def influence(
    motion: RecordMotion,
    by_motion: Floats,
    values: Mapping[str, float],
    name: str,
    change: Floats,
    rate: Floats | None = None,
) -> Floats | None:
    """Return the change of the residual of the rig's equations by small changes of a reading, shape (.., n_samples).

    None where one of them has none.
    """
    if not np.all(np.any(change, axis=-1)):
        return None
    if not motion.equations.n_states:
        rows = np.zeros((*change.shape[:-1], len(motion.sensors), change.shape[-1]))
        rows[..., [motion.equations.sensor_names[i] for i in motion.sensors].index(name), :] = -change
        return rows
    moved = motion.with_reading_changed(name, change, values, rate)
    return None if moved is None else along_change(by_motion, moved)

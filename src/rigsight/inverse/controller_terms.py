"""Effects of a controller along measured motions: what they take from the force of its drive."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.effects import Effect
from rigsight.effects import symbols as canonical
from rigsight.identify.rig_equations import FUNCTIONS
from rigsight.inverse.controller_output import ControllerSignals, changed_output
from rigsight.inverse.drive_terms import force_per_input
from rigsight.inverse.equation_fit import EquationFit
from rigsight.inverse.measured_motion import RecordMotion
from rigsight.inverse.parameter_grid import grid_of, usual
from rigsight.inverse.term import Term, compiled
from rigsight.rigs import reading_symbol

Floats = NDArray[np.float64]

_LINEAR = 1e-6
"""Relative difference up to which twice a number counts as twice the change of the output: that of rounding."""


def of_controller(
    effect: Effect,
    fit: EquationFit,
    values: Mapping[str, float],
    scales: Mapping[str, float],
    points: Sequence[Mapping[str, float]] | None,
) -> Iterator[Term]:
    """Yield a change of a control law, at points of its numbers or on their grid; its size may be a coefficient."""
    if not fit.motions[0].equations.n_coordinates:
        return
    linear = [p for p in effect.parameters if p.fitted and p.null == 0.0]
    units = {p.name: usual(effect, p, scales) * p.starts[0] for p in linear}
    inner = list(grid_of(effect, linear, scales) if points is None else points)
    parts = [_of_each(effect, own, units, fit, values) for own in inner]
    if units and all(parts):
        for own, columns in zip(inner, parts, strict=True):
            yield Term(effect, own, tuple(units), tuple(units.values()), columns, (True,) * len(units))
        return
    for own in grid_of(effect, [], scales) if points is None else points:
        whole = _columns(effect, own, fit, values)
        if whole is not None and any(map(np.any, whole)):
            # Beside a free gain no force is given, because it would make the masses vanish: its coefficient tells its size.
            yield Term(effect, own, (), (), whole, (True,), is_given=not fit.gains, is_sized=bool(fit.gains))


def _of_each(
    effect: Effect,
    inner: Mapping[str, float],
    units: Mapping[str, float],
    fit: EquationFit,
    values: Mapping[str, float],
) -> tuple[Floats, ...]:
    """Return the columns of a unit of each number; nothing where the law is not linear in them."""
    nothing, doubled = dict.fromkeys(units, 0.0), {name: 2.0 * unit for name, unit in units.items()}
    sizes = [*({**nothing, name: unit} for name, unit in units.items()), doubled]
    columns = [_columns(effect, {**inner, **own}, fit, values) for own in sizes]
    found = [own for own in columns if own is not None]
    if not units or len(found) < len(columns):
        return ()
    *parts, both = found
    largest = max(float(np.abs(own).max(initial=0.0)) for own in both)
    stacked = tuple(np.concatenate(own) for own in zip(*parts, strict=True))
    adds_up = all(
        np.allclose(2.0 * own.sum(axis=0, keepdims=True), twice, rtol=0.0, atol=_LINEAR * largest)
        for own, twice in zip(stacked, both, strict=True)
    )
    return stacked if adds_up and largest > 0.0 else ()


def _columns(
    effect: Effect, own: Mapping[str, float], fit: EquationFit, values: Mapping[str, float]
) -> tuple[Floats, ...] | None:
    columns = tuple(m.thinned(lost_by_controller(effect, own, fit, m, values))[None] for m in fit.motions)
    return columns if all(np.all(np.isfinite(column)) for column in columns) else None


def lost_by_controller(
    effect: Effect,
    own: Mapping[str, float],
    fit: EquationFit,
    motion: RecordMotion,
    values: Mapping[str, float],
) -> Floats:
    """Return the force that an effect of a controller takes from the equations, shape (n_equations, n_samples)."""
    equations, numbers = motion.equations, {**values, **motion.record.constants}
    drive = next(drive for drive in fit.rig.mechanism.drives if drive.name == fit.rig.acts_at(effect))
    law = fit.rig.controllers[drive.name]
    own_signal = {sp.Symbol(drive.name, real=True): drive.signal} if law.in_force else {}
    parts = [part.xreplace(own_signal) for part in (law.output, law.error, law.command)]
    signals = ControllerSignals(*(_along(part, motion, numbers) for part in parts))
    changed = changed_output(effect, own, signals, motion.record.dt)
    known = {sp.Symbol(name, real=True): value for name, value in numbers.items()}
    limits = compiled(law.limited(canonical.output).xreplace(known), (canonical.output,))
    p = equations.parameters(values, motion.record)
    along = equations.slopes_along(motion.z, motion.u, p)[drive.name]
    return np.asarray(along * force_per_input(drive, numbers) * (limits(signals.output) - limits(changed)))


def _along(part: sp.Expr, motion: RecordMotion, numbers: Mapping[str, float]) -> Floats:
    """Return a part of a control law along a motion, of the readings as they are recorded, shape (n_samples,)."""
    equations, record = motion.equations, motion.record
    mechanism, n = equations.rig.mechanism, equations.n_coordinates
    signals: dict[sp.Symbol, Floats | float] = {
        sp.Symbol(name, real=True): value for name, value in numbers.items()
    }
    for i, c in enumerate(mechanism.free):
        signals |= {c.symbol: motion.z[i], c.rate: motion.z[n + i]}
    for i, c in enumerate(mechanism.prescribed):
        signals |= {c.symbol: motion.u[3 * i], c.rate: motion.u[3 * i + 1]}
    signals |= {sp.Symbol(name, real=True): record[name] for name in mechanism.inputs}
    signals |= {reading_symbol(s.name): record[s.name] for s in mechanism.sensors if s.name in record}
    read = tuple(sorted(part.free_symbols, key=str))
    if not signals.keys() >= set(read):
        return np.full(record.n_samples, np.nan)
    function = sp.lambdify(read, part, [FUNCTIONS, "numpy"])
    return np.array(
        np.broadcast_to(function(*(signals[s] for s in read)), record.n_samples), dtype=np.float64
    )

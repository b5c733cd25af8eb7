"""Effects of a controller along measured motions: what they take from the force of its drive."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigsight.effects import Effect
from rigsight.inverse.controller_output import ControllerSignals, changed_output, limits_of
from rigsight.inverse.drive_terms import force_per_input
from rigsight.inverse.measured_motion import RecordMotion
from rigsight.inverse.parameter_grid import grid_of, usual
from rigsight.inverse.term import Term

Floats = NDArray[np.float64]

_LINEAR = 1e-6
"""Relative difference up to which twice a number counts as twice the change of the output: that of rounding."""


@dataclass(frozen=True, eq=False)
class ControlledMotion:
    """A controller along a record."""

    motion: RecordMotion
    signals: ControllerSignals  # of the recorded inputs and readings
    limits: Callable[[Floats], Floats]  # signal of the drive for an output
    per_signal: Floats  # what a unit of this signal adds to the equations, shape (n_equations, n_samples)

    def lost(self, effect: Effect, own: Mapping[str, float]) -> Floats:
        """Return the force that an effect takes from the equations, shape (n_equations, n_samples)."""
        changed = changed_output(effect, own, self.signals, self.motion.record.dt)
        return np.asarray(self.per_signal * (self.limits(self.signals.output) - self.limits(changed)))


def controlled_motion(motion: RecordMotion, drive_name: str, values: Mapping[str, float]) -> ControlledMotion:
    """Return the controller of a drive along a motion.

    Parameters
    ----------
    motion
        Of the rig along a record.
    drive_name
        A drive that has a controller.
    values
        Constants and parameters of the rig by name.
    """
    equations, numbers = motion.equations, {**values, **motion.record.constants}
    drive = next(drive for drive in equations.rig.mechanism.drives if drive.name == drive_name)
    law = equations.rig.controllers[drive_name]
    signals = ControllerSignals(
        *(motion.along(part, values) for part in (law.output, law.error, law.command))
    )
    limits = limits_of(law, numbers)
    along = equations.slopes_along(motion.z, motion.u, equations.parameters(values, motion.record))
    return ControlledMotion(motion, signals, limits, along[drive_name] * force_per_input(drive, numbers))


def of_controller(
    effect: Effect,
    moved: Sequence[ControlledMotion],
    scales: Mapping[str, float],
    points: Sequence[Mapping[str, float]] | None,
    beside_free_gain: bool,
) -> Iterator[Term]:
    """Yield a change of a control law, at points of its numbers or on their grid; its size may be a coefficient."""
    linear = [p for p in effect.parameters if p.fitted and p.null == 0.0]
    units = {p.name: usual(effect, p, scales) * p.starts[0] for p in linear}
    inner = list(grid_of(effect, linear, scales) if points is None else points)
    parts = [_of_each(effect, own, units, moved) for own in inner] if units else []
    if parts and all(parts):
        for own, columns in zip(inner, parts, strict=True):
            yield Term(effect, own, tuple(units), tuple(units.values()), columns, (True,) * len(units))
        return
    for own in grid_of(effect, [], scales) if points is None else points:
        whole = _columns(effect, own, moved)
        if whole is not None and any(map(np.any, whole)):
            # Beside a free gain no force is given, because it would make the masses vanish: its coefficient tells its size.
            yield Term(
                effect, own, (), (), whole, (True,), is_given=not beside_free_gain, is_sized=beside_free_gain
            )


def _of_each(
    effect: Effect,
    inner: Mapping[str, float],
    units: Mapping[str, float],
    moved: Sequence[ControlledMotion],
) -> tuple[Floats, ...]:
    """Return the columns of a unit of each number; nothing where the law is not linear in them."""
    nothing, doubled = dict.fromkeys(units, 0.0), {name: 2.0 * unit for name, unit in units.items()}
    sizes = [*({**nothing, name: unit} for name, unit in units.items()), doubled]
    columns = [_columns(effect, {**inner, **own}, moved) for own in sizes]
    found = [own for own in columns if own is not None]
    if len(found) < len(columns):
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
    effect: Effect, own: Mapping[str, float], moved: Sequence[ControlledMotion]
) -> tuple[Floats, ...] | None:
    with np.errstate(all="ignore"):
        columns = tuple(along.motion.thinned(along.lost(effect, own))[None] for along in moved)
    return columns if all(np.all(np.isfinite(column)) for column in columns) else None

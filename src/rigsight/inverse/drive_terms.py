"""Effects of a drive along measured motions.

Where a controller makes the motion, errors of laws are in the input: what the drive adds to it is a function of the force that
the motion requires. Where nothing reacts to the motion, what the drive loses is a function of the logged input.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.effects import Effect
from rigsight.effects import symbols as canonical
from rigsight.effects.symbols import derivative
from rigsight.inverse.equation_fit import EquationFit
from rigsight.inverse.measured_motion import RecordMotion, along_change, nearest_force
from rigsight.inverse.parameter_grid import grid_of, usual
from rigsight.inverse.term import Term, compiled
from rigsight.rigs import Drive, evaluated

Floats = NDArray[np.float64]

_SMALL_PART = 0.05
"""Parameters of a drive effect in characteristic sizes: small, and above the noise of the force."""


def late_drive(
    name: str, late: float, motion: RecordMotion, by_motion: Floats, values: Mapping[str, float]
) -> Floats | None:
    """Return what a late drive takes from the equations, as `late_reading`: what is required of it now was commanded earlier."""
    if not motion.equations.n_coordinates:
        return None
    along, more = _through_drive(name, motion, values, along_change(by_motion, motion.ahead(late)))
    return np.asarray(along * more)


def of_required(
    effect: Effect, fit: EquationFit, values: Mapping[str, float], scales: Mapping[str, float]
) -> Iterator[Term]:
    """Yield what the input must give beyond what reaches the motion, a function of what the motion requires.

    To first order in small parameters. With large ones nearly all of the required force is lost, and this force holds the
    residual that it would explain.
    """
    if not all(p.null == 0.0 for p in effect.parameters):
        return
    found = _driving(effect, fit, values)
    if found is None or effect.reads(canonical.v):
        return
    drive, _, _ = found
    small = {p.name: _SMALL_PART * usual(effect, p, scales) for p in effect.parameters}
    columns = [
        motion.thinned(lost(drive, effect, small, fit, motion, values))[None] for motion in fit.motions
    ]
    if not all(np.all(np.isfinite(column)) for column in columns):
        return
    if len(small) == 1:
        yield Term(effect, {}, tuple(small), tuple(small.values()), tuple(columns), (True,))
    else:
        yield Term(effect, small, (), (), tuple(columns), (True,))


def of_given(
    effect: Effect,
    fit: EquationFit,
    values: Mapping[str, float],
    scales: Mapping[str, float],
    points: Sequence[Mapping[str, float]] | None,
) -> Iterator[Term]:
    """Yield the force that a drive loses of its input, at points of its parameters or on their grid.

    It is given, not fitted: a limit that loses nearly all of the input would else explain all that is left of it.
    """
    found = _driving(effect, fit, values)
    if found is None:
        return
    drive, per_input, reaching = found
    entering = [_entering(drive, motion, values) for motion in fit.motions]
    for own in grid_of(effect, [], scales) if points is None else points:
        reached = [reaching(given, speed, *own.values()) for _, given, speed in entering]
        columns = [
            motion.thinned(along * gain * (given - through))[None]
            for motion, gain, (along, given, _), through in zip(
                fit.motions, per_input, entering, reached, strict=True
            )
        ]
        is_finite = all(np.all(np.isfinite(column)) for column in columns)
        if is_finite and any(map(np.any, reached)) and any(map(np.any, columns)):
            yield Term(effect, own, (), (), tuple(columns), (False,), is_given=True)


def _entering(
    drive: Drive, motion: RecordMotion, values: Mapping[str, float]
) -> tuple[Floats, Floats, Floats]:
    """Return how a drive enters the equations, shape (n_equations, n_samples), its signal, and the speed of its shaft."""
    equations, p = motion.equations, motion.equations.parameters(values, motion.record)
    along = equations.slopes_along(motion.z, motion.u, p)[drive.name]
    given = equations.at_places(motion.z, motion.u, p)[f"signal@{drive.name}"]
    return along, given, motion.along(equations.rig.mechanism.rate(drive.along), values)


def _driving(
    effect: Effect, fit: EquationFit, values: Mapping[str, float]
) -> tuple[Drive, list[float], Callable[..., Floats]] | None:
    """Return the drive of an effect, its force per input in each record, and what the effect lets through of an input."""
    drive = next(drive for drive in fit.rig.mechanism.drives if drive.name == fit.rig.acts_at(effect))
    per_input = [force_per_input(drive, {**values, **motion.record.constants}) for motion in fit.motions]
    reaching = _reaching(effect)
    if reaching is None or not fit.motions[0].equations.n_coordinates or not all(per_input):
        return None
    return drive, per_input, reaching


def _reaching(effect: Effect) -> Callable[..., Floats] | None:
    """Return what a drive effect lets through as a function of its input, its speed and its parameters; None if it reads more."""
    own = [sp.Symbol(p.name, real=True) for p in effect.parameters]
    if effect.drive is None or not effect.drive.free_symbols <= {canonical.u, canonical.v, *own}:
        return None
    return compiled(effect.drive, (canonical.u, canonical.v, *own))


def lost(
    drive: Drive,
    effect: Effect,
    own: Mapping[str, float],
    fit: EquationFit,
    motion: RecordMotion,
    values: Mapping[str, float],
) -> Floats:
    """Return the force that a drive effect takes from what the motion requires, shape (n_equations, n_samples)."""
    gain, reaching = force_per_input(drive, {**values, **motion.record.constants}), _reaching(effect)
    assert reaching is not None
    along, given, speed = _entering(drive, motion, values)
    # Of a position drive that is another goal, and not another force.
    _, missing = _through_drive(drive.name, motion, values, fit.residual(motion, values))
    needed = motion.filtered(missing / gain + given)
    return np.asarray(along * gain * (needed - reaching(needed, speed, *own.values())))


def force_per_input(drive: Drive, numbers: Mapping[str, float]) -> float:
    """Return the force of a drive for a unit of its signal; zero where it depends on the motion."""
    gain = derivative(drive.force, sp.Symbol(drive.name, real=True))
    known = {symbol.name for symbol in gain.free_symbols} <= numbers.keys()
    return float(evaluated(gain, numbers)) if known else 0.0


def _through_drive(
    name: str, motion: RecordMotion, values: Mapping[str, float], rows: Floats
) -> tuple[Floats, Floats]:
    """Return how a drive enters the equations, shape (n_equations, n_samples), and the force of the drive nearest to rows."""
    p = motion.equations.parameters(values, motion.record)
    along = motion.equations.slopes_along(motion.z, motion.u, p)[name]
    return along, nearest_force(along, rows)

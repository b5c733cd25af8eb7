"""Which parameters must fits hold: one of those that a free motion leaves open, and the spring that an axis is given without?

If no input moves and no known constant is involved, all inertias, stiffnesses, dampings and forces can be multiplied by one
factor without changing the motion. One of them is then held, so that the fit does not drift along that direction.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import null_space

from rigsight.effects import Effect
from rigsight.errors import InputError, SimulationError
from rigsight.identify.fit.grey_box import GreyBoxFit
from rigsight.identify.fit.windows import cut, window_length
from rigsight.identify.information import listed
from rigsight.identify.linear_view import longest_free_run
from rigsight.identify.rig_equations import equations_of
from rigsight.identify.start.linear_start import linear_start
from rigsight.identify.start.scales import characteristic_scales
from rigsight.parameters import Parameter
from rigsight.records.record import Floats, Record
from rigsight.records.signals import is_constant
from rigsight.rigs import Rig, evaluated
from rigsight.rigs.reading.dimensions import UnitError, dimension
from rigsight.simulate import compose
from rigsight.units import behind

_DRAWS = 3
"""Least number of random points at which the equations are compared; different expressions do not agree there by chance."""
_SAME = 1e-9
"""Relative difference of rates that counts as rounding error."""
_STEP = 1e-5
"""Relative change of a parameter for the slopes of rates, which are then as accurate as its square, and what counts as none."""
_MASS = "[mass]"
_MOST_TURNS = 1.0
"""Range of an angle up to which a spring may be there although none was given (an assumption): wires and flat spirals that are
wound further are rare, and their users give a stiffness."""
_CLEARLY = 5.0
"""Standard errors from zero at which the stiffness is significant; large, because the residual is not white."""
_LEAVES = 0.9
"""Largest error with a spring, relative to that without, that contradicts a given stiffness of zero: other missing effects seem
like a weak spring, and lower the error less."""


@dataclass(frozen=True)
class OpenFactor:
    """Parameters that records determine only up to a common factor, and the one that is held."""

    names: tuple[str, ...]  # all of them, including the one that is held
    held: str  # name of the one that is held
    value: float  # its value [SI]
    unit: str
    is_given: bool  # whether the value was given; otherwise it is the default of the rig, or one

    @property
    def sentence(self) -> str:
        """The finding in words."""
        source = "as given" if self.is_given else "because no value was given"
        return (
            f"No input moves in the records that are fitted: they determine {listed(self.names)}, and every force of an effect, "
            f"only up to a common factor. {self.held} = {self.value:g}{behind(self.unit)} is held, {source}; all others are "
            f"proportional to its true value."
        )


def open_factor(
    rig: Rig, records: Sequence[Record], constants: Mapping[str, float], given: Mapping[str, float]
) -> OpenFactor | None:
    """Return the parameters that records of a free motion determine only up to a common factor, None if the factor is determined.

    Of those with a given value one is held.
    """
    if not rig.is_driven or any(not is_constant(r[s.name]) for r in records for s in rig.inputs):
        return None
    powers = {p.name: power for p in rig.parameters if (power := _power_of_mass(p))}
    if not powers or not all(_moves_as_before(rig, record, constants, powers, records) for record in records):
        return None
    inertias = {str(symbol) for symbol in rig.mechanism.kinetic.free_symbols}
    names = sorted(powers, key=lambda name: name not in inertias)
    known = [name for name in names if given.get(name)]
    # An inertia that only counts in a sum with another one leaves the factor to that one.
    left_open = _left_open(rig, records, constants)
    first = min(known or names, key=left_open.__getitem__)
    held = next(p for p in rig.parameters if p.name == first)
    usual = 1.0 if held.default is None else held.default
    value = given[held.name] if known else float(np.clip(usual, held.lower, held.upper))
    return OpenFactor(
        tuple(p.name for p in rig.parameters if p.name in powers), held.name, value, held.unit, bool(known)
    )


def _power_of_mass(parameter: Parameter) -> float:
    """Return the power of the unit of mass in a parameter's unit."""
    try:
        return float(dimension(parameter.unit).get(_MASS, 0))
    except UnitError:
        return 0.0


def _moves_as_before(
    rig: Rig,
    record: Record,
    constants: Mapping[str, float],
    powers: Mapping[str, float],
    records: Sequence[Record],
) -> bool:
    """Return True if rates and readings do not change when the parameters are multiplied by a common factor."""
    motion = _Drawn(rig, record, constants, records)
    grown = {name: value * 2.0 ** powers.get(name, 0.0) for name, value in motion.values.items()}
    return bool(np.allclose(motion.moved(motion.values), motion.moved(grown), rtol=_SAME, atol=0.0))


def _left_open(rig: Rig, records: Sequence[Record], constants: Mapping[str, float]) -> dict[str, int]:
    """Return for each parameter how many others the motion of the records leaves open when it is held."""
    names, slopes = [p.name for p in rig.parameters], []
    for record in records:
        motion = _Drawn(rig, record, constants, records)
        above, below = (
            np.array([motion.moved({**motion.values, name: factor * motion.values[name]}) for name in names])
            for factor in (1.0 + _STEP, 1.0 - _STEP)
        )
        slopes.append((above - below).reshape(len(names), -1).T / (2.0 * _STEP))
    without = null_space(np.vstack(slopes), rcond=_STEP)
    return {
        name: int(np.count_nonzero(np.linalg.norm(without @ null_space(without[[i]]), axis=1) > _STEP))
        for i, name in enumerate(names)
    }


class _Drawn:
    """A rig with random numbers at random points of its motion."""

    def __init__(
        self, rig: Rig, record: Record, constants: Mapping[str, float], records: Sequence[Record]
    ) -> None:
        self._equations, rng = equations_of(rig), np.random.default_rng(0)
        self.values = {p.name: float(rng.uniform(0.2, 0.8)) for p in rig.parameters}
        self._record, self._constants = record, constants
        draws = max(_DRAWS, len(self.values))
        self._z = rng.uniform(0.2, 0.8, (self._equations.n_states, draws))
        self._u = np.zeros((3 * len(rig.inputs), draws))
        if rig.inputs and not _rest_makes_up(rig, records):
            self._u[0::3] = [[record[signal.name][0]] for signal in rig.inputs]

    def moved(self, values: Mapping[str, float]) -> Floats:
        """Return rates and readings with other numbers, one below the other, shape (n, n_points)."""
        p = self._equations.parameters({**self._constants, **values}, self._record)
        rates = self._equations.rates(self._z, self._u, p)
        return np.concatenate([rates, self._equations.readings(self._z, self._u, p)])


def _rest_makes_up(rig: Rig, records: Sequence[Record]) -> bool:
    """Return True if a free rest position or constant force can replace the constant input, equal in all records."""
    if not rig.has_one_motion:
        return False
    free = {parameter.name for parameter in rig.parameters}
    moved = {str(symbol) for symbol in rig.motion.rest.free_symbols | rig.motion.bias.free_symbols}
    levels = {round(float(record[rig.inputs[0].name][0]), 12) for record in records}
    return bool(free & moved) and len(levels) == 1


def weighed_spring(
    rig: Rig,
    records: Sequence[Record],
    constants: Mapping[str, float],
    given: Mapping[str, float],
    modelled: Sequence[Effect],
    stiffness: str,
    held: Mapping[str, float],
) -> tuple[bool, str] | None:
    """Return whether the records of an axis show an absent spring, and a note; None if they cannot be fitted.

    A stiffness of zero that is given states that there is no spring. It is fitted to windows of the records, beside the same fit
    with zero: if it differs from zero beyond its error and lowers the error, the records contradict the statement. A shaft that
    turns by more than a turn has none: what seems to be one is another force.
    """
    turns = [
        float(np.ptp(r[s.name])) / math.tau
        for r in records
        for s in rig.outputs
        if s.name in r and s.unit == "rad"
    ]
    if (most := max(turns, default=0.0)) > _MOST_TURNS:
        return (
            False,
            f"{stiffness} = 0 is held in all fits: a shaft that turns by {most:.3g} turns has no spring.",
        )
    known = {**held, **{symbol.name: 0.0 for symbol in rig.motion.rest.free_symbols}}
    try:
        start = {**constants, **linear_start(rig, records, constants, known)}
    except InputError:
        return None
    # An effect whose numbers are still to be fitted has none to start from.
    names = compose(rig, modelled).parameter_name
    modelled = [
        effect for effect in modelled if all(names(effect, p.name) in given for p in effect.parameters)
    ]
    start = {**start, **given, stiffness: start[stiffness]} if modelled else start
    motion = rig.motion
    assert motion.inertia is not None
    equation = [evaluated(part, start) for part in (motion.inertia, motion.damping, motion.stiffness)]
    limit = longest_free_run(np.roots(equation).astype(np.complex128), records)
    length = min(window_length(rig, records), limit or np.inf)
    windows, structure = cut(records, length), compose(rig, modelled)
    sizes = {
        s.name: max(float(np.std(np.concatenate([r[s.name] for r in records]))), 1e-300) for s in rig.outputs
    }
    problem = GreyBoxFit(structure, windows, characteristic_scales(rig, records, start), sizes)
    free = [p.name for p in rig.parameters if p.name not in known]
    others = [name for name in free if name != stiffness]
    try:
        without = problem.fit({**start, stiffness: 0.0}, others)
        fits = [problem.fit({**found, **known}, free) for found in (start, without.values)]
        sprung = min(fits, key=lambda fit: fit.cost)
        again = problem.fit({**sprung.values, stiffness: 0.0}, others)
    except SimulationError:
        return None
    without = min(without, again, key=lambda fit: fit.cost)
    value, std = sprung.values[stiffness], sprung.standard_errors[stiffness]
    unit = next(p.unit for p in rig.parameters if p.name == stiffness)
    share = math.sqrt(sprung.cost / max(without.cost, 1e-300))
    found = abs(value) > _CLEARLY * std and share < _LEAVES
    done = (
        f"fits estimate {stiffness}, the given simulation keeps 0"
        if found
        else f"{stiffness} = 0 is held in all fits"
    )
    note = (
        f"{stiffness} = 0 stands for no spring. Estimated from windows of {length:.3g} s, "
        f"{stiffness} is {value:.3g} +/- {std:.2g}{behind(unit)} "
        f"and leaves {share:.2f} times the error without a spring: {done}."
    )
    return found, note

"""Parameters that a free motion leaves undetermined: inertias and forces are known only up to a common factor.

If no input moves and no known constant is involved, all inertias, stiffnesses, dampings and forces can be multiplied by one
factor without changing the motion. One of them is then held, so that the fit does not drift along that direction.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rigsight.identify.rig_equations import equations_of
from rigsight.identify.undetermined import listed
from rigsight.parameters import Parameter
from rigsight.records.record import Record
from rigsight.records.signals import is_constant
from rigsight.rigs import Rig
from rigsight.rigs.reading.dimensions import UnitError, dimension

_DRAWS = 3
"""Number of random points at which the equations are compared; different expressions do not agree there by chance."""
_SAME = 1e-9
"""Relative difference of rates that counts as rounding error."""
_MASS = "[mass]"


@dataclass(frozen=True)
class OpenFactor:
    """Parameters that records determine only up to a common factor, and the one that is held.

    Attributes
    ----------
    names
        All of them, including the one that is held.
    held
        Name of the one that is held.
    value
        Its value [SI].
    unit
        Its unit.
    is_given
        Whether the value was given; otherwise it is the default of the rig, or one.
    """

    names: tuple[str, ...]
    held: str
    value: float
    unit: str
    is_given: bool

    @property
    def sentence(self) -> str:
        """The finding in words."""
        source = "as given" if self.is_given else "because no value was given"
        return (
            f"No input moves in the records that are fitted: they determine {listed(self.names)}, and every force of an effect, "
            f"only up to a common factor. {self.held} = {self.value:g} {self.unit} is held, {source}; all others are "
            f"proportional to its true value."
        )


def open_factor(
    rig: Rig, records: Sequence[Record], constants: Mapping[str, float], given: Mapping[str, float]
) -> OpenFactor | None:
    """Return the parameters that records of a free motion determine only up to a common factor, None if the factor is determined.

    Parameters
    ----------
    rig
        The rig.
    records
        The fitted records.
    constants
        The rig's constants by name.
    given
        Parameters with a known or assumed value; one of them is held if it is among the undetermined ones.
    """
    if not rig.is_driven or any(not is_constant(r[s.name]) for r in records for s in rig.inputs):
        return None
    powers = {p.name: power for p in rig.parameters if (power := _power_of_mass(p))}
    if not powers or not all(_moves_as_before(rig, record, constants, powers, records) for record in records):
        return None
    inertias = {str(symbol) for symbol in rig.mechanism.kinetic.free_symbols}
    names = sorted(powers, key=lambda name: name not in inertias)
    known = [name for name in names if given.get(name)]
    held = next(p for p in rig.parameters if p.name == (known or names)[0])
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
    equations, rng = equations_of(rig), np.random.default_rng(0)
    drawn = {p.name: float(rng.uniform(0.2, 0.8)) for p in rig.parameters}
    grown = {name: value * 2.0 ** powers.get(name, 0.0) for name, value in drawn.items()}
    z = rng.uniform(0.2, 0.8, (equations.n_states, _DRAWS))
    u = np.zeros((3 * len(rig.inputs), _DRAWS))
    if rig.inputs and not _rest_makes_up(rig, records):
        u[0::3] = [[record[signal.name][0]] for signal in rig.inputs]
    found = []
    for values in (drawn, grown):
        p = equations.parameters({**constants, **values}, record)
        found.append(np.concatenate([equations.rates(z, u, p), equations.readings(z, u, p)]))
    return bool(np.allclose(found[0], found[1], rtol=_SAME, atol=0.0))


def _rest_makes_up(rig: Rig, records: Sequence[Record]) -> bool:
    """Return True if a free rest position or constant force can replace the constant input, equal in all records."""
    if not rig.has_one_motion:
        return False
    free = {parameter.name for parameter in rig.parameters}
    moved = {str(symbol) for symbol in rig.motion.rest.free_symbols | rig.motion.bias.free_symbols}
    levels = {round(float(record[rig.inputs[0].name][0]), 12) for record in records}
    return bool(free & moved) and len(levels) == 1

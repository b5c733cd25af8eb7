"""What a rig is: signals, constants, parameters and the equations into which effects are placed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import sympy as sp

from rigsight.effects.effect import Effect, Place
from rigsight.parameters import Parameter
from rigsight.units import unit_text


@dataclass(frozen=True)
class Signal:
    """A recorded quantity: its name in equations and files, its unit, and what it is."""

    name: str
    unit: str
    description: str


@dataclass(frozen=True)
class Motion:
    """The degree of freedom on which dynamics effects act.

    ``inertia * x'' = drive_gain * u + bias - spring(x - rest) - damping * x' - effects``; without an inertia the motion is
    prescribed and the right-hand side's torques are the output.

    Attributes
    ----------
    displacement, velocity
        Symbols of the state (or of the prescribed motion).
    stiffness, damping, drive_gain, rest, bias
        Expressions of the rig's parameters and constants.
    inertia
        Expression, or None where the motion is prescribed.
    """

    displacement: sp.Symbol
    velocity: sp.Symbol
    stiffness: sp.Expr
    damping: sp.Expr
    drive_gain: sp.Expr
    rest: sp.Expr
    bias: sp.Expr
    inertia: sp.Expr | None


@dataclass(frozen=True)
class Lateral:
    """The lateral displacement that rolling makes of the motion: ``y' = gain * creepage``.

    Attributes
    ----------
    symbol
        Symbol of the state.
    displacement
        The state from its rest.
    creepage
        What drives it: the motion less what the displacement itself turns back.
    gain
        Rate per creepage.
    feedback
        Creepage that a unit of displacement takes away.
    """

    symbol: sp.Symbol
    displacement: sp.Expr
    creepage: sp.Expr
    gain: sp.Expr
    feedback: sp.Expr

    @property
    def static_gain(self) -> sp.Expr:
        """Displacement from rest at which a unit of the motion is all turned back."""
        return 1 / self.feedback


@dataclass(frozen=True)
class Rig:
    """A rig as a declaration.

    Attributes
    ----------
    name
        Name in campaigns (``rig.model``).
    summary
        One plain sentence.
    inputs, outputs
        Recorded signals; all inputs and the first output are required in a record.
    constants
        Known numbers of the rig; one with a default may be left out of a campaign.
    parameters
        Numbers to identify, in the order of the equations.
    alternative_parameters
        Accepted in a campaign instead of one of `parameters`, see `from_alternative`.
    motion
        The degree of freedom on which dynamics effects act.
    lateral
        The lateral displacement that the motion drives, if the rig has one.
    units
        Unit of each base quantity: x, force, input, time, and others that its dimensions use.
    dynamics_name
        How a result calls `Place.DYNAMICS` on this rig.
    """

    name: str
    summary: str
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    constants: tuple[Parameter, ...]
    parameters: tuple[Parameter, ...]
    motion: Motion
    units: dict[str, str]
    alternative_parameters: tuple[Parameter, ...] = ()
    lateral: Lateral | None = None
    dynamics_name: str = "dynamics"

    @property
    def is_driven(self) -> bool:
        """True if an input moves a mass, False if the motion is prescribed."""
        return self.motion.inertia is not None

    @property
    def downstream(self) -> dict[sp.Symbol, sp.Expr]:
        """Further states driven by the motion, with their rates without effects."""
        return (
            {} if self.lateral is None else {self.lateral.symbol: self.lateral.gain * self.lateral.creepage}
        )

    @property
    def downstream_parameters(self) -> frozenset[str]:
        """Names of the parameters of which the motion knows nothing."""
        motion = self.motion
        parts = (motion.stiffness, motion.damping, motion.rest, motion.bias, motion.inertia)
        own = {symbol.name for part in parts if part is not None for symbol in part.free_symbols}
        return frozenset(parameter.name for parameter in self.parameters if parameter.name not in own)

    def with_unit(self, parameter: Parameter) -> Parameter:
        """Return the parameter with its unit on this rig.

        The base quantity "drive" is a force of the size of the drive's, where "force" is one of the size of the spring's.
        """
        units = {**self.units, "drive": self.units["force"]}
        return replace(parameter, unit=unit_text(parameter.dimension, units))

    def place_name(self, place: Place) -> str:
        """Return how results call a place on this rig."""
        return self.dynamics_name if place is Place.DYNAMICS else place.value

    def offers(self, effect: Effect) -> bool:
        """Return True if the effect makes sense on this rig."""
        if effect.place is Place.LATERAL_DYNAMICS:
            return self.lateral is not None
        if self.is_driven:
            return True
        return effect.place is Place.DYNAMICS and not effect.needs_inertia

"""What is a mechanism made of? Coordinates, joints, drives, sensors, states, and one motion with what follows it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import sympy as sp

from rigsight.effects.symbols import derivative


@dataclass(frozen=True)
class Coordinate:
    """A degree of freedom, or a motion that an input prescribes."""

    # The coordinate and its time derivative.
    symbol: sp.Symbol
    rate: sp.Symbol
    unit: str  # its SI unit
    prescribed_by: str | None = None  # name of the input that it follows; None for a degree of freedom
    about: str = ""  # what it is

    @property
    def name(self) -> str:
        """Its name."""
        return str(self.symbol.name)


@dataclass(frozen=True)
class Joint:
    """A place where effects of the dynamics act: a motion, and what resists it.

    ``resisting force = stiffness * (motion - rest) + damping * d(motion) + force``
    """

    name: str  # its name
    motion: sp.Expr  # expression of the coordinates
    # Expressions of parameters and constants.
    stiffness: sp.Expr = sp.S.Zero
    damping: sp.Expr = sp.S.Zero
    rest: sp.Expr = sp.S.Zero
    force: sp.Expr = sp.S.Zero  # what else resists: constant, or a known law
    inertia: sp.Expr | None = None  # inertia that moves with it; None for what the kinetic energy gives
    # Whether its damper is squeezed with the spring and not by the motion: behind a play, both act in contact
    # alone.
    damps_spring: bool = False
    about: str = ""  # what it is


@dataclass(frozen=True)
class Drive:
    """A place where effects of the actuator act: on the value of a signal, from which a generalized force follows."""

    name: str  # its name, and that of its signal behind the effects
    signal: sp.Expr  # what it is told: an input, or a control law
    force: sp.Expr  # expression of its own name and others
    along: sp.Expr  # expression of the coordinates along which the force acts
    about: str = ""  # what it is


@dataclass(frozen=True)
class Sensor:
    """A place where effects of the sensor act, and a column of a record."""

    name: str  # also that of its reading in control laws
    reads: sp.Expr  # what an ideal one shows
    unit: str  # SI unit
    about: str = ""  # what it is
    # Angular frequency beyond which its frequency response is not compared [rad/s]; a habit of those who publish it, so rigs that
    # differ in nothing else are the same.
    upper_cut: float = field(default=math.inf, compare=False)


@dataclass(frozen=True)
class RateState:
    """A first-order state: a filter, an integrator, a pressure."""

    symbol: sp.Symbol  # the state
    rate: sp.Expr  # its time derivative
    unit: str  # SI unit
    about: str = ""  # what it is

    @property
    def name(self) -> str:
        """Its name."""
        return str(self.symbol.name)


def acceleration(coordinate: Coordinate) -> sp.Symbol:
    """Return the symbol of the second time derivative of a prescribed coordinate."""
    return sp.Symbol(f"dd({coordinate.name})", real=True)


def applied_symbol(index: int) -> sp.Symbol:
    """Return the symbol of what drives and joints put on a degree of freedom, where simulated bodies read it."""
    return sp.Symbol(f"applied {index}", real=True)


READING = "reading of "


def reading_symbol(name: str) -> sp.Symbol:
    """Return the symbol of what a sensor shows, where a control law reads it."""
    return sp.Symbol(f"{READING}{name}", real=True)


def force_symbol(name: str) -> sp.Symbol:
    """Return the symbol of all that a joint resists with, where a sensor reads it."""
    return sp.Symbol(f"force({name})", real=True)


@dataclass(frozen=True)
class Signal:
    """A recorded quantity: its name in equations and files, its unit, and what it is."""

    name: str
    unit: str
    description: str


@dataclass(frozen=True)
class Motion:
    """The single degree of freedom of a rig with one joint, or the motion that is prescribed to it.

    ``inertia * x'' = drive_gain * u + bias - spring(x - rest) - damping * x' - effects``; without an inertia the motion is
    prescribed and the right-hand side's torques are the output.
    """

    # Symbols of the state (or of the prescribed motion).
    displacement: sp.Symbol
    velocity: sp.Symbol
    # Expressions of the rig's parameters and constants.
    stiffness: sp.Expr
    damping: sp.Expr
    drive_gain: sp.Expr
    rest: sp.Expr
    bias: sp.Expr
    inertia: sp.Expr | None  # expression, or None where the motion is prescribed


@dataclass(frozen=True)
class Follower:
    """A first-order state that follows the motion: ``y' = gain * creepage``."""

    symbol: sp.Symbol  # symbol of the state
    displacement: sp.Expr  # the state from its rest
    creepage: sp.Expr  # what drives it: the motion less what the displacement itself turns back
    gain: sp.Expr  # rate per creepage
    feedback: sp.Expr  # creepage that a unit of displacement takes away

    @property
    def static_gain(self) -> sp.Expr:
        """Displacement from rest at which a unit of the motion is all turned back."""
        return 1 / self.feedback


def follower_of(state: RateState, motion: Coordinate) -> Follower | None:
    """Return how a state follows the motion; None where its rate is not a sum of the two, each with a factor."""
    gain, back = derivative(state.rate, motion.symbol), derivative(state.rate, state.symbol)
    moving = {motion.symbol, motion.rate, state.symbol}
    if gain == 0 or back == 0 or (gain.free_symbols | back.free_symbols) & moving:
        return None
    creepage, feedback = sp.expand(state.rate / gain), -back / gain
    displacement = sp.simplify((motion.symbol - creepage) / feedback)
    return Follower(state.symbol, displacement, motion.symbol - displacement * feedback, gain, feedback)

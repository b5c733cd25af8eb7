"""What an effect is: one symbolic declaration from which every other view is derived."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property

import sympy as sp

from rigsight.effects import symbols
from rigsight.parameters import Parameter


class Place(StrEnum):
    """Where in the signal path an effect acts."""

    ACTUATOR = "actuator"
    CONTROLLER = "controller"
    DYNAMICS = "dynamics"
    DISTURBANCE = "disturbance"
    LATERAL_DYNAMICS = "lateral_dynamics"
    SENSOR = "sensor"


@dataclass(frozen=True)
class Part:
    """A part of a rig that an effect can replace: a field of `Effect`."""

    places: tuple[Place, ...]  # at which the part is
    text: str  # an equation of the part in words, with ``{}`` for its new expression
    reads: tuple[str, ...] = ()  # signals that the expression may hold, names of `rigsight.effects.symbols`
    # The same for the rates of the effect's states; None if it can have none.
    states_read: tuple[str, ...] | None = None


_MOTION = ("x", "v", "t", "k", "m", "position", "acceleration")
_LOADED = (*_MOTION, "load", "driven", "damped")
_SPRING = (*_MOTION, "spring_torque", "deflection", "deflection_rate")
_DRIVE = ("u", "v", "t")
_CONTROL = ("output", "error", "command", "t")
_CONTACT = ("creepage", "creep_gain", "lateral_displacement", "lateral_feedback")
_READING = ("reading", "t")

PARTS = {
    "torque": Part((Place.DYNAMICS, Place.DISTURBANCE), "resisting torque = {}", _LOADED, _LOADED),
    "spring": Part((Place.DYNAMICS,), "spring torque = {}", _SPRING, _SPRING),
    "deflection": Part((Place.DYNAMICS,), "deflection of the spring = {}", ("x",), ("x", "v")),
    "drive": Part((Place.ACTUATOR,), "drive = {}", _DRIVE, _DRIVE),
    "delay": Part((Place.ACTUATOR,), "drive = u(t - {})"),
    "control": Part((Place.CONTROLLER,), "controller output = {}", _CONTROL, _CONTROL),
    "command": Part((Place.CONTROLLER,), "command = {}", ("command", "t"), ("command", "t")),
    "command_delay": Part((Place.CONTROLLER,), "command = command(t - {})"),
    "lateral": Part((Place.LATERAL_DYNAMICS,), "lateral rate = {}", _CONTACT),
    "measured": Part((Place.SENSOR,), "measured = {}", _READING, _READING),
    "reading_delay": Part((Place.SENSOR,), "measured = reading(t - {})"),
}
"""What an effect can do at which place, by the name of the field that declares it."""


class Family(StrEnum):
    """What kind of cause an effect is: records that show the family often leave open which of its forms it is."""

    DRY_FRICTION = "dry_friction"
    MEMORY = "memory"
    VISCOELASTICITY = "viscoelasticity"
    SPRING_LAW = "spring_law"
    GRAVITY = "gravity"
    DAMPING_LAW = "damping_law"
    PLAY_AND_STOPS = "play_and_stops"
    DELAY_OR_LAG = "delay_or_lag"
    DRIVE_LIMIT = "drive_limit"
    TONE_OR_RIPPLE = "tone_or_ripple"
    RESONANCE = "resonance"
    INERTIA = "inertia"
    CONTACT = "contact"
    SENSOR = "sensor"
    CONTROLLER = "controller"
    OWN = "own"


class Energy(StrEnum):
    """What an effect does to the mechanical energy over a closed cycle."""

    CONSERVATIVE = "conservative"
    DISSIPATIVE = "dissipative"
    ACTIVE = "active"


class GainTrend(StrEnum):
    """How the gain below resonance changes with rising amplitude."""

    RISES = "rises"
    FALLS = "falls"
    STEADY = "steady"


@dataclass(frozen=True)
class Signature:
    """By what an effect shows itself in sine tests at two amplitudes; a test measures what is declared here.

    Attributes
    ----------
    gain_trend
        Change of the gain below resonance with amplitude.
    even_harmonics
        True if the response to a sine holds even harmonics or a shifted mean.
    """

    gain_trend: GainTrend
    even_harmonics: bool = False


@dataclass(frozen=True)
class State:
    """A state that an effect adds, with its rate of change.

    Attributes
    ----------
    symbol
        Symbol of the state in the effect's equations.
    rate
        Time derivative in terms of `rigsight.effects.symbols`, the effect's parameters and states.
    dimension
        Dimension text of `rigsight.units`.
    limit
        Half-width of the range that the state cannot leave: it rests at the end it is driven against and leaves it at once
        when its rate turns (the stop operator of play and of dry friction behind a spring). None for a free state.
    """

    symbol: sp.Symbol
    rate: sp.Expr
    dimension: str
    limit: sp.Expr | None = None


@dataclass(frozen=True)
class SumAndDifference:
    """Two parameters that a search moves as their sum and difference, because records determine those apart.

    Attributes
    ----------
    first, second
        Names of the parameters.
    sum_range, difference_range
        Ranges that a search explores, in characteristic units.
    exponent
        Parameter whose reciprocal is the power in which sum and difference are searched; it keeps them apart from that
        parameter (``(1/(beta + gamma))^(1/n)`` is a length for every n).
    """

    first: str
    second: str
    sum_range: tuple[float, float]
    difference_range: tuple[float, float]
    exponent: str | None = None


@dataclass(frozen=True)
class Start:
    """Start values for a fit, as formulas of the simpler model that was fitted before.

    Attributes
    ----------
    values
        Parameter name -> value, of the parent's parameters, of ``k`` (the fitted stiffness) and of the characteristic sizes
        in `rigsight.effects.symbols`; the key ``"k"`` moves the stiffness itself.
    parent
        Effect whose fit gives the symbols their values; None for the rig without effects. The effect itself, where its fit may
        stop beside the best one and is worth trying once more from elsewhere.
    """

    values: dict[str, sp.Expr]
    parent: str | None = None


@dataclass(frozen=True)
class Effect:
    """A physical effect as one symbolic declaration.

    Every field that is None leaves that part of the rig as it is.

    Attributes
    ----------
    name
        Name in campaigns, results and documentation.
    place
        Where in the signal path it acts.
    summary
        One sentence that describes the effect.
    parameters
        Its parameters; setting all those with a null value to it removes the effect exactly.
    energy
        What it does to mechanical energy over a closed cycle.
    signature
        How it shows in sine tests.
    family
        What kind of cause it is.
    torque
        Torque (force) that resists the motion, subtracted from the drive, of x, v, t.
    spring
        The spring torque in terms of ``spring_torque``, ``k``, ``deflection`` and states.
    deflection
        Deflection of the spring as a function of ``x`` and states.
    drive
        Output of the actuator in terms of ``u`` and states.
    delay
        Time by which the input arrives late [s].
    control
        Output of a controller in terms of ``output``, ``error``, ``command`` and states.
    command
        What the controller takes for its command, in terms of ``command`` and states.
    command_delay
        Time by which the command reaches the controller late [s].
    lateral
        Rate of the lateral displacement, of ``creepage``, ``creep_gain``, ``lateral_displacement`` and ``lateral_feedback``.
    measured
        Reading of the sensor as a function of ``reading`` and states.
    reading_delay
        Delay of the sensor reading [s].
    states
        States added, with their rates.
    post_yield_stiffness_ratio
        Parameter that is the ratio of the post-yield stiffness to the initial stiffness. A fit varies the post-yield stiffness
        and the secant stiffness of the remainder, because records determine these two independently.
    yields_over
        Deflection over which a hysteresis yields, of its parameters: where the motion is far larger it is dry friction.
    mean_yield
        Of several elements that yield one after the other: their deflection where they do, weighted with their stiffness.
    pulsation
        Parameter that is the angular frequency of a periodic disturbance; a fit starts at a spectral line of the records.
    wave_number
        Parameter that is the wave number of an effect periodic in the position; a fit starts at a line of the spectrum over
        position.
    searched_as
        Parameters that a fit moves as sum and difference.
    ordered
        Pairs of parameters of the same dimension of which the first is never smaller; a fit varies the difference.
    starts
        Start values worth trying; default are the combinations of the parameters' own starts. A parent named there is a
        special or limiting case of this effect, and wins a tie.
    special_cases
        Parameter values that simplify the equations (such as an exponent of 1): held first, released later.
    needs_inertia
        True if it makes no sense where the motion is prescribed.
    needs_known_inertia
        True if it is the same as another effect where all of the inertia is a parameter.
    turns_freely
        True for a law of the angle of a joint without a spring; beside a spring another effect does the same.
    at
        Name of the joint, drive, sensor or state of a rig at which it acts; None for the first of its kind.
    """

    name: str
    place: Place
    summary: str
    parameters: tuple[Parameter, ...]
    energy: Energy
    signature: Signature
    family: Family = Family.OWN
    torque: sp.Expr | None = None
    spring: sp.Expr | None = None
    deflection: sp.Expr | None = None
    drive: sp.Expr | None = None
    delay: sp.Expr | None = None
    control: sp.Expr | None = None
    command: sp.Expr | None = None
    command_delay: sp.Expr | None = None
    lateral: sp.Expr | None = None
    measured: sp.Expr | None = None
    reading_delay: sp.Expr | None = None
    states: tuple[State, ...] = ()
    post_yield_stiffness_ratio: str | None = None
    yields_over: sp.Expr | None = None
    mean_yield: sp.Expr | None = None
    pulsation: str | None = None
    wave_number: str | None = None
    searched_as: tuple[SumAndDifference, ...] = ()
    ordered: tuple[tuple[str, str], ...] = ()
    starts: tuple[Start, ...] = ()
    special_cases: dict[str, float] = field(default_factory=dict)
    needs_inertia: bool = False
    needs_known_inertia: bool = False
    turns_freely: bool = False
    at: str | None = None

    @property
    def equations(self) -> dict[str, sp.Expr]:
        """Its new expressions by the part of the rig that they replace; a valid effect has one."""
        found = {part: getattr(self, part) for part in PARTS}
        return {part: expression for part, expression in found.items() if expression is not None}

    @property
    def parents(self) -> tuple[str, ...]:
        """Effects that this one contains as a special or limiting case."""
        others = (start.parent for start in self.starts if start.parent != self.name)
        return tuple(dict.fromkeys(parent for parent in others if parent is not None))

    @property
    def shifts_the_record(self) -> bool:
        """True for a reading whose time base stands off, either way: what is recorded, not what a control law reads."""
        return self.reading_delay is not None and any(p.lower < 0.0 for p in self.parameters)

    @cached_property
    def holds_constant_force(self) -> bool:
        """True for a force that depends on the direction alone: no record distinguishes its mean from a constant force.

        The mean of one that grows with the speed differs from motion to motion.
        """
        if self.torque is None or not self.signature.even_harmonics:
            return False
        depends_on_x = self.reads(symbols.x) or self.reads(symbols.position)
        return not depends_on_x and symbols.derivative(self.torque, symbols.v) == 0

    @cached_property
    def linear_parameters(self) -> tuple[Parameter, ...]:
        """Fitted parameters in which its torque is linear; those of its states are none."""
        if self.torque is None:
            return ()
        symbols_of = {p: sp.Symbol(p.name, real=True) for p in self.parameters if p.fitted}
        in_states = set().union(*(state.rate.free_symbols for state in self.states))
        return tuple(
            parameter
            for parameter, symbol in symbols_of.items()
            if symbol not in in_states and not symbols.derivative(self.torque, symbol).has(symbol)
        )

    @property
    def is_push(self) -> bool:
        """True if a force, a drive signal or a reading of the form that it has along a motion stands for it."""
        return self.lateral is None and not self.needs_known_inertia

    @property
    def loses_sign(self) -> bool:
        """True if a sensor with it shows magnitudes: its reading is not the motion, however small the effect is."""
        return self.measured is not None and bool(self.measured.has(sp.Abs))

    @property
    def reads_inertia(self) -> bool:
        """True if its equations hold the inertia that moves with its joint; that of a large arm is a long expression."""
        return self.reads(symbols.m)

    def reads(self, signal: sp.Symbol) -> bool:
        """Return True if its equations hold a signal.

        Parameters
        ----------
        signal
            One of `rigsight.effects.symbols`.
        """
        return signal in self._symbols

    @cached_property
    def _symbols(self) -> frozenset[sp.Basic]:
        of_states = (part for state in self.states for part in (state.rate, state.limit) if part is not None)
        return frozenset().union(*(part.free_symbols for part in (*self.equations.values(), *of_states)))

    def null_values(self) -> dict[str, float]:
        """Return the parameter values at which the effect vanishes."""
        return {p.name: p.null for p in self.parameters if p.null is not None}

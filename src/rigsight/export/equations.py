"""Equations, parameters and names that every export contains, independent of its language, and its equilibrium."""

from __future__ import annotations

import re
from collections.abc import Set
from dataclasses import dataclass

import sympy as sp

from rigsight.effects import Place
from rigsight.effects.symbols import clamp
from rigsight.errors import InputError
from rigsight.rigs import Rig
from rigsight.simulate import Model, parameter_vector, without_vanished_effects
from rigsight.simulate.equations.binder import state_symbol
from rigsight.simulate.equations.derivatives import slope
from rigsight.simulate.equations.kinks import FrozenStructure, freeze
from rigsight.simulate.equations.structure import TIME, Structure, input_symbols
from rigsight.simulate.equilibrium import has_raisable_damping, residuals_at_rest
from rigsight.simulate.input_hold import Hold
from rigsight.units import unit_text

NO_START = "with friction or hysteresis the equilibrium is known only for zero inputs: begin with these, or give initial_state"
"""Message of a file if another equilibrium is requested."""


def words(text: str) -> frozenset[str]:
    """Return the words of a text."""
    return frozenset(text.split())


_C_WORDS = words(
    """auto break case char const continue default do double else enum extern float for goto if inline int long register
    restrict return short signed sizeof static struct switch typedef union unsigned void volatile while"""
)

_OF_TEMPLATES = words(
    """input_value input_rate input_curvature friction_sign sign_of rates switches outputs limits modes state math np control
    numbers given max min abs sign pi eps delay"""
)

_C_MACROS = words(
    """BUFSIZ EOF EXIT_FAILURE EXIT_SUCCESS EXPORTED FILENAME_MAX FOPEN_MAX FP_INFINITE FP_NAN FP_NORMAL FP_SUBNORMAL FP_ZERO
    HUGE_VAL HUGE_VALF HUGE_VALL INFINITY L_tmpnam MATH_ERREXCEPT MATH_ERRNO NAN NULL RAND_MAX SEEK_CUR SEEK_END SEEK_SET
    TMP_MAX bool linux math_errhandling stderr stdin stdout unix
    DEPENDENT_MODES DIFFERENCE HAS_LIMITS LEAST_DIFFERENCE MAX_STEPS MOST_DEFECT OFTEN RARE ROLLED SHORTEST_DEFECT
    N_COMPUTED N_DEPENDENT N_IN N_INPUTS N_MODES N_OUT N_PARAMETERS N_SLOPES N_STATES N_UNKNOWN N_VALUES N_WATCHED ROUNDING
    SIZE_CONSTANTS SIZE_INPUTS SIZE_MODES SIZE_STATES SIZE_WATCHED VELOCITY AGREED FRICTION_IS_SHOWN FRICTION_MODES
    FRICTION_VELOCITIES GENERATIONS INDEPENDENT MOST_REPEATS NOISE N_DEGREES N_FRICTIONS N_LATE PROBE READS_LATE_RATE
    SIZE_FRICTIONS N_ARRIVING SIZE_COLUMNS"""
)

SHARED = _C_WORDS | _C_MACROS | _OF_TEMPLATES
"""What the text of the engine and the templates use; the words of a language stand in the module that writes it."""


@dataclass(frozen=True)
class Quantity:
    """A named number or signal: its name in the export, its name in the model, unit and description."""

    name: str
    source: str
    unit: str
    description: str


@dataclass(frozen=True)
class Source:
    """An input of the rig as an export is fed with it."""

    value: Quantity  # its samples
    rate: Quantity | None  # samples of its rate, where it prescribes a motion; else None

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """What is fed, in order."""
        return (self.value,) if self.rate is None else (self.value, self.rate)


@dataclass(frozen=True)
class Rest:
    """What the static equilibrium of one mass at the first input is found with; expressions of parameters."""

    expressions: list[sp.Expr]  # rest position, inertia and stiffness of the moving mass
    damping: str  # name of the damping parameter, raised to the critical value on the way to rest
    silenced: tuple[str, ...]  # names of the parameters of disturbances, zero on the way to rest


@dataclass(frozen=True)
class Exported:
    """A model in the form that every target prints."""

    structure: Structure  # rig and effects, without those that have vanished
    frozen: FrozenStructure  # the same with the sign of every kink as a mode that rests between events
    hold: Hold  # how the input behaves between its samples
    step: float  # longest internal step [s] of a fixed-step integrator
    # The parameters and their numbers.
    parameters: tuple[Quantity, ...]
    values: tuple[float, ...]
    # The signals.
    states: tuple[Quantity, ...]
    sources: tuple[Source, ...]
    outputs: tuple[Quantity, ...]
    # How the equilibrium is found; None for an element, which has no motion of its own.
    rest: Rest | Balance | None

    @property
    def inputs(self) -> tuple[Quantity, ...]:
        """What is fed, in order; behind a prescribed motion its rate."""
        return tuple(quantity for source in self.sources for quantity in source.quantities)

    @property
    def follows_motion(self) -> bool:
        """True if an input prescribes a motion."""
        return any(source.rate is not None for source in self.sources)

    @property
    def numbers(self) -> tuple[tuple[Quantity, float], ...]:
        """The parameters with their numbers."""
        return tuple(zip(self.parameters, self.values, strict=True))

    @property
    def frictions(self) -> tuple[int, ...]:
        """Indices of the modes that are signs of velocities which dry friction can hold at zero."""
        return tuple(friction.mode for friction in self.frozen.frictions)

    @property
    def friction(self) -> int | None:
        """The first of them; None without dry friction."""
        return self.frictions[0] if self.frictions else None

    @property
    def limits(self) -> dict[int, sp.Expr]:
        """Half-width of the range of each state that has one, by its index."""
        return {i: e.limit for i, e in enumerate(self.structure.equations) if e.limit is not None}

    @property
    def title(self) -> str:
        """Rig and effects in words."""
        effects = ", ".join(self.structure.effect_names)
        return harmless(f"{self.structure.rig.name} with {effects}" if effects else self.structure.rig.name)

    def names(self) -> dict[sp.Symbol, str]:
        """Return the name of every symbol in the equations but the modes."""
        structure = self.structure
        signals = {TIME: "time"}
        for index, source in enumerate(self.sources):
            signals |= dict(zip(input_symbols(index), (q.name for q in source.quantities), strict=False))
        parameters = zip(structure.parameter_symbols, self.parameters, strict=True)
        states = zip(structure.states, self.states, strict=True)
        return {**signals, **{symbol: quantity.name for symbol, quantity in (*parameters, *states)}}


def _check_delays(structure: Structure) -> None:
    """Refuse delays but that of the only input and that of the first sensor."""
    remembered = {history.symbol.name.partition(":")[0] for history in structure.histories}
    late = [e.name for e in structure.effects if e.name in remembered]
    behind = zip(structure.rig.outputs[1:], structure.shown_late[1:], strict=True)
    late += [output.name for output, delay in behind if delay is not None]
    if late:
        raise InputError(
            f"A delay at {', '.join(late)} cannot be exported: only delays of a single input and of the first sensor can. "
            f"Simulate the model here, or leave the delay out."
        )


def exported(
    model: Model, hold: Hold, step: float, reserved: Set[str], of_inputs: Set[str] = frozenset()
) -> Exported:
    """Return a model in the form that every target prints."""
    structure, values = without_vanished_effects(model.structure, model.values)
    _check_delays(structure)
    names = _Names(reserved)
    sources = _sources(structure.rig, names, of_inputs)
    shown = _Names(reserved)
    outputs = tuple(shown.quantity(s.name, s.unit, s.description) for s in structure.rig.outputs)
    parameters = tuple(names.quantity(p.name, p.unit, p.description) for p in structure.parameters)
    units = _state_units(structure)
    return Exported(
        structure=structure,
        frozen=freeze(structure),
        hold=hold,
        step=step,
        parameters=parameters,
        values=tuple(float(value) for value in parameter_vector(structure, values)),
        states=tuple(names.quantity(e.symbol.name, units[e.symbol], "state") for e in structure.equations),
        sources=sources,
        outputs=outputs,
        rest=_rest(structure, {p.source: p.name for p in parameters}),
    )


def _sources(rig: Rig, names: _Names, of_inputs: Set[str]) -> tuple[Source, ...]:
    found = []
    for signal in rig.inputs:
        value, rate = names.quantity(signal.name, signal.unit, signal.description, of_inputs), None
        if signal.name in rig.mechanism.prescribing:
            about = f"rate of {signal.name}"
            rate = names.quantity(f"{signal.name}_rate", f"{signal.unit}/s", about, of_inputs)
        found.append(Source(value, rate))
    return tuple(found)


def _state_units(structure: Structure) -> dict[sp.Symbol, str]:
    rig = structure.rig
    units = {state.symbol: state.unit for state in rig.mechanism.states}
    for coordinate in rig.mechanism.coordinates:
        units |= {coordinate.symbol: coordinate.unit, coordinate.rate: f"{coordinate.unit}/s"}
    for effect in structure.effects:
        at = rig.units_at(rig.acts_at(effect))
        of_place = {**at, "drive": at["force"]}
        units |= {state_symbol(effect, s.symbol): unit_text(s.dimension, of_place) for s in effect.states}
    return units


def _rest(structure: Structure, names: dict[str, str]) -> Rest | Balance | None:
    if not has_raisable_damping(structure.rig) or structure.rig.mechanism.initial:
        return balance(structure)
    motion = structure.rig.motion
    if motion.inertia is None:
        return None
    disturbances = [effect for effect in structure.effects if effect.place is Place.DISTURBANCE]
    pushing = [structure.parameter_name(effect, p.name) for effect in disturbances for p in effect.parameters]
    return Rest(
        [structure.of_rig(own) for own in (motion.rest, motion.inertia, motion.stiffness)],
        damping=names[motion.damping.name],
        silenced=tuple(names[name] for name in pushing if name in names),
    )


class _Names:
    """Makes names that are words in every target and that occur once; outputs have their own, as most are a state's name."""

    def __init__(self, reserved: Set[str]) -> None:
        self._reserved = reserved
        self._used: set[str] = set()

    def quantity(self, wished: str, unit: str, description: str, refused: Set[str] = frozenset()) -> Quantity:
        """Return a quantity under the wished name, or one like it that is not refused."""
        name = re.sub(r"[^0-9A-Za-z_]+", "_", wished).strip("_") or "value"
        if name[0].isdigit():
            name = f"n_{name}"
        while (
            name in self._used
            or name in self._reserved
            or name in refused
            or re.fullmatch(r"(part|constant_)\d+|part(_[a-z]+)+(_\d+)+", name)
        ):
            name += "_"
        self._used.add(name)
        return Quantity(name, wished, harmless(unit), harmless(description))


def harmless(text: str) -> str:
    """Return text that ends no comment and no string of any target, on one line."""
    plain = "".join(c if c.isprintable() else " " for c in text).replace('"', "'").replace("\\", "/")
    return " ".join(plain.replace("*/", "* /").split())


@dataclass(frozen=True)
class Balance:
    """What is zero at the static equilibrium, of unknown states, inputs and parameters."""

    # Indices of the states that are sought: all but the velocities and those that the rig's file gives.
    unknown: tuple[int, ...]
    residuals: tuple[sp.Expr, ...]  # for each of them what has to vanish at rest
    slopes: tuple[tuple[sp.Expr, ...], ...]  # derivatives of the residuals by the unknown states, row by row
    # Expression of parameters of each state that is given, by its index; the others start at 0.
    start: dict[int, sp.Expr]
    # True where friction or hysteresis holds what the way of the inputs left: then only that without input is
    # known.
    remembers: bool

    @property
    def expressions(self) -> list[sp.Expr]:
        """The residuals, then their derivatives row by row."""
        return [*self.residuals, *(slope for row in self.slopes for slope in row)]


def balance(structure: Structure) -> Balance | None:
    """Return what is zero at the equilibrium of a rig, as `rigsight.simulate.equilibrium` has it; None without a state."""
    states = structure.states
    if not states:
        return None
    initial = structure.rig.mechanism.initial.items()
    start = {states.index(symbol): structure.of_rig(own) for symbol, own in initial if symbol in states}
    before = [start.get(i, sp.S.Zero) for i in range(len(states))]
    residuals, memories = residuals_at_rest(structure, before, clamp)
    unknown = tuple(i for i in residuals if i not in start)
    return Balance(
        unknown,
        tuple(residuals[i] for i in unknown),
        tuple(tuple(slope(residuals[row], states[i]) for i in unknown) for row in unknown),
        start,
        bool(memories.intersection(unknown) or freeze(structure).frictions),
    )

"""How do effects enter a rig's equations?

The signal path is ``input -> delay -> static drive effects -> lags -> drive -> dynamics -> lateral displacement -> sensors``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import lru_cache

import sympy as sp

from rigsight.effects import Effect
from rigsight.effects import symbols as canonical
from rigsight.errors import InputError, check_option
from rigsight.parameters import Parameter
from rigsight.rigs import RIGS, Rig
from rigsight.simulate.structure import INPUT, INPUT_RATE, TIME, StateEquation, Structure, unique_names


def compose(rig: Rig, effects: Iterable[Effect] = (), fixed: Mapping[str, float] | None = None) -> Structure:
    """Put effects into a rig's equations.

    Parameters
    ----------
    rig
        The rig.
    effects
        Effects in any order; they are sorted along the signal path.
    fixed
        Values of effect parameters to write into the equations as numbers (an exponent of 1 saves a power).

    Raises
    ------
    InputError
        If an effect makes no sense on this rig or is given twice.

    Notes
    -----
    A parameter name that occurs twice is qualified by its effect (``stribeck_friction.T_c`` beside Coulomb friction).
    """
    chosen = tuple(sorted(effects, key=lambda e: (e.place.value, len(e.states), e.name)))
    return _compose(_Key(rig), _Key(chosen), tuple(sorted((fixed or {}).items())))


class _Key:
    """Let declarations, which hold dictionaries and so cannot be hashed, be keys of a cache by identity."""

    def __init__(self, value: Rig | tuple[Effect, ...]) -> None:
        self.value = value
        self._identity = tuple(map(id, value)) if isinstance(value, tuple) else (id(value),)

    def __hash__(self) -> int:
        return hash(self._identity)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Key) and self._identity == other._identity


@lru_cache(maxsize=1024)
def _compose(rig_key: _Key, effects_key: _Key, fixed: tuple[tuple[str, float], ...]) -> Structure:
    rig, effects = rig_key.value, effects_key.value
    assert isinstance(rig, Rig)
    assert isinstance(effects, tuple)
    _check_effects(rig, effects)
    unique = unique_names(rig, effects)
    parameters = _parameters(rig, effects, unique, dict(fixed))
    symbols = {p.name: sp.Symbol(f"p_{p.name}", real=True) for p in parameters}
    binder = _Binder(rig, symbols, unique, dict(fixed))

    delay, lags = _actuator(binder, effects)
    spring, memories = _spring(binder, effects)
    torque = sum((binder.effect(e, e.torque) for e in effects if e.torque is not None), start=sp.Integer(0))
    for effect in effects:
        if effect.torque is not None and effect.spring is None and effect.drive is None:
            memories += binder.states(effect)

    motion = rig.motion
    resisting = spring + binder.rig(motion.damping) * binder.velocity + torque
    states: list[StateEquation]
    outputs: tuple[sp.Expr, ...]
    if motion.inertia is not None:
        driving = binder.rig(motion.drive_gain) * binder.drive + binder.rig(motion.bias)
        acceleration = (driving - resisting) / binder.rig(motion.inertia)
        states = [
            StateEquation(motion.displacement, motion.velocity, "x"),
            StateEquation(motion.velocity, acceleration, "x time^-1"),
            *_lateral(binder, effects, rig),
            *memories,
            *lags,
        ]
        reading, late, sensors = _sensor(binder, effects, motion.displacement)
        states += sensors
        outputs = (reading, *rig.downstream)
    else:
        states, late = list(memories), None
        outputs = (resisting + binder.rig(motion.bias),)
    return Structure(
        rig=rig,
        effects=effects,
        fixed=fixed,
        parameters=parameters,
        parameter_symbols=tuple(symbols[p.name] for p in parameters),
        equations=tuple(states),
        outputs=outputs,
        delay=delay,
        measured_late=late,
        velocity_index=1 if rig.is_driven else None,
    )


def _check_effects(rig: Rig, effects: tuple[Effect, ...]) -> None:
    names = [effect.name for effect in effects]
    for effect in effects:
        if not rig.offers(effect):
            raise InputError(f"Effect '{effect.name}' makes no sense on the rig '{rig.name}'.")
    if len(set(names)) < len(names):
        raise InputError(f"An effect is named twice: {', '.join(names)}.")


def _parameters(
    rig: Rig, effects: tuple[Effect, ...], unique: Mapping[tuple[str, str], str], fixed: Mapping[str, float]
) -> tuple[Parameter, ...]:
    of_effects = [
        replace(rig.with_unit(parameter), name=unique[effect.name, parameter.name])
        for effect in effects
        for parameter in effect.parameters
    ]
    return (*rig.constants, *rig.parameters, *(p for p in of_effects if p.name not in fixed))


class _Binder:
    """Replaces the symbols of rig and effect declarations by those of one structure."""

    def __init__(
        self,
        rig: Rig,
        symbols: Mapping[str, sp.Symbol],
        unique: Mapping[tuple[str, str], str],
        fixed: Mapping[str, float],
    ) -> None:
        self._symbols = symbols
        self._unique = unique
        self._fixed = {name: sp.nsimplify(value) for name, value in fixed.items()}
        self._rig_names = {p.name for p in (*rig.constants, *rig.parameters)}
        motion = rig.motion
        self.displacement = motion.displacement if rig.is_driven else INPUT
        self.velocity = motion.velocity if rig.is_driven else INPUT_RATE
        self.x = self.displacement - self.rig(motion.rest)
        self.stiffness = self.rig(motion.stiffness)
        self.drive: sp.Expr = INPUT
        self._canonical: dict[sp.Symbol, sp.Expr] = {
            canonical.x: self.x,
            canonical.v: self.velocity,
            canonical.t: TIME,
            canonical.k: self.stiffness,
        }
        if motion.inertia is not None:
            self._canonical[canonical.m] = self.rig(motion.inertia)

    def rig(self, expression: sp.Expr) -> sp.Expr:
        """Bind an expression of the rig's declaration."""
        return expression.xreplace(
            {s: self._symbols[s.name] for s in expression.free_symbols if s.name in self._rig_names}
        )

    def effect(self, effect: Effect, expression: sp.Expr, **signals: sp.Expr) -> sp.Expr:
        """Bind an expression of an effect; `signals` override canonical symbols by name."""
        states = {state.symbol for state in effect.states}
        replacement: dict[sp.Symbol, sp.Expr] = dict(self._canonical)
        for symbol in expression.free_symbols:
            name = self._unique.get((effect.name, symbol.name))
            if symbol in states:
                replacement[symbol] = state_symbol(effect, symbol)
            elif symbol.name in signals:
                replacement[symbol] = signals[symbol.name]
            elif name is not None:
                replacement[symbol] = self._fixed[name] if name in self._fixed else self._symbols[name]
        return expression.xreplace(replacement)

    def states(self, effect: Effect, **signals: sp.Expr) -> list[StateEquation]:
        """Bind the states that an effect adds."""
        return [
            StateEquation(
                state_symbol(effect, s.symbol),
                self.effect(effect, s.rate, **signals),
                s.dimension,
                None if s.limit is None else self.effect(effect, s.limit),
            )
            for s in effect.states
        ]


def state_symbol(effect: Effect, symbol: sp.Symbol) -> sp.Symbol:
    """Return the symbol of an effect's state within a structure; two effects may both call theirs z."""
    return sp.Symbol(f"{effect.name}.{symbol.name}", real=True)


def _actuator(binder: _Binder, effects: tuple[Effect, ...]) -> tuple[sp.Expr | None, list[StateEquation]]:
    """Chain the actuator effects; leaves the drive in the binder and returns delay and lag states."""
    delay: sp.Expr | None = None
    lags: list[StateEquation] = []
    for effect in effects:
        if effect.delay is not None:
            own_delay = binder.effect(effect, effect.delay)
            delay = own_delay if delay is None else delay + own_delay
        if effect.drive is not None:
            lags += binder.states(effect, u=binder.drive)
            binder.drive = binder.effect(effect, effect.drive, u=binder.drive)
    return delay, lags


def _spring(binder: _Binder, effects: tuple[Effect, ...]) -> tuple[sp.Expr, list[StateEquation]]:
    """Chain what stands between displacement and spring, then what changes the spring's torque."""
    deflection, deflection_rate = binder.x, binder.velocity
    memories: list[StateEquation] = []
    for effect in effects:
        if effect.deflection is not None:
            own = binder.states(effect, x=deflection, v=deflection_rate)
            before = sp.Symbol("deflection_before", real=True)
            after = binder.effect(effect, effect.deflection, x=before)
            deflection_rate = sp.diff(after, before).xreplace({before: deflection}) * deflection_rate + sum(
                (sp.diff(after, state.symbol) * state.limited_rate for state in own), start=sp.Integer(0)
            )
            deflection = after.xreplace({before: deflection})
            memories += own
    torque = binder.stiffness * deflection
    for effect in effects:
        if effect.spring is not None:
            signals = {
                "spring_torque": torque,
                "deflection": deflection,
                "deflection_rate": deflection_rate,
            }
            torque = binder.effect(effect, effect.spring, **signals)
            memories += binder.states(effect, **signals)
    return torque, memories


def _lateral(binder: _Binder, effects: tuple[Effect, ...], rig: Rig) -> list[StateEquation]:
    """Return the lateral displacement that the motion drives, if the rig has one."""
    if rig.lateral is None:
        return []
    signals = {
        "creepage": binder.rig(rig.lateral.creepage),
        "creep_gain": binder.rig(rig.lateral.gain),
        "lateral_displacement": binder.rig(rig.lateral.displacement),
        "lateral_feedback": binder.rig(rig.lateral.feedback),
    }
    linear = signals["creep_gain"] * signals["creepage"]
    # Each effect gives the whole rate; two of them add up what each takes off the linear one.
    rate = linear + sum(
        (binder.effect(e, e.lateral, **signals) - linear for e in effects if e.lateral is not None),
        start=sp.Integer(0),
    )
    return [StateEquation(rig.lateral.symbol, rate, "length")]


def _sensor(
    binder: _Binder, effects: tuple[Effect, ...], displacement: sp.Symbol
) -> tuple[sp.Expr, sp.Expr | None, list[StateEquation]]:
    """Chain the sensor effects; returns what is read, by how much it is late, and the sensors' states."""
    reading: sp.Expr = displacement
    late: sp.Expr | None = None
    states: list[StateEquation] = []
    for effect in effects:
        if effect.measured is not None:
            states += binder.states(effect, reading=reading)
            reading = binder.effect(effect, effect.measured, reading=reading)
        if effect.measured_late is not None:
            own = binder.effect(effect, effect.measured_late)
            late = own if late is None else late + own
    return reading, late, states


def structure_named(
    rig_name: str, effects: Iterable[Effect] = (), fixed: Mapping[str, float] | None = None
) -> Structure:
    """Compose a rig given by its name.

    Raises
    ------
    InputError
        If there is no such rig, or as `compose`.
    """
    return compose(RIGS[check_option("Rig", rig_name, RIGS)], effects, fixed)


def without_vanished_effects(
    structure: Structure, values: Mapping[str, float]
) -> tuple[Structure, dict[str, float]]:
    """Leave out the effects whose parameters are at the values at which they vanish.

    A vanished lag would divide by its time constant, and every vanished kink would still cost events.

    Returns
    -------
    structure
        The structure without them; the same object if none has vanished.
    values
        Value of each of its parameters, by the names they have in it.
    """
    known = {**dict(structure.fixed), **values}

    def vanished(effect: Effect) -> bool:
        null = effect.null_values()
        return bool(null) and all(
            known.get(structure.parameter_name(effect, name)) == value for name, value in null.items()
        )

    kept = [effect for effect in structure.effects if not vanished(effect)]
    if len(kept) == len(structure.effects):
        return structure, dict(values)
    bare = compose(structure.rig, kept)
    renamed = {
        structure.parameter_name(effect, p.name): bare.parameter_name(effect, p.name)
        for effect in kept
        for p in effect.parameters
    }
    fixed = {renamed[name]: value for name, value in structure.fixed if name in renamed}
    return compose(structure.rig, kept, fixed), {
        renamed.get(name, name): value for name, value in values.items()
    }

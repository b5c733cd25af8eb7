"""How do effects enter a rig's equations? One walk along the signal path, which leaves an `EquationTree`.

The path is ``input -> delays -> static drive effects -> lags -> drive -> dynamics -> lateral displacement -> sensors ->
delays of the sensors``.
"""

from __future__ import annotations

from collections.abc import Mapping

import sympy as sp

from rigsight.effects import Effect
from rigsight.effects import symbols as canonical
from rigsight.rigs import Rig
from rigsight.simulate.equation_tree import (
    Definition,
    EquationsOfMotion,
    EquationTree,
    FirstOrderState,
    Kind,
    Output,
    late,
)
from rigsight.simulate.structure import INPUT, INPUT_RATE, TIME


def equation_tree(
    rig: Rig,
    effects: tuple[Effect, ...],
    symbols: Mapping[str, sp.Symbol],
    unique: Mapping[tuple[str, str], str],
    fixed: Mapping[str, float],
) -> EquationTree:
    """Return the equations of a rig with effects.

    Parameters
    ----------
    rig
        The rig.
    effects
        Effects in the order of the signal path.
    symbols
        Symbol of each parameter of the structure by its name there.
    unique
        Name of each effect's parameter in the structure, by (effect, own name).
    fixed
        Values of parameters that stand in the equations as numbers.
    """
    return _Path(_Binder(rig, symbols, unique, fixed), rig, effects).tree()


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

    def effect(self, effect: Effect, expression: sp.Expr, signals: Mapping[str, sp.Expr]) -> sp.Expr:
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


class _Path:
    """Collects definitions and states while it follows the signals from the input to the sensors."""

    def __init__(self, binder: _Binder, rig: Rig, effects: tuple[Effect, ...]) -> None:
        self._binder = binder
        self._rig = rig
        self._effects = effects
        self._definitions: list[Definition] = []

    def tree(self) -> EquationTree:
        """Walk the path."""
        binder, rig, motion = self._binder, self._rig, self._rig.motion
        drive, lags = self._drive(INPUT)
        spring, memories = self._spring(binder.x, binder.velocity)
        torques, more = self._torques()
        memories += more
        damping = binder.rig(motion.damping) * binder.velocity
        bias = [] if motion.bias == 0 else [binder.rig(motion.bias)]
        if motion.inertia is None:
            return EquationTree(
                inputs=(INPUT, INPUT_RATE),
                definitions=tuple(self._definitions),
                motion=EquationsOfMotion(),
                states=tuple(memories),
                outputs=(Output(rig.outputs[0].name, (damping, spring, *torques, *bias)),),
            )
        lateral = self._lateral()
        reading, sensors = self._sensor(binder.displacement)
        resisting = (-term for term in (damping, spring, *torques))
        return EquationTree(
            inputs=(INPUT,),
            definitions=tuple(self._definitions),
            motion=EquationsOfMotion(
                coordinates=(motion.displacement,),
                velocities=(motion.velocity,),
                mass=sp.ImmutableMatrix([[binder.rig(motion.inertia)]]),
                terms=((binder.rig(motion.drive_gain) * drive, *resisting, *bias),),
            ),
            states=(*lateral, *memories, *lags, *sensors),
            outputs=(
                Output(rig.outputs[0].name, (reading,)),
                *(Output(state.symbol.name, (state.symbol,)) for state in lateral),
            ),
        )

    def _drive(self, source: sp.Symbol) -> tuple[sp.Symbol, list[FirstOrderState]]:
        """Chain the actuator effects: what is static or a lag may as well act on what is late already."""
        lags: list[FirstOrderState] = []
        for effect in self._effects:
            if effect.delay is not None:
                source = self._define(
                    Kind.DRIVE, effect, late(source, self._binder.effect(effect, effect.delay, {}))
                )
        for effect in self._effects:
            if effect.drive is not None:
                signals = {"u": source}
                lags += self._states(effect, signals)
                source = self._define(Kind.DRIVE, effect, self._binder.effect(effect, effect.drive, signals))
        return source, lags

    def _spring(self, deflection: sp.Expr, rate: sp.Expr) -> tuple[sp.Expr, list[FirstOrderState]]:
        """Chain what stands between displacement and spring, then what changes the spring's torque."""
        memories: list[FirstOrderState] = []
        for effect in self._effects:
            if effect.deflection is not None:
                own = self._states(effect, {"x": deflection, "v": rate})
                before = sp.Symbol("deflection_before", real=True)
                after = self._binder.effect(effect, effect.deflection, {"x": before})
                rate = sp.diff(after, before).xreplace({before: deflection}) * rate + sum(
                    (sp.diff(after, state.symbol) * state.limited_rate for state in own), start=sp.Integer(0)
                )
                deflection = self._define(Kind.DEFLECTION, effect, after.xreplace({before: deflection}))
                rate = self._define(Kind.DEFLECTION_RATE, effect, rate, rate_of=deflection)
                memories += own
        torque = self._binder.stiffness * deflection
        for effect in self._effects:
            if effect.spring is not None:
                signals = {"spring_torque": torque, "deflection": deflection, "deflection_rate": rate}
                torque = self._define(
                    Kind.SPRING, effect, self._binder.effect(effect, effect.spring, signals)
                )
                memories += self._states(effect, signals)
        return torque, memories

    def _torques(self) -> tuple[list[sp.Symbol], list[FirstOrderState]]:
        torques: list[sp.Symbol] = []
        memories: list[FirstOrderState] = []
        for effect in self._effects:
            if effect.torque is not None:
                torques.append(
                    self._define(Kind.TORQUE, effect, self._binder.effect(effect, effect.torque, {}))
                )
                memories += self._states(effect, {})
        return torques, memories

    def _lateral(self) -> list[FirstOrderState]:
        """Return the lateral displacement that the motion drives, if the rig has one."""
        lateral, binder = self._rig.lateral, self._binder
        if lateral is None:
            return []
        signals = {
            "creepage": binder.rig(lateral.creepage),
            "creep_gain": binder.rig(lateral.gain),
            "lateral_displacement": binder.rig(lateral.displacement),
            "lateral_feedback": binder.rig(lateral.feedback),
        }
        linear = signals["creep_gain"] * signals["creepage"]
        # Each effect gives the whole rate; two of them add up what each takes off the linear one.
        changes = [
            self._define(Kind.LATERAL, effect, binder.effect(effect, effect.lateral, signals) - linear)
            for effect in self._effects
            if effect.lateral is not None
        ]
        return [FirstOrderState(lateral.symbol, (linear, *changes), "length", None, None)]

    def _sensor(self, reading: sp.Symbol) -> tuple[sp.Symbol, list[FirstOrderState]]:
        """Chain the sensor effects: the delays come last, as nothing inside the simulation waits for them."""
        states: list[FirstOrderState] = []
        for effect in self._effects:
            if effect.measured is not None:
                signals = {"reading": reading}
                states += self._states(effect, signals)
                reading = self._define(
                    Kind.READING, effect, self._binder.effect(effect, effect.measured, signals)
                )
        for effect in self._effects:
            if effect.measured_late is not None:
                delay = self._binder.effect(effect, effect.measured_late, {})
                reading = self._define(Kind.READING, effect, late(reading, delay))
        return reading, states

    def _define(
        self, kind: Kind, effect: Effect, expression: sp.Expr, rate_of: sp.Symbol | None = None
    ) -> sp.Symbol:
        # No name of an effect or a parameter holds a colon.
        symbol = sp.Symbol(f"{effect.name}:{kind.value}", real=True)
        self._definitions.append(Definition(symbol, expression, kind, effect.name, rate_of))
        return symbol

    def _states(self, effect: Effect, signals: Mapping[str, sp.Expr]) -> list[FirstOrderState]:
        return [
            FirstOrderState(
                symbol=state_symbol(effect, s.symbol),
                terms=(self._binder.effect(effect, s.rate, signals),),
                dimension=s.dimension,
                limit=None if s.limit is None else self._binder.effect(effect, s.limit, {}),
                owner=effect.name,
            )
            for s in effect.states
        ]


def state_symbol(effect: Effect, symbol: sp.Symbol) -> sp.Symbol:
    """Return the symbol of an effect's state within a structure; two effects may both call theirs z."""
    return sp.Symbol(f"{effect.name}.{symbol.name}", real=True)

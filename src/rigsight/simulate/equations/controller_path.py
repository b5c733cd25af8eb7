"""Insertion of effects into a control law: ``command -> delays -> filters -> law -> what is added to it -> limits``."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from rigsight.effects import Effect
from rigsight.rigs import Controller, Drive
from rigsight.simulate.equations.binder import Binder, DefinedSignals
from rigsight.simulate.equations.structure import input_symbols
from rigsight.simulate.equations.tree import FirstOrderState, Kind, late

_OUTPUT = sp.Symbol("output of a controller", real=True)


class ControllerPath:
    """The law of one drive of a rig with `n_inputs` inputs, with its effects; definitions are added to those of the structure."""

    def __init__(
        self,
        binder: Binder,
        defined: DefinedSignals,
        n_inputs: int,
        drive: Drive,
        controller: Controller,
        effects: Sequence[Effect],
    ) -> None:
        self._binder, self._defined, self._n_inputs = binder, defined, n_inputs
        self._drive, self._controller, self._effects = drive, controller, effects
        self.states: list[FirstOrderState] = []
        """States of the effects that have been inserted."""

    def signal(self) -> sp.Expr:
        """Return the signal of the drive, of a law that is this signal."""
        _, output = self._outputs({})
        limits = self._defined.bound(self._controller.limited(_OUTPUT))
        return limits.xreplace({_OUTPUT: output})

    def goal_for(self, goal: sp.Expr) -> sp.Expr:
        """Return the signal of the drive from which its force follows, of a law that is this force."""
        before, output = self._outputs({sp.Symbol(self._drive.name, real=True): goal})
        return goal + output - before

    def _outputs(self, own: dict[sp.Symbol, sp.Expr]) -> tuple[sp.Expr, sp.Expr]:
        """Return the output of the controller without and with the effects."""
        law = self._controller
        parts = [self._defined.bound(part).xreplace(own) for part in (law.output, law.error, law.command)]
        before = parts[0]
        for effect in self._effects:
            if effect.command_delay is not None:
                arriving = self._late_inputs(before.free_symbols, effect)
                parts = [part.xreplace(arriving) for part in parts]
        output, error, command = parts
        for effect in self._effects:
            if effect.command is not None:
                followed = self._defined_by(effect, effect.command, {"command": command})
                output, error, command = output + followed - command, error + followed - command, followed
        for effect in self._effects:
            if effect.control is not None:
                signals = {"output": output, "error": error, "command": command}
                output = self._defined_by(effect, effect.control, signals)
        return before, output

    def _defined_by(self, effect: Effect, expression: sp.Expr, signals: dict[str, sp.Expr]) -> sp.Symbol:
        self.states += self._defined.states(effect, signals)
        return self._defined.changed(Kind.DRIVE, effect, expression, signals)

    def _late_inputs(self, read: set[sp.Symbol], effect: Effect) -> dict[sp.Symbol, sp.Expr]:
        """Return the inputs that the law reads with what stands for each where it arrives late."""
        assert effect.command_delay is not None
        delay = self._binder.effect(effect, effect.command_delay, {})
        inputs = [value for i in range(self._n_inputs) if (value := input_symbols(i)[0]) in read]
        return {
            value: self._defined.define(Kind.DRIVE, effect, late(value, delay), of=" " * number)
            for number, value in enumerate(inputs)
        }

"""Which equations does the diagnosed simulation have? From declarations to MathML, which browsers draw and read aloud."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp
from markupsafe import Markup
from sympy.printing.mathml import MathMLPresentationPrinter

from rigsight.diagnose.result import Diagnosis
from rigsight.effects import CATALOGUE, Effect
from rigsight.effects import symbols as canonical
from rigsight.report.wording import effect_label, sentence_case
from rigsight.rigs import RIGS, Rig
from rigsight.rigs.rig import Lateral
from rigsight.simulate import compose

_RATE = "_rate"
"""What ends the name of a symbol that is shown as a rate, with a dot."""
_SPACE = "~"
"""What stands for a space in the name of a symbol with words below it."""

_TIMES = '<mo lspace="0.14em" rspace="0.14em">&InvisibleTimes;</mo>'
"""A little space, so that names of several letters do not run into each other."""


@dataclass(frozen=True)
class EquationGroup:
    """Equations that belong together: whose they are, and each as MathML."""

    title: str
    equations: list[Markup]


def known_effects(own: Iterable[Effect] = ()) -> dict[str, Effect]:
    """Return the effects of the catalogue and a user's own by name."""
    return {effect.name: effect for effect in (*CATALOGUE, *own)}


def equation_groups(diagnosis: Diagnosis, known: Mapping[str, Effect]) -> list[EquationGroup]:
    """Return the equations of the rig, then those of each effect of the diagnosed simulation, in the order of the signal path.

    Parameters
    ----------
    diagnosis
        The result.
    known
        Declared effects by name; nothing is returned where one of the simulation is missing.
    """
    rig = RIGS.get(diagnosis.rig)
    # What the given simulation had already stands in the model beside what was added.
    names = dict.fromkeys([*diagnosis.model.get("effects", ()), *diagnosis.effects])
    if rig is None or not names.keys() <= known.keys():
        return []
    return equations_of(rig, [known[name] for name in names])


def equations_of(rig: Rig, effects: Sequence[Effect]) -> list[EquationGroup]:
    """Return the equations of a rig, then those of each effect on it, in the order of the signal path.

    Parameters
    ----------
    rig
        The rig.
    effects
        Effects that act on it, in any order.

    Raises
    ------
    InputError
        If the rig does not offer one of the effects.
    """
    writer = _Writer(rig)
    chain = _Chain(rig, writer)
    groups = [
        EquationGroup(sentence_case(effect_label(effect.name)), list(chain.equations(effect)))
        for effect in compose(rig, effects).effects
    ]
    return [EquationGroup(sentence_case(rig.name.replace("_", " ")), list(chain.motion())), *groups]


class _Chain:
    """The signal path as the effects change it, one after the other; `motion` is asked last, as it reads what is left."""

    def __init__(self, rig: Rig, writer: _Writer) -> None:
        self._rig = rig
        self._writer = writer
        motion = rig.motion
        self._source: sp.Expr = sp.Symbol(rig.inputs[0].name, real=True)
        self._deflection: sp.Expr = motion.displacement - motion.rest
        self._deflection_rate: sp.Expr = motion.velocity
        self._spring: sp.Expr | None = None
        self._reading: sp.Expr = motion.displacement
        self._torques: list[sp.Expr] = []
        self._lateral: list[sp.Expr] = []

    def equations(self, effect: Effect) -> Iterator[Markup]:
        """Yield an effect's equations, in terms of what stands in front of it in the signal path."""
        writer, label = self._writer, effect_label(effect.name).replace(" ", _SPACE)
        signals: dict[sp.Symbol, sp.Expr] = {
            canonical.u: self._source,
            canonical.deflection: self._deflection,
            canonical.deflection_rate: self._deflection_rate,
            canonical.spring_torque: self._spring_torque(),
            canonical.reading: self._reading,
        }
        if effect.deflection is not None:
            signals |= {canonical.x: self._deflection, canonical.v: self._deflection_rate}
        if self._rig.lateral is not None:
            signals |= _lateral_signals(self._rig.lateral)
        changed = {
            "T": effect.torque,
            "T_spring": effect.spring,
            "x_spring": effect.deflection,
            "u": effect.drive,
            self._rig.outputs[0].name: effect.measured,
        }
        for letter, expression in changed.items():
            if expression is not None:
                result = sp.Symbol(f"{letter}_{label}", real=True)
                yield writer.equation(
                    writer.expression(result), writer.expression(expression.xreplace(signals))
                )
                self._take(letter, result)
        if effect.delay is not None:
            result = sp.Symbol(f"u_{label}", real=True)
            yield writer.equation(writer.expression(result), writer.late(self._source, effect.delay))
            self._source = result
        if effect.measured_late is not None:
            result = sp.Symbol(f"{self._rig.outputs[0].name}_{label}", real=True)
            yield writer.equation(writer.expression(result), writer.late(self._reading, effect.measured_late))
            self._reading = result
        if effect.lateral is not None and self._rig.lateral is not None:
            result = sp.Symbol(f"c_{label}", real=True)
            change = effect.lateral.xreplace(signals) - self._rig.lateral.gain * self._rig.lateral.creepage
            yield writer.equation(writer.expression(result), writer.expression(change))
            self._lateral.append(result)
        for state in effect.states:
            right = writer.expression(state.rate.xreplace(signals))
            if state.limit is not None:
                right += writer.limited(state.symbol, state.limit)
            yield writer.equation(writer.dotted(1, state.symbol), right)

    def motion(self) -> Iterator[Markup]:
        """Yield the equations of the rig, with what the effects left of its signals."""
        rig, writer, motion = self._rig, self._writer, self._rig.motion
        damping = writer.times(writer.expression(motion.damping), writer.dotted(1))
        resisting = [
            damping,
            writer.expression(self._spring_torque()),
            *map(writer.expression, self._torques),
        ]
        bias = [] if motion.bias == 0 else [writer.expression(motion.bias)]
        if motion.inertia is None:
            yield writer.equation(
                writer.expression(sp.Symbol(rig.outputs[0].name)), "<mo>+</mo>".join([*resisting, *bias])
            )
            return
        drive = writer.expression(motion.drive_gain * self._source)
        right = "<mo>+</mo>".join(["<mo>&minus;</mo>".join([drive, *resisting]), *bias])
        yield writer.equation(writer.times(writer.expression(motion.inertia), writer.dotted(2)), right)
        if rig.lateral is not None:
            linear = writer.expression(rig.lateral.gain * rig.lateral.creepage)
            rate = "<mo>+</mo>".join([linear, *map(writer.expression, self._lateral)])
            yield writer.equation(writer.dotted(1, rig.lateral.symbol), rate)
        if self._reading != motion.displacement:
            measured = sp.Symbol(f"{rig.outputs[0].name}_measured")
            yield writer.equation(writer.expression(measured), writer.expression(self._reading))

    def _spring_torque(self) -> sp.Expr:
        return self._rig.motion.stiffness * self._deflection if self._spring is None else self._spring

    def _take(self, letter: str, result: sp.Symbol) -> None:
        if letter == "T":
            self._torques.append(result)
        elif letter == "T_spring":
            self._spring = result
        elif letter == "x_spring":
            self._deflection, self._deflection_rate = result, sp.Symbol(f"{result.name}{_RATE}", real=True)
        elif letter == "u":
            self._source = result
        else:
            self._reading = result


def _lateral_signals(lateral: Lateral) -> dict[sp.Symbol, sp.Expr]:
    return {
        canonical.creepage: lateral.creepage,
        canonical.creep_gain: lateral.gain,
        canonical.lateral_displacement: lateral.displacement,
        canonical.lateral_feedback: lateral.feedback,
    }


class _Printer(MathMLPresentationPrinter):  # type: ignore[misc]
    """sympy's MathML with dots for rates, and whole words below a letter."""

    def _print_Symbol(self, sym: sp.Symbol, style: str = "plain") -> Any:  # noqa: N802
        name = sym.name.removesuffix(_RATE)
        if name != sym.name:
            over = self.dom.createElement("mover")
            over.appendChild(self._print_Symbol(sp.Symbol(name), style))
            dot = self.dom.createElement("mo")
            dot.appendChild(self.dom.createTextNode("\u02d9"))
            over.appendChild(dot)
            return over
        letter, _, words = name.partition("_")
        if _SPACE not in words and "_" not in words:
            return super()._print_Symbol(sp.Symbol(name), style)
        below = self.dom.createElement("msub")
        below.appendChild(super()._print_Symbol(sp.Symbol(letter), style))
        text = self.dom.createElement("mtext")
        text.appendChild(self.dom.createTextNode(words.replace("_", ", ").replace(_SPACE, "\u00a0")))
        below.appendChild(text)
        return below

    def _print_Float(self, e: sp.Float) -> Any:  # noqa: N802
        return self._print_Symbol(sp.Symbol(f"{float(e):.4g}"))

    def _print_positive_part(self, expression: sp.Expr) -> Any:
        return self._print(sp.Function("max")(sp.Integer(0), expression.args[0]))


class _Writer:
    """Writes pieces of equations; every name from a declaration passes through sympy's printer, which escapes it."""

    def __init__(self, rig: Rig) -> None:
        motion = rig.motion
        name = (rig.outputs if rig.is_driven else rig.inputs)[0].name
        # Without assumptions, so that a rig's own "x" is not taken for the effects' displacement from rest.
        displacement, rate = sp.Symbol(name), sp.Symbol(f"{name}{_RATE}")
        self._displacement = displacement
        self._printer = _Printer()
        self._symbols: dict[sp.Symbol, sp.Expr] = {
            motion.displacement: displacement,
            motion.velocity: rate,
            canonical.x: displacement - motion.rest,
            canonical.v: rate,
            canonical.k: motion.stiffness,
        }
        if motion.inertia is not None:
            self._symbols[canonical.m] = motion.inertia

    def expression(self, expression: sp.Expr) -> str:
        """Return an expression of declared symbols."""
        text = str(self._printer.doprint(expression.xreplace(self._symbols)))
        return text.replace("<mo>-</mo>", "<mo>&minus;</mo>").replace("<mo>&InvisibleTimes;</mo>", _TIMES)

    def dotted(self, times: int, symbol: sp.Symbol | None = None) -> str:
        """Return the first or second rate of the motion, or of a symbol."""
        inside = self.expression(self._displacement if symbol is None else symbol)
        dots = "\u02d9" if times == 1 else "\u00a8"
        return f"<mover>{inside}<mo>{dots}</mo></mover>"

    def times(self, first: str, second: str) -> str:
        """Return the product of a symbol and something."""
        return f"<mrow>{first}{_TIMES}{second}</mrow>"

    def late(self, signal: sp.Expr, delay: sp.Expr) -> str:
        """Return a signal some time ago."""
        return (
            f"{self.expression(signal)}<mo>(</mo><mi>t</mi><mo>&minus;</mo>{self.expression(delay)}<mo>)</mo>"
        )

    def limited(self, state: sp.Symbol, limit: sp.Expr) -> str:
        """Return the range that a state cannot leave."""
        inside = f"<mo>|</mo>{self.expression(state)}<mo>|</mo><mo>&le;</mo>{self.expression(limit)}"
        return f"<mo>,</mo><mspace width='1em'/>{inside}"

    def equation(self, left: str, right: str) -> Markup:
        """Return ``left = right`` as a block."""
        return Markup(f'<math display="block"><mrow>{left}<mo>=</mo>{right}</mrow></math>')

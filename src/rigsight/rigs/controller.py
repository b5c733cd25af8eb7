"""What does the controller of a drive compute? Its law in units of the drive's signal, by parts that effects can change."""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from rigsight.effects import Effect, symbols
from rigsight.effects.symbols import derivative, positive_part
from rigsight.rigs.mechanism import Mechanism
from rigsight.rigs.parts import Drive, reading_symbol

_INSIDE = sp.Symbol("inside the limits", real=True)


@dataclass(frozen=True)
class Controller:
    """Law by which a drive reacts to the motion, in units of its signal, before the limits of this signal.

    Attributes
    ----------
    output
        What the controller puts out.
    error
        Its output at standstill: proportional to goal less reading. The whole output where that does not read the motion.
    command
        The part of the output that follows from the recorded inputs.
    in_force
        Whether the law is the drive's force, as in a position drive of a simulator, and not its signal. Delays and lags of the
        drive act on the goal alone then.
    limits
        The drive's signal as a function of the output, see `limited`.
    """

    output: sp.Expr
    error: sp.Expr
    command: sp.Expr
    in_force: bool
    limits: sp.Expr = _INSIDE

    def limited(self, output: sp.Expr) -> sp.Expr:
        """Return the signal of the drive for an output of the controller."""
        return self.limits.xreplace({_INSIDE: output})

    def suits(self, effect: Effect) -> bool:
        """Return False for an effect of the drive under another name, or of this controller."""
        rates = [derivative(state.rate, symbols.command) for state in effect.states]
        filters = effect.command is not None and not any(rate.has(symbols.command) for rate in rates)
        if effect.command_delay is not None or filters:
            return not self.in_force  # There it is a delay or a lag of the drive.
        reads_command = effect.reads(symbols.command)
        if not effect.states and not reads_command and self.error == self.output:
            return self.in_force  # Else it is a dead zone or a saturation of the drive.
        if reads_command or effect.reads(symbols.error):
            return True
        # Of the output alone: an integral of it beside that of the error, and a saturation beside that of the drive.
        return self.error != self.output if effect.states else self.in_force


def controller_of(mechanism: Mechanism, drive: Drive) -> Controller | None:
    """Return the law by which a drive follows a recorded input and reacts to the motion; None for a drive that does not."""
    signal = mechanism.written_out(drive.signal)
    inputs = {sp.Symbol(name, real=True) for name in mechanism.inputs}
    if not signal.free_symbols & inputs:
        return None
    if signal.free_symbols & _motion(mechanism):
        law, limits = _inside_limits(signal)
        return Controller(*_parts(mechanism, law, inputs), in_force=False, limits=limits)
    own = sp.Symbol(drive.name, real=True)
    # Limits of the force stay where they are: what changes inside them is the drive's own signal.
    force, _ = _inside_limits(mechanism.written_out(drive.force))
    gain = derivative(force, own)
    if gain == 0 or gain.free_symbols & (_motion(mechanism) | {own}):
        return None
    law = sp.expand(force / gain)
    if not law.free_symbols & {c.symbol for c in mechanism.free}:
        return None
    return Controller(*_parts(mechanism, law, {own}), in_force=True)


def _motion(mechanism: Mechanism) -> set[sp.Symbol]:
    moving = {symbol for c in mechanism.free for symbol in (c.symbol, c.rate)}
    return moving | {reading_symbol(sensor.name) for sensor in mechanism.sensors}


def _parts(mechanism: Mechanism, law: sp.Expr, inputs: set[sp.Symbol]) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    rates = {c.rate for c in mechanism.coordinates}
    of_speed = {reading_symbol(s.name) for s in mechanism.sensors if s.reads.free_symbols & rates}
    still = law.xreplace(dict.fromkeys(rates | of_speed, sp.S.Zero))
    error = still if still.free_symbols & _motion(mechanism) else law
    return law, error, sp.expand(law - law.xreplace(dict.fromkeys(inputs, sp.S.Zero)))


def _inside_limits(signal: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
    """Return the law inside ``clip(law, low, high)``, and the clipping as a function of `_INSIDE`."""
    kinks = signal.atoms(positive_part)
    outer = [kink for kink in kinks if kink.args[0].has(positive_part)]
    inner = [kink for kink in kinks if not kink.args[0].has(positive_part)]
    if len(outer) == len(inner) == 1:
        raised = signal.xreplace({outer[0]: sp.S.Zero})
        low = raised.xreplace({inner[0]: sp.S.Zero})
        law = inner[0].args[0] + low
        high = sp.expand(raised - outer[0].args[0])
        above = low + positive_part(_INSIDE - low)
        if not (low.free_symbols | high.free_symbols) & law.free_symbols:
            return law, above - positive_part(above - high)
    return signal, _INSIDE

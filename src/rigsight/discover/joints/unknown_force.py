"""An unknown force, declared as an effect: it resists a joint, and its time history is a state."""

from __future__ import annotations

import sympy as sp

from rigsight.effects import Effect
from rigsight.effects.effect import Energy, GainTrend, Place, Signature, State
from rigsight.rigs import Joint
from rigsight.simulate import Structure
from rigsight.simulate.equations.binder import state_symbol
from rigsight.simulate.equations.structure import input_symbols

_FORCE = sp.Symbol("missing_force", real=True)
_RATE = sp.Symbol("missing_force_rate", real=True)

UNKNOWN_FORCE = Effect(
    name="missing_force",
    place=Place.DYNAMICS,
    summary="A force of unknown shape over time resists the motion.",
    parameters=(),
    energy=Energy.ACTIVE,
    signature=Signature(gain_trend=GainTrend.STEADY),
    torque=_FORCE,
    states=(State(_FORCE, _RATE, "force"), State(_RATE, sp.S.Zero, "force time^-1")),
)
"""An observer adds noise to the second derivative of the force; without it the force is a straight line over time."""


def force_states(structure: Structure, effect: Effect) -> tuple[int, int]:
    """Return the indices of an unknown force and of its rate among the states of a structure."""
    force, rate = (structure.states.index(state_symbol(effect, symbol)) for symbol in (_FORCE, _RATE))
    return force, rate


def joint_motion(structure: Structure, joint: Joint) -> tuple[sp.Expr, sp.Expr]:
    """Return the motion of a joint from its rest and its velocity, in the structure's symbols."""
    mechanism = structure.rig.mechanism
    bound: dict[sp.Symbol, sp.Expr] = {
        sp.Symbol(name, real=True): symbol
        for name, symbol in zip(structure.names, structure.parameter_symbols, strict=True)
    }
    for coordinate in mechanism.prescribed:
        value, rate, _ = input_symbols(mechanism.inputs.index(str(coordinate.prescribed_by)))
        bound |= {coordinate.symbol: value, coordinate.rate: rate}
    return (joint.motion - joint.rest).xreplace(bound), mechanism.rate(joint.motion).xreplace(bound)

"""Characteristic size of a parameter from the place where it occurs alone: a stiffness scales with force over motion."""

from __future__ import annotations

import sympy as sp

from rigsight.rigs.mechanism import Mechanism

_OF_A_JOINT = {"stiffness": "force x^-1", "damping": "force time x^-1", "rest": "x", "force": "force"}


def sized_by(name: str, unit: str, mechanism: Mechanism) -> str:
    """Return the dimension (`rigsight.units`) of a parameter on a rig with one joint; ``""`` where nothing sets its size."""
    if len(mechanism.joints) == 1 and len(mechanism.coordinates) == 1:
        joint = mechanism.joints[0]
        for part, dimension in _OF_A_JOINT.items():
            if _is(getattr(joint, part), name):
                return dimension
        if mechanism.free and _is(mechanism.mass_matrix[0, 0], name):
            return "force time^2 x^-1"
    return "length" if any(unit == state.unit for state in mechanism.states) else ""


def _is(expression: sp.Expr, name: str) -> bool:
    return expression in (sp.Symbol(name, real=True), -sp.Symbol(name, real=True))

"""Equilibrium of a model at zero input."""

from __future__ import annotations

import numpy as np

from rigsight.export.equations import Exported
from rigsight.simulate import Structure, rest_state
from rigsight.simulate.input_hold import HeldInput, hold_input, together


def state_at_rest(exported: Exported) -> tuple[float, ...]:
    """Return the states at the static equilibrium without input, in order."""
    if exported.rest is None:
        return tuple(0.0 for _ in exported.states)
    rest = rest_state(exported.structure, np.array(exported.values), no_input(exported.structure))
    return tuple(float(value) for value in rest)


def no_input(structure: Structure) -> HeldInput:
    """Return inputs that are zero, of one piece."""
    return together([hold_input(np.zeros(2), 1.0, "foh")] * max(1, len(structure.rig.inputs)))

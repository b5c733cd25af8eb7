"""Where does a model rest at zero input?"""

from __future__ import annotations

import numpy as np

from rigsight.export.equations import Exported
from rigsight.simulate import rest_state
from rigsight.simulate.input_hold import hold_input


def state_at_rest(exported: Exported) -> tuple[float, ...]:
    """Return the states at the static equilibrium without input, in order.

    Parameters
    ----------
    exported
        The model.

    Raises
    ------
    InputError
        If the engine's kernels cannot be kept on disk.
    """
    if exported.rest is None:
        return tuple(0.0 for _ in exported.states)
    held = hold_input(np.zeros(2), 1.0, "foh")
    rest = rest_state(exported.structure, np.array(exported.values), held)
    return tuple(float(value) for value in rest)

"""The amplitude of a record for which none is given."""

from __future__ import annotations

import numpy as np

from rigsight.records.plausibility import is_constant
from rigsight.records.record import Record
from rigsight.rigs import Rig


def measured_amplitude(record: Record, rig: Rig) -> tuple[float, str]:
    """Return the amplitude of a record in the unit of a signal, and that signal.

    This is the height of a step, or half the range of another input (the first that moves of several); for a free motion, half
    the range of the first recorded output.
    """
    inputs = [signal.name for signal in rig.inputs]
    outputs = [signal.name for signal in rig.outputs if signal.name in record]
    moving = [name for name in inputs if not is_constant(record[name])]
    if record.kind == "step" and not moving:
        # The record begins with the step.
        name = max(inputs, key=lambda own: abs(float(record[own][0])))
        return abs(float(record[name][0])), name
    name = (moving or outputs or inputs)[0]
    # Not the deviation from mean or median, which are not zero for a sweep that begins slowly.
    spanned = float(np.ptp(record[name]))
    return (spanned if moving and record.kind == "step" else 0.5 * spanned), name

"""Free run of a model with the input of a record, from the initial state of the record.

The initial state is estimated: nothing but the states at the first sample is fitted to the measured outputs (to those of every
window, where a rig drifts). A record cut out of a longer measurement does not begin at rest, and the internal state of a
hysteresis cannot be measured; the remaining error is that of the model. Offsets of the model (psi_off, y_off) stay as they are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rigsight.errors import SimulationError
from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.metrics import nrmse
from rigsight.records import Record
from rigsight.simulate import simulate
from rigsight.simulate.model import Model

_TOLERANCE, _EVALUATIONS = 1e-5, 60
"""Relative change of the squared error at which states are good enough, and limit: hysteresis that does not forget needs many."""
_STATE_ACCURACY = 1e-3
"""Relative accuracy of the simulations that estimate a state; the one that is scored is a thousand times better."""


@dataclass(frozen=True, eq=False)
class FreeRun:
    """A model on a record."""

    simulated: Record  # the whole record with simulated outputs, from the estimated first state
    # True if the initial states were fitted; False where the fixed steps of a fit cannot follow the model, so
    # that the states are those guessed from the first samples.
    estimated: bool
    # Output -> RMS(measured - simulated) / RMS(measured - mean), over all windows, each from its own state.
    nrmse: dict[str, float]


def free_run(
    model: Model, record: Record, windows: Sequence[Record], output_noise: Mapping[str, float]
) -> FreeRun:
    """Simulate a record and score it."""
    structure, rig = model.structure, model.structure.rig
    scales = characteristic_scales(rig, windows, model.values)
    found = GreyBoxFit(structure, windows, scales, output_noise, _STATE_ACCURACY).fit(
        model.values, [], max_evaluations=_EVALUATIONS, tolerance=_TOLERANCE, finish=False
    )
    states = found.rig_states

    def run(window: Record, index: int) -> Record:
        ran = simulate(structure, model.values, window, states[index])
        return ran.with_signals(**{name: ran[name] + own for name, own in found.offsets(index).items()})

    runs = [run(window, index) for index, window in enumerate(windows)]
    whole = runs[0] if len(windows) == 1 else run(record, 0)
    errors = {}
    for signal in rig.outputs:
        if signal.name in record:
            measured, simulated = (np.concatenate([r[signal.name] for r in part]) for part in (windows, runs))
            if not np.all(np.isfinite(simulated)):
                raise SimulationError(f"The simulated {signal.name} diverges.")
            errors[signal.name] = nrmse(measured - simulated, measured)
    return FreeRun(whole, bool(np.isfinite(found.cost)), errors)

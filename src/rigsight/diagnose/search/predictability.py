"""Can the motion be predicted from the input for as long as the records last?"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from rigsight.diagnose.fitting.fit_context import FitContext, FittedModel
from rigsight.diagnose.policy import SEARCH
from rigsight.errors import SimulationError
from rigsight.identify.fit.windows import leading_output
from rigsight.records.record import Record
from rigsight.records.signals import is_constant
from rigsight.simulate import parameter_vector, record_input, record_values, simulate_outputs

_ACCURACY = 1e-5


def growth_of_disturbances(
    context: FitContext, reidentified: FittedModel, model: FittedModel, rng: np.random.Generator
) -> float:
    """Return the effect on a model of disturbances that would change the motion of the linear equations by the noise floor.

    With play and stops a small change can lead to a different motion; then even the true model has a large error on a whole
    record, whatever its initial state.
    """
    rig = context.rig
    if not rig.is_driven or not rig.inputs:
        return 0.0
    moving = {} if rig.has_one_motion else _sizes_of_inputs(context)
    sizes = moving or {rig.inputs[0].name: context.scales["input"]}
    largest = 0.0
    for index in range(len(context.scoring)):
        for source in list(sizes) * math.ceil(SEARCH.predictability_draws / len(sizes)):
            try:
                grown = _growth(context, reidentified, model, index, source, sizes[source], rng)
            except SimulationError:
                return 0.0
            largest = max(largest, grown)
    return largest


def _sizes_of_inputs(context: FitContext) -> dict[str, float]:
    """Return the spread of each input that moves."""
    shown = {s.name: np.concatenate([r[s.name] for r in context.records]) for s in context.rig.inputs}
    return {name: float(np.std(samples)) for name, samples in shown.items() if not is_constant(samples)}


def _growth(
    context: FitContext,
    reidentified: FittedModel,
    model: FittedModel,
    index: int,
    source: str,
    size: float,
    rng: np.random.Generator,
) -> float:
    rig, record = context.rig, context.scoring[index]
    seen = [signal.name for signal in rig.outputs if signal.name in record]
    if rig.has_one_motion:
        seen = [leading_output(rig, [record])]
    floors = np.array([context.noise[s.name] if s.name in seen else np.inf for s in rig.outputs])
    pole = np.exp(-record.dt / context.scales["time"])
    disturbance = lfilter([1.0 - pole], [1.0, -pole], rng.standard_normal(record.n_samples))
    disturbance *= 1e-3 * size / float(np.std(disturbance))
    through = _change(reidentified, index, record, source, disturbance, floors)
    if through == 0.0:
        return 0.0  # an input that this record's sensors do not see
    return _change(model, index, record, source, disturbance / through, floors)


def _change(
    model: FittedModel,
    index: int,
    record: Record,
    source: str,
    disturbance: NDArray[np.float64],
    floors: NDArray[np.float64],
) -> float:
    """Return the largest RMS change, in noise floors of the outputs, that a disturbance beside an input makes."""
    structure = model.fit.structure
    p = parameter_vector(structure, record_values(structure, model.fit.values, record))
    calm, disturbed = (
        simulate_outputs(
            structure,
            record_input(structure, record.with_signals(**{source: record[source] + extra})),
            p,
            model.initial_states[index],
            record.n_samples,
            _ACCURACY,
        )
        for extra in (0.0, disturbance)
    )
    return float(np.max(np.sqrt(np.mean((disturbed - calm) ** 2, axis=0)) / floors))

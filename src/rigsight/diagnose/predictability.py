"""Can the motion be predicted from the input for as long as the records last?"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from rigsight.diagnose.windows import leading_output
from rigsight.diagnose.workbench import Scored, Workbench
from rigsight.errors import SimulationError
from rigsight.records.record import Record
from rigsight.simulate import parameter_vector, record_input, record_values, simulate_outputs

PREDICTABLE = 3.0
"""Growth of a disturbance, beside what it does to the linear rig, up to which free run is a fair test; an assumption."""
_ACCURACY = 1e-5
_DRAWS = 4


def growth_of_disturbances(
    bench: Workbench, linear: Scored, model: Scored, rng: np.random.Generator
) -> float:
    """Return what disturbances do to a model that would change the linear equations' motion by the noise floor.

    Play and stops make another motion of a small change now and then; then even the true model leaves much of a whole record,
    whatever its first state.

    Parameters
    ----------
    bench
        Records and noise.
    linear
        The equations without an effect.
    model
        The model in question.
    rng
        Source of the disturbances, white up to the natural frequency.

    Returns
    -------
    The largest RMS change of the leading output over a scored record, in units of its noise floor; 1 for the linear equations, 0
    where a model cannot be simulated.
    """
    if not bench.rig.is_driven or not bench.rig.inputs:
        return 0.0
    largest = 0.0
    for index, record in enumerate(bench.scoring):
        for _ in range(_DRAWS):
            try:
                largest = max(largest, _growth(bench, linear, model, index, record, rng))
            except SimulationError:
                return 0.0
    return largest


def _growth(
    bench: Workbench, linear: Scored, model: Scored, index: int, record: Record, rng: np.random.Generator
) -> float:
    source, output = bench.rig.inputs[0].name, leading_output(bench.rig, [record])
    column = [signal.name for signal in bench.rig.outputs].index(output)
    pole = np.exp(-record.dt / bench.scales["time"])
    disturbance = lfilter([1.0 - pole], [1.0, -pole], rng.standard_normal(record.n_samples))
    disturbance *= 1e-3 * bench.scales["input"] / float(np.std(disturbance))
    through = _change(linear, index, record, source, disturbance, column)
    if through == 0.0:
        return 0.0  # an input that this record's sensors do not see
    noise = bench.noise[output]
    return _change(model, index, record, source, disturbance * (noise / through), column) / noise


def _change(
    model: Scored, index: int, record: Record, source: str, disturbance: NDArray[np.float64], column: int
) -> float:
    """Return the RMS change of an output that a disturbance beside the input makes."""
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
        )[:, column]
        for extra in (0.0, disturbance)
    )
    return float(np.sqrt(np.mean((disturbed - calm) ** 2)))

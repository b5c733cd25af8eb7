"""What does noise of the measured inputs leave in a free run?

A free run is driven by the input as it was measured. Noise that its sensor adds does not reach the rig, so it shows in the error.
Through a resonance it becomes a few slow swings, which nearly any term imitates.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rigsight.errors import SimulationError
from rigsight.identify import FitResult
from rigsight.metrics import rms
from rigsight.records.record import Record
from rigsight.records.signals import roughness
from rigsight.simulate import simulate

_DRAWS = 4
"""Of the noise: their mean square is known to a tenth or better where records hold some fifty swings."""


def error_of_inputs(fit: FitResult, records: Sequence[Record], noise: Mapping[str, float]) -> float:
    """Return the free-run error in noise floors that white noise of the inputs leaves, at most.

    Its size is that of the fastest changes of each input. They may be part of what moves the rig: then it leaves less.
    """
    rng, squares = np.random.default_rng(0), list[float]()
    outputs = {s.name: noise[s.name] for s in fit.structure.rig.outputs if s.name in noise}
    inputs = [s.name for s in fit.structure.rig.inputs]
    try:
        for record in records:
            driven = {name: record[name] for name in inputs if name in record}
            # The values alone say where a record begins.
            without = simulate(fit.structure, fit.values, record)
            for _ in range(_DRAWS):
                drawn = {n: u + rng.normal(scale=roughness(u), size=u.size) for n, u in driven.items()}
                run = simulate(fit.structure, fit.values, record.with_signals(**drawn))
                squares += [
                    rms((run[n] - without[n]) / floor) ** 2 * record.n_samples
                    for n, floor in outputs.items()
                    if n in record
                ]
    except SimulationError:
        return 0.0
    n_samples = _DRAWS * sum(r.n_samples for r in records for name in outputs if name in r)
    return float(np.sqrt(np.sum(squares) / n_samples))

"""Every effect of the catalogue: its own simulation returns its parameters."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.effects import CATALOGUE, Effect
from rigsight.excitation import linear_sweep
from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.records.record import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate
from rigsight.units import characteristic_value

VALUES = {"gain": 2.0, "m": 1.5, "d": 4.0, "k": 300.0, "x_off": 1e-4, "force_off": 0.0}
FREE = ("m", "d", "k", "x_off")
DT = 0.01
WRONG = 1.05
NOISE = 1e-3
"""Noise in shares of the motion: small enough for every effect to be seen, far above the integrator's error."""


def excited(amplitude: float) -> Record:
    t = np.arange(1500) * DT
    return Record("sweep", DT, {"u": linear_sweep(t, amplitude, 1.0, 30.0)}, {}, hold="zoh")


def true_values(effect: Effect, scales: dict[str, float]) -> dict[str, float]:
    values = {p.name: p.default for p in effect.parameters if p.default is not None}
    for parameter in effect.parameters:
        if parameter.fitted and parameter.name not in effect.special_cases:
            size = characteristic_value(parameter.dimension, scales)
            values[parameter.name] = parameter.starts[0] * size
    return values


@pytest.mark.parametrize("effect", CATALOGUE, ids=lambda effect: effect.name)
def test_its_own_simulation_returns_its_parameters(effect: Effect) -> None:
    rng = np.random.default_rng(4)
    linear = [simulate(compose(AXIS), VALUES, excited(a)) for a in (0.4, 1.0)]
    scales = characteristic_scales(AXIS, linear, VALUES)
    structure = compose(AXIS, [effect], effect.special_cases)
    truth = {**VALUES, **true_values(effect, scales)}
    size = NOISE * scales["x"]
    records = []
    for amplitude in (0.4, 1.0):
        record = simulate(structure, truth, excited(amplitude))
        records.append(record.with_signals(x=record["x"] + size * rng.standard_normal(record.n_samples)))
    own = [p.name for p in effect.parameters if p.fitted and p.name not in effect.special_cases]
    free = [*FREE, *own]
    start = {name: value * (WRONG if name in free else 1.0) for name, value in truth.items()}
    result = GreyBoxFit(structure, records, scales, {"x": size}).fit(start, free)
    assert result.weighted_rms == pytest.approx(1.0, abs=0.05)
    for name in free:
        assert abs(result.values[name] - truth[name]) < 4.5 * result.standard_errors[name], name
    for parameter in effect.parameters:
        if parameter.name in own:
            # A true value of zero is judged by the size that such a parameter has.
            known = abs(truth[parameter.name]) or characteristic_value(parameter.dimension, scales)
            assert result.standard_errors[parameter.name] < 0.3 * known, f"{parameter.name} is not seen"

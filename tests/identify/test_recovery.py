"""Every effect of the catalogue: its own simulation returns its parameters."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.effects import CATALOGUE, Effect
from rigsight.excitation import linear_sweep
from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.records.record import Record
from rigsight.rigs import AXIS, RUNNING_GEAR
from rigsight.simulate import compose, simulate
from rigsight.units import characteristic_value

VALUES = {"gain": 2.0, "m": 1.5, "d": 4.0, "k": 300.0, "x_off": 1e-4, "force_off": 0.0}
FREE = ("m", "d", "k", "x_off")
GEAR_VALUES = {
    "v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27, "J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "l_0": 0.25, "c_y": 0.98,
    "psi_off": 1e-4, "y_off": 1e-4,
}  # fmt: skip
GEAR_FREE = ("J_z", "k_c", "k_d", "l_0", "c_y", "psi_off", "y_off")
DRIVEN_HARDER = {"gravity_pendulum": 50.0}
"""Effects that this axis shows at large angles only."""
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
    rig, values, rig_free = (
        (AXIS, VALUES, FREE) if AXIS.offers(effect) else (RUNNING_GEAR, GEAR_VALUES, GEAR_FREE)
    )
    amplitudes = [a * DRIVEN_HARDER.get(effect.name, 1.0) for a in (0.4, 1.0)]
    linear = [simulate(compose(rig), values, excited(a)) for a in amplitudes]
    scales = characteristic_scales(rig, linear, values)
    structure = compose(rig, [effect], effect.special_cases)
    truth = {**values, **true_values(effect, scales)}
    noise = {rig.outputs[0].name: NOISE * scales["x"]}
    if rig.lateral is not None:
        noise[rig.lateral.symbol.name] = NOISE * scales["length"]
    records = []
    for amplitude in amplitudes:
        record = simulate(structure, truth, excited(amplitude))
        noisy = {name: record[name] + rng.normal(scale=s, size=record.n_samples) for name, s in noise.items()}
        records.append(record.with_signals(**noisy))
    own = [p.name for p in effect.parameters if p.fitted and p.name not in effect.special_cases]
    free = [*rig_free, *own]
    start = {name: value * (WRONG if name in free else 1.0) for name, value in truth.items()}
    result = GreyBoxFit(structure, records, scales, noise).fit(start, free)
    assert result.weighted_rms == pytest.approx(1.0, abs=0.05)
    for name in free:
        assert abs(result.values[name] - truth[name]) < 4.5 * result.standard_errors[name], name
    for parameter in effect.parameters:
        if parameter.name in own:
            # A true value of zero is judged by the size that such a parameter has.
            known = abs(truth[parameter.name]) or characteristic_value(parameter.dimension, scales)
            assert result.standard_errors[parameter.name] < 0.3 * known, f"{parameter.name} is not seen"

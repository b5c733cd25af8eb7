"""The size of a force that nobody recorded comes back from what the true model leaves."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from rigsight.diagnose.noise.detection import disturbance
from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.identify.fit.windows import Observer
from rigsight.records import Record
from rigsight.rigs import AXIS, ELEMENT
from rigsight.simulate import compose, simulate

DT = 2e-3
T = DT * np.arange(6000)
NOISE = 1e-6


@pytest.mark.parametrize(("stiffness", "bandwidth"), [(200.0, None), (0.0, 20.0), (0.0, 60.0)])
@pytest.mark.parametrize("size", [0.05, 0.5])
def test_a_force_beside_the_drive_has_its_size(
    stiffness: float, bandwidth: float | None, size: float
) -> None:
    rng = np.random.default_rng(1)
    values = {"gain": 1.0, "m": 2.0, "d": 4.0, "k": stiffness, "x_off": 0.0, "force_off": 0.0}
    force = lfilter([1.0], [1.0, -0.98], rng.standard_normal(T.size))
    force *= size / float(np.std(force))
    u = 3.0 * np.sin(5.0 * T)
    x = simulate(compose(AXIS), values, Record("r", DT, {"u": u + force}, {}))["x"]
    record = Record("r", DT, {"u": u, "x": x + NOISE * rng.standard_normal(T.size)}, {})
    if bandwidth is not None:
        (record,) = Observer(("x",), bandwidth).following([record])
    scales = characteristic_scales(AXIS, [record], values)
    fit = GreyBoxFit(compose(AXIS), [record], scales, {"x": NOISE}).fit(values, [])
    found = disturbance(AXIS, values, [record], [fit.residuals[0][:, 0]], NOISE, bandwidth)
    assert found is not None
    assert found.unit == "N"
    assert found.std == pytest.approx(size, rel=0.25)


def test_noise_of_the_sensor_is_no_force() -> None:
    values = {"gain": 1.0, "m": 2.0, "d": 4.0, "k": 200.0, "x_off": 0.0, "force_off": 0.0}
    noise = NOISE * np.random.default_rng(2).standard_normal(T.size)
    record = Record("r", DT, {"u": np.sin(T), "x": np.sin(T)}, {})
    found = disturbance(AXIS, values, [record], [noise], NOISE, None)
    assert found is None or found.std < 1e-3


def test_a_prescribed_motion_has_none() -> None:
    record = Record("r", DT, {"x": T, "force": T}, {})
    assert disturbance(ELEMENT, {"k": 1.0, "d": 1.0, "force_off": 0.0}, [record], [T], 1e-3, None) is None

"""Rigs, parameter values and records that the simulation tests share; kernels are compiled once per structure."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pytest
from numpy.typing import NDArray

from rigsight.effects import effect_named
from rigsight.records.record import Hold, Record
from rigsight.rigs import AXIS, RUNNING_GEAR
from rigsight.simulate import Structure, compose

GEAR_VALUES: Mapping[str, float] = {
    "v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27,
    "J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "l_0": 0.25, "c_y": 0.98, "psi_off": 0.0, "y_off": 0.0,
}  # fmt: skip
HYSTERESIS_SETS: Mapping[str, Mapping[str, float]] = {
    "R": {**GEAR_VALUES, "A": 1.0, "a": 0.48, "beta": 7362.0, "gamma": -7164.0},
    "B": {**GEAR_VALUES, "A": 1.0, "a": 0.75, "beta": 7400.0, "gamma": -7400.0},
    "P": {**GEAR_VALUES, "A": 0.25, "a": 0.75, "beta": 7700.0, "gamma": -7700.0},
    "stiff": {
        **GEAR_VALUES, "J_z": 0.58, "k_d": 0.5, "k_c": 700.0,
        "A": 1.0, "a": 0.09, "beta": 2660.0, "gamma": -960.0,
    },
}  # fmt: skip
AXIS_VALUES: Mapping[str, float] = {
    "gain": 1.0,
    "m": 1.0,
    "d": 0.6,
    "k": 100.0,
    "x_off": 0.0,
    "force_off": 0.0,
}

MakeRecord = Callable[..., Record]


@pytest.fixture(scope="session")
def hysteretic() -> Structure:
    return compose(RUNNING_GEAR, [effect_named("bouc_wen_hysteresis")], {"n": 1.0})


@pytest.fixture(scope="session")
def axis() -> Structure:
    return compose(AXIS)


@pytest.fixture(scope="session")
def axis_with_friction() -> Structure:
    return compose(AXIS, [effect_named("coulomb_friction")])


@pytest.fixture(scope="session")
def axis_with_delay() -> Structure:
    return compose(AXIS, [effect_named("input_delay")])


@pytest.fixture(scope="session")
def hysteresis_sets() -> Mapping[str, Mapping[str, float]]:
    return HYSTERESIS_SETS


@pytest.fixture(scope="session")
def axis_values() -> Mapping[str, float]:
    return AXIS_VALUES


@pytest.fixture(scope="session")
def sweep() -> NDArray[np.float64]:
    """A 1 A logarithmic sweep, 1e-3 to 640 rad/s, compressed to 4,000 samples of 5 ms."""
    return log_sweep(4000, 5e-3)


def log_sweep(n_samples: int, dt: float, first: float = 1e-3, last: float = 640.0) -> NDArray[np.float64]:
    time = dt * np.arange(n_samples)
    scale = time[-1] / np.log(last / first)
    return np.sin(first * scale * np.expm1(time / scale))


@pytest.fixture(scope="session")
def make_record() -> MakeRecord:
    def make(samples: NDArray[np.float64], dt: float = 5e-3, hold: Hold = "foh") -> Record:
        return Record(name="test", dt=dt, signals={"u": samples}, units={"u": "A"}, hold=hold)

    return make


def relative_error(simulated: NDArray[np.float64], exact: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean((simulated - exact) ** 2) / np.mean(exact**2)))


@pytest.fixture(scope="session")
def error_of() -> Callable[[NDArray[np.float64], NDArray[np.float64]], float]:
    """Relative root mean square error of simulated against exact samples."""
    return relative_error

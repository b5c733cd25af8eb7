"""Records of axes whose governing equations are known."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import pytest

from rigsight.campaign import Campaign
from rigsight.discover.records import DiscoveryData
from rigsight.discover.terms import known_terms
from rigsight.records import Record
from rigsight.rigs import AXIS, RIGS, Rig
from rigsight.simulate import compose, simulate

DT = 5e-3
LINEAR = {"gain": 0.8, "m": 0.5, "d": 1.5, "k": 120.0, "x_off": 0.0, "force_off": 0.0}


@dataclass(frozen=True)
class Truth:
    """The effects of an axis and their parameters; a stiffness given here replaces the linear one."""

    effects: tuple[str, ...]
    values: dict[str, float]


TRUTHS = {
    "linear": Truth((), {}),
    "cubic": Truth(("cubic_stiffness",), {"k_3": 4e5}),
    "Coulomb": Truth(("coulomb_friction",), {"T_c": 0.06}),
    "quadratic": Truth(("quadratic_damping",), {"c_2": 12.0}),
    "Bouc-Wen, n = 1": Truth(
        ("bouc_wen_hysteresis",), {"k": 300.0, "a": 0.25, "A": 1.0, "beta": 1200.0, "gamma": 500.0, "n": 1.0}
    ),
    # beta and gamma of the same loop height as for n = 1.
    "Bouc-Wen, n = 1.5": Truth(
        ("bouc_wen_hysteresis",),
        {"k": 300.0, "a": 0.25, "A": 1.0, "beta": 1200.0 * 1700**0.5, "gamma": 500.0 * 1700**0.5, "n": 1.5},
    ),
    # The sliders let go from 0.03 to 6 mm, the range that sweeps of these amplitudes pass through.
    "Iwan": Truth(("iwan_hysteresis",), {"k": 600.0, "a": 0.15, "x_s": 1e-2, "q": -0.3}),
    "monomial": Truth(("monomial_x1_v1",), {"c_11": 200.0}),
}


def _sweep(amplitude: float, seconds: float, dt: float = DT) -> np.ndarray:
    t = dt * np.arange(round(seconds / dt))
    ratio = 60.0
    return amplitude * np.sin(seconds / np.log(ratio) * (ratio ** (t / seconds) - 1.0))


def _multisine(amplitude: float, seconds: float, rng: np.random.Generator) -> np.ndarray:
    t = DT * np.arange(round(seconds / DT))
    omega = 2.0 * np.pi * np.arange(1, int(60.0 * seconds / (2.0 * np.pi))) / seconds
    u = np.sum(np.cos(np.outer(t, omega) + rng.uniform(0.0, 2.0 * np.pi, omega.size)), axis=1)
    return amplitude * u / np.std(u)


@pytest.fixture(scope="session")
def make_data() -> Callable[..., tuple[dict[str, float], DiscoveryData]]:
    """Return the true values and the data of an axis: sweeps of several amplitudes, and a multisine that is held out.

    Sweeps have the sample time `DT` unless another is given by their amplitude.
    """

    def make(
        truth: str,
        noise: float,
        amplitudes: tuple[float, ...] = (0.3, 0.6, 1.0),
        seconds: float = 10.0,
        seed: int = 0,
        validation: bool = True,
        sample_times: Mapping[float, float] | None = None,
    ) -> tuple[dict[str, float], DiscoveryData]:
        rng = np.random.default_rng(seed)
        known = known_terms()
        structure = compose(AXIS, [known[name] for name in TRUTHS[truth].effects])
        values = {**LINEAR, **TRUTHS[truth].values}
        dts = {a: (sample_times or {}).get(a, DT) for a in amplitudes}
        inputs = [(f"sweep_{a}", "estimation", dts[a], _sweep(a, seconds, dts[a])) for a in amplitudes]
        if validation:
            inputs.append(("multisine", "validation", DT, _multisine(0.45, 0.6 * seconds, rng)))
        records = []
        for name, role, dt, u in inputs:
            record = simulate(
                structure, values, Record(name=name, dt=dt, signals={"u": u}, units={}, role=role)
            )
            records.append(record.with_signals(x=record["x"] + rng.normal(scale=noise, size=u.size)))
        return values, DiscoveryData(Campaign("axis", AXIS, {"gain": 0.8}, {}, tuple(records)), {"x": noise})

    return make


@pytest.fixture
def sweep() -> Callable[[float, float], np.ndarray]:
    """Return a logarithmic sweep of an amplitude and a duration [s]."""
    return _sweep


@pytest.fixture(scope="session")
def drive_train() -> Rig:
    """Return two masses with a shaft between, a sensor at each."""
    return RIGS["drive_train"]


@pytest.fixture(scope="session")
def two_link_arm() -> Rig:
    """Return two links in the vertical plane with a motor at each joint."""
    return RIGS["two_link_arm"]

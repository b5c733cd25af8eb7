"""Scored models without a simulation, for rules that only look at held-out errors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from rigsight.diagnose.fit_context import FittedModel
from rigsight.effects import Effect, effect_named
from rigsight.identify import FitResult
from rigsight.records.record import Record
from rigsight.rigs import AXIS, RIGS, Rig
from rigsight.rigs.reading.rig_file import rig_of_text
from rigsight.simulate import compose, simulate

MakeScored = Callable[..., FittedModel]
TWO_MASSES = """
name = "two_masses"
summary = "Two carts, each with a motor, and a spring between them."
[inputs.f_1]
unit = "N"
[inputs.f_2]
unit = "N"
[parameters.m]
unit = "kg"
[parameters.k]
unit = "N/m"
[parameters.c]
unit = "N/m"
[parameters.d]
unit = "N s/m"
[coordinates.x_1]
unit = "m"
[coordinates.x_2]
unit = "m"
[energy]
kinetic = "m*d(x_1)^2/2 + m*d(x_2)^2"
[joints.first]
motion = "x_1"
stiffness = "k"
damping = "d"
[joints.between]
motion = "x_1 - x_2"
stiffness = "c"
damping = "d"
[joints.second]
motion = "x_2"
stiffness = "k"
damping = "d"
[drives.motor_1]
signal = "f_1"
force = "motor_1"
along = "x_1"
[drives.motor_2]
signal = "f_2"
force = "motor_2"
along = "x_2"
[sensors.first_place]
reads = "x_1"
unit = "m"
[sensors.second_place]
reads = "x_2"
unit = "m"
"""


@dataclass(frozen=True)
class Train:
    """A drive train whose records can be drawn."""

    rig: Rig = RIGS["drive_train"]
    noise: float = 1e-4
    dt: float = 5e-3
    n_samples: int = 1200
    values: Mapping[str, float] = field(
        default_factory=lambda: {
            "k_t": 0.05, "J_m": 1e-4, "J_l": 5e-4, "k_s": 0.4, "d_s": 1e-3, "d_m": 5e-4, "d_l": 1e-3, "k_l": 0.1,
        }
    )  # fmt: skip

    def records(
        self, effects: Sequence[Effect] = (), values: Mapping[str, float] | None = None
    ) -> tuple[Record, ...]:
        """Return two records to fit and one to score, with white noise on both angles."""
        rng = np.random.default_rng(4)
        t = self.dt * np.arange(self.n_samples)
        structure = compose(self.rig, effects)
        records = []
        for name, amplitude, role in (("large", 1.0, False), ("small", 0.4, False), ("other", 0.7, True)):
            phases = rng.uniform(0.0, 2.0 * np.pi, 20)
            lines = np.sum(
                [np.cos(2.0 * np.pi * (0.5 + 0.4 * i) * t + p) for i, p in enumerate(phases)], axis=0
            )
            drive = amplitude * lines / np.max(np.abs(lines))
            record = Record(name, self.dt, {"u": drive}, {}, role="validation" if role else "estimation")
            shown = simulate(structure, {**self.values, **(values or {})}, record)
            noisy = {
                s.name: shown[s.name] + self.noise * rng.standard_normal(self.n_samples)
                for s in self.rig.outputs
            }
            records.append(record.with_signals(**noisy))
        return tuple(records)


@pytest.fixture(scope="session")
def train() -> Train:
    """Return the drive train."""
    return Train()


@pytest.fixture(scope="session")
def two_masses() -> Rig:
    """Return a rig of two inputs, two degrees of freedom and two sensors that is linear by itself."""
    return rig_of_text(TWO_MASSES)


@pytest.fixture(scope="session")
def scored() -> MakeScored:
    """Make a model from its residuals in units of the noise floor, or from its RMS alone."""

    def make(
        effects: tuple[str, ...] = (),
        residuals: NDArray[np.float64] | None = None,
        n_free: int = 4,
        error_over_noise: float | None = None,
    ) -> FittedModel:
        chosen = tuple(effect_named(name) for name in effects)
        columns = () if residuals is None else (np.asarray(residuals, dtype=np.float64)[:, None],)
        if error_over_noise is None:
            error_over_noise = float("inf") if residuals is None else float(np.sqrt(np.mean(residuals**2)))
        free = tuple(f"p{i}" for i in range(n_free))
        fit = FitResult(
            structure=compose(AXIS, chosen),
            success=residuals is not None,
            message="",
            values=dict.fromkeys(free, 1.0),
            standard_errors=dict.fromkeys(free, 0.1),
            initial_states=(),
            cost=error_over_noise**2,
            n_samples=1,
            n_evaluations=1,
            free=free,
            covariance=np.eye(n_free),
            residuals=columns,
        )
        return FittedModel(chosen, fit, fit, error_over_noise)

    return make


def with_numbers(model: FittedModel, values: dict[str, float], errors: dict[str, float]) -> FittedModel:
    """Return a scored model with numbers and their standard errors."""
    fit = replace(model.fit, values=values, standard_errors=errors, free=tuple(values), success=True)
    return replace(model, fit=fit)


@pytest.fixture
def friction_models(scored: MakeScored) -> tuple[FittedModel, FittedModel, FittedModel]:
    """Return equations, with Coulomb friction, and with Stribeck friction whose number the records do not determine."""
    reidentified = with_numbers(
        scored((), error_over_noise=20.0), {"m": 1.0, "d": 1.0, "k": 100.0}, dict.fromkeys("mdk", 0.1)
    )
    own = {"m": 1.0, "d": 1.0, "k": 100.0}
    coulomb = with_numbers(
        scored(("coulomb_friction",), residuals=np.full(9, 5.5)),
        {**own, "T_c": 0.5},
        dict.fromkeys([*"mdk", "T_c"], 0.1),
    )
    stribeck = with_numbers(
        scored(("stribeck_friction",), residuals=np.full(9, 5.0)),
        {**own, "T_c": 0.5, "T_s": 1.0, "w_s": 0.1},
        {**dict.fromkeys([*"mdk", "T_c"], 0.1), "T_s": np.inf, "w_s": np.inf},
    )
    return reidentified, coulomb, stribeck

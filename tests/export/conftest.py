"""Models, records and the engine's answer to which every export is held."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from rigsight.effects import CATALOGUE, effect_named
from rigsight.excitation import linear_sweep
from rigsight.records import Hold, Record
from rigsight.rigs import RIGS
from rigsight.simulate import compose, record_input, simulate
from rigsight.simulate.kinks import freeze
from rigsight.simulate.model import Model

DT = 0.01
N_SAMPLES = 161
RIG_VALUES: Mapping[str, Mapping[str, float]] = {
    "running_gear": {
        "v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27,
        "J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "l_0": 0.25, "c_y": 0.98, "psi_off": 0.0, "y_off": 0.0,
    },
    "axis": {"gain": 1.0, "m": 1.0, "d": 0.6, "k": 100.0, "x_off": 0.0, "force_off": 0.0},
    "element": {"d": 2.0, "k": 100.0, "force_off": 0.3},
}  # fmt: skip
EFFECT_VALUES: Mapping[str, Mapping[str, float]] = {
    "bouc_wen_hysteresis": {"A": 1.0, "a": 0.48, "beta": 736.0, "gamma": -716.0, "n": 1.0},
    "iwan_hysteresis": {"a": 0.3, "x_s": 0.01, "q": -0.4},
    "coulomb_friction": {"T_c": 0.1},
    "stribeck_friction": {"T_c": 0.08, "T_s": 0.16, "w_s": 0.02},
    "quadratic_damping": {"c_2": 20.0},
    "position_dependent_damping": {"c_x": 3e4},
    "cubic_stiffness": {"k_3": 3e5},
    "gravity_pendulum": {"k_g": 2000.0},
    "end_stop": {"k_s": 300.0, "s": 0.006},
    "free_play": {"g": 0.003},
    "backlash": {"g": 0.002},
    "asymmetric_stiffness": {"k_2": 400.0},
    "flexible_mode": {"m_a": 0.1, "w_a": 20.0, "zeta_a": 0.05},
    "input_delay": {"T_d": 0.033},
    "actuator_lag": {"T_a": 0.05},
    "input_saturation": {"u_max": 0.6},
    "input_dead_zone": {"u_0": 0.2},
    "periodic_disturbance": {"T_p": 0.1, "w_p": 5.0},
    "creep_saturation": {"s": 0.005},
    "conicity_variation": {"y_n": 0.003},
    "sensor_delay": {"T_s": 0.027},
    "sensor_lag": {"T_m": 0.04},
}


@dataclass(frozen=True)
class Case:
    """A model with a record: the input (and its rate, where the motion is prescribed) and the engine's outputs.

    Attributes
    ----------
    reference
        Outputs of the engine at a thousandth of its default error.
    as_told
        Outputs of the engine as ``rigsight simulate`` gives them.
    smooth
        True without kinks in the equations.
    """

    name: str
    model: Model
    t: NDArray[np.float64]
    inputs: tuple[NDArray[np.float64], ...]
    reference: Record
    as_told: Record
    smooth: bool

    @property
    def outputs(self) -> tuple[str, ...]:
        return tuple(signal.name for signal in self.model.structure.rig.outputs)

    def errors(self, simulated: Mapping[str, NDArray[np.float64]], told: bool = False) -> dict[str, float]:
        """Relative root mean square difference of each output; a shorter simulation is held to its part."""
        truth = self.as_told if told else self.reference
        return {
            name: float(
                np.linalg.norm(simulated[name] - truth[name][: len(simulated[name])])
                / np.linalg.norm(truth[name][: len(simulated[name])])
            )
            for name in self.outputs
        }


@dataclass(frozen=True)
class _Plan:
    rig: str
    effects: tuple[str, ...] = ()
    hold: Hold = "foh"
    values: Mapping[str, float] | None = None
    first: float = 0.0
    amplitude: float = 1.0


PLANS: dict[str, _Plan] = {effect.name: _Plan("running_gear", (effect.name,)) for effect in CATALOGUE} | {
    "linear running gear": _Plan("running_gear"),
    "linear axis": _Plan("axis"),
    "axis without a spring": _Plan("axis", values={"k": 0.0}),
    "axis held constant": _Plan("axis", hold="zoh"),
    "offsets": _Plan("axis", ("backlash", "cubic_stiffness"), values={"x_off": 0.001, "force_off": 0.3, "k_3": 1e5}),
    "start under load": _Plan("axis", ("iwan_hysteresis",), first=0.7),
    "start held by friction": _Plan("axis", ("coulomb_friction",), first=0.4, values={"T_c": 0.2}),
    "friction twice": _Plan("axis", ("coulomb_friction", "stribeck_friction"), amplitude=2.0),
    "all delays": _Plan("running_gear", ("input_delay", "actuator_lag", "sensor_lag", "sensor_delay"), hold="zoh"),
    "jumps into kinks": _Plan("axis", ("coulomb_friction", "input_dead_zone"), hold="zoh"),
    "element": _Plan("element", amplitude=0.01),
    "element with hysteresis": _Plan("element", ("bouc_wen_hysteresis",), amplitude=0.01),
    "element with sliders": _Plan("element", ("iwan_hysteresis", "coulomb_friction"), amplitude=0.01),
}  # fmt: skip
"""Every effect of the catalogue on the running gear, and what the rigs, holds and starts add."""


@cache
def made_case(name: str) -> Case:
    plan = PLANS[name]
    structure = compose(RIGS[plan.rig], [effect_named(effect) for effect in plan.effects])
    known: dict[str, float] = dict(RIG_VALUES[plan.rig])
    for effect in structure.effects:
        own = EFFECT_VALUES[effect.name]
        known |= {structure.parameter_name(effect, key): value for key, value in own.items()}
    known |= plan.values or {}
    model = Model(structure, {key: known[key] for key in structure.names}, plan.hold)
    t = DT * np.arange(N_SAMPLES)
    signal = plan.first + plan.amplitude * linear_sweep(t, 1.0, 3.0, 40.0)
    source = structure.rig.inputs[0]
    record = Record(
        name=name, dt=DT, signals={source.name: signal}, units={source.name: source.unit}, hold=plan.hold
    )
    held = record_input(structure, record)
    inputs = (signal,)
    if not structure.rig.is_driven:
        pieces = held.coefficients[1:]
        end = pieces[-1]
        inputs = (
            np.append(pieces[:, 0], np.polyval(end[::-1], DT)),
            np.append(pieces[:, 1], end[1] + DT * (2.0 * end[2] + 3.0 * DT * end[3])),
        )
    return Case(
        name, model, t, inputs,
        reference=simulate(structure, model.values, record, accuracy=1e-9),
        as_told=simulate(structure, model.values, record),
        smooth=not freeze(structure).modes,
    )  # fmt: skip


@pytest.fixture(params=PLANS)
def case(request: pytest.FixtureRequest) -> Case:
    """Each of the models in turn."""
    return made_case(request.param)


@pytest.fixture(scope="session")
def case_named() -> Callable[[str], Case]:
    """One model by its name."""
    return made_case


@pytest.fixture(scope="session")
def case_names() -> tuple[str, ...]:
    """The names of all models."""
    return tuple(PLANS)

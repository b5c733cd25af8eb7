"""Models, records and the engine's answer to which every export is held."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from rigsight.effects import CATALOGUE, Effect, effect_named, kind_of, placed, symbols
from rigsight.effects.placed import placed_dimension
from rigsight.excitation import linear_sweep
from rigsight.export import TARGETS
from rigsight.export.equations import exported
from rigsight.export.targets import RESERVED, unsaid
from rigsight.identify.start.scales import characteristic_scales
from rigsight.records import Hold, Record
from rigsight.rigs import RIGS, Rig, read_rig_file
from rigsight.simulate import Structure, compose, record_input, simulate
from rigsight.simulate.equations.kinks import freeze
from rigsight.simulate.model import Model
from rigsight.units import characteristic_value

from ..tiers import slow_but

DT = 0.01
N_SAMPLES = 161
RIG_VALUES: Mapping[str, Mapping[str, float]] = {
    "running_gear": {
        "v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27,
        "J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "l_0": 0.25, "c_y": 0.98, "psi_off": 0.0, "y_off": 0.0,
    },
    "axis": {"gain": 1.0, "m": 1.0, "d": 0.6, "k": 100.0, "x_off": 0.0, "force_off": 0.0},
    "element": {"d": 2.0, "k": 100.0, "force_off": 0.3},
    "drive_train": {
        "k_t": 0.05, "J_m": 1e-3, "J_l": 3e-3, "k_s": 2.0, "d_s": 2e-3, "d_m": 4e-3, "d_l": 4e-3, "k_l": 1.0,
    },
    "servo": {"m": 1.0, "l": 0.15, "k_p": 2.0, "J": 0.02, "k_v": 3.0, "d": 0.2, "angle_off": 0.05},
    "position_drive": {"m_l": 0.6, "m": 0.4, "d": 0.5, "k_p": 100.0, "k_v": 3.0},
    "two_link_arm": {
        "l_1": 0.3, "g": 9.81, "I_1": 0.05, "I_2": 0.02, "m_2": 0.6, "s_1": 0.12, "s_2": 0.08, "d_1": 0.05, "d_2": 0.02,
    },
    "quarter_car": {"m_b": 300.0, "m_w": 40.0, "k_b": 2e4, "d_b": 1500.0, "k_t": 2e5, "d_t": 100.0},
    "cart_pendulum": {"g": 9.81, "m_c": 0.8, "m_p": 0.3, "s": 0.08, "I_p": 0.03, "k_u": 2.0, "d_c": 3.0, "d_p": 0.01},
    "six_joint_arm": {
        **{f"m_{i}": 2.0 / i for i in range(1, 7)}, **{f"c_{i}": 0.13 - 0.015 * i for i in range(1, 7)},
        **{f"I_{i}": 0.012 / i**2 for i in range(1, 7)}, **{f"d_{i}": 0.3 / i for i in range(1, 7)},
        "g": 9.81, "l_1": 0.27, "l_2": 0.24, "l_3": 0.21, "l_4": 0.18, "l_5": 0.15,
    },
}  # fmt: skip
FROM_FILES = Path(__file__).parents[1] / "rigs" / "files"
"""Rigs that are not built in."""
EFFECT_VALUES: Mapping[str, Mapping[str, float]] = {
    "bouc_wen_hysteresis": {"A": 1.0, "a": 0.48, "beta": 736.0, "gamma": -716.0, "n": 1.0},
    "iwan_hysteresis": {"a": 0.3, "x_s": 0.01, "q": -0.4},
    "coulomb_friction": {"T_c": 0.1},
    "stribeck_friction": {"T_c": 0.08, "T_s": 0.16, "w_s": 0.02},
    "directional_friction": {"T_fwd": 0.12, "T_bwd": 0.05},
    "load_dependent_friction": {"T_c": 0.05, "mu": 0.1},
    "presliding_friction": {"T_c": 0.1, "x_p": 0.002},
    "torque_ripple": {"T_sin": 0.06, "T_cos": 0.04, "kappa": 400.0},
    "speed_limit": {"u_s": 0.8, "c_u": 2.0},
    "encoder_eccentricity": {"e_sin": 2e-4, "e_cos": 1e-4, "kappa": 600.0},
    "maxwell_branch": {"k_m": 40.0, "tau_m": 0.2},
    "power_law_stiffness": {"k_p": 40.0, "n": 1.6, "x_r": 0.01},
    "time_shift": {"T_x": 0.027},
    "inertia": {"m_e": 0.02},
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
"""Numbers at which an effect shows well; of one that is not here they follow from its own declaration (`values_of`)."""


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

    def errors(
        self, simulated: Mapping[str, NDArray[np.float64]], reported: bool = False
    ) -> dict[str, float]:
        """Relative root mean square difference of each output; a shorter simulation is held to its part."""
        truth = self.as_told if reported else self.reference
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


@cache
def rig_named(name: str) -> Rig:
    """A rig that is built in, or from a file."""
    return RIGS[name] if name in RIGS else read_rig_file(FROM_FILES / f"{name}.toml")


def _alone(effect: Effect) -> _Plan:
    """An effect on the first rig that offers it."""
    name = next(
        name
        for name in ("running_gear", "element", "servo", "position_drive")
        if rig_named(name).offers(effect)
    )
    return _Plan(name, (effect.name,), amplitude=0.01 if name == "element" else 1.0)


PLANS: dict[str, _Plan] = {effect.name: _alone(effect) for effect in CATALOGUE} | {
    "element with a late force": _Plan("element", ("time_shift",), amplitude=0.01),
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
    "two masses": _Plan("drive_train"),
    "two masses held constant": _Plan("drive_train", ("cubic_stiffness@shaft",), hold="zoh", values={"k_3": 50.0}),
    "play in a shaft": _Plan("drive_train", ("backlash@shaft", "input_dead_zone@motor"), values={"g": 0.01}),
    "one effect twice": _Plan(
        "drive_train", ("quadratic_damping@motor_bearing", "quadratic_damping@load_bearing", "sensor_lag@load_angle"),
        values={"quadratic_damping@motor_bearing.c_2": 1e-3, "quadratic_damping@load_bearing.c_2": 2e-3, "T_m": 0.02},
    ),
    "friction at a motor": _Plan("drive_train", ("coulomb_friction@motor_bearing",), values={"T_c": 0.01}),
    "friction at a load": _Plan("drive_train", ("coulomb_friction@load_bearing",), values={"T_c": 0.02}),
    "friction in a shaft": _Plan(
        "drive_train", ("stribeck_friction@shaft",), values={"T_c": 0.01, "T_s": 0.02, "w_s": 0.1}, hold="zoh"
    ),
    "friction at two joints": _Plan(
        "drive_train", ("coulomb_friction@motor_bearing", "coulomb_friction@load_bearing"),
        values={"coulomb_friction@motor_bearing.T_c": 0.01, "coulomb_friction@load_bearing.T_c": 0.02},
    ),
    "two masses with delays": _Plan("drive_train", ("input_delay@motor", "sensor_delay@motor_angle")),
    "a saturated control law": _Plan("servo", amplitude=1.5),
    "a control law behind lags": _Plan("servo", ("sensor_lag@angle", "actuator_lag@motor"), first=0.4, amplitude=0.5),
    "a mass matrix of coordinates": _Plan("two_link_arm", ("input_dead_zone@elbow_motor",), first=0.1, amplitude=0.3),
    "an arm held constant": _Plan("two_link_arm", ("quadratic_damping@elbow",), values={"c_2": 0.05}, hold="zoh"),
    "a prescribed road": _Plan("quarter_car", ("cubic_stiffness@suspension",), values={"k_3": 4e6}, amplitude=0.02),
    "a coupled pendulum": _Plan("cart_pendulum", amplitude=3.0),
    "an arm of six joints": _Plan("six_joint_arm", amplitude=0.1),
    "friction in an arm of six joints": _Plan(
        "six_joint_arm", ("stribeck_friction@joint_3",), values={"T_c": 0.02, "T_s": 0.04, "w_s": 0.1}, hold="zoh", amplitude=0.1
    ),
}  # fmt: skip
"""Every effect of the catalogue, most on the running gear, and what the rigs, places, holds and starts add."""


def _at_its_place(name: str) -> Effect:
    kind, _, place = name.partition("@")
    return placed(effect_named(kind), place) if place else effect_named(kind)


def fed(structure: Structure, record: Record) -> tuple[NDArray[np.float64], ...]:
    """Return what an export is fed: inputs, and the rates of those that prescribe a motion."""
    at_samples = record_input(structure, record).at_samples(record.n_samples)
    prescribing = {coordinate.prescribed_by for coordinate in structure.rig.mechanism.prescribed}
    columns: list[NDArray[np.float64]] = []
    for i, source in enumerate(structure.rig.inputs):
        if source.name not in prescribing:
            columns.append(record[source.name])
            continue
        value, rate = at_samples[3 * i : 3 * i + 2]
        columns += [value, rate]
    return tuple(columns)


def sweep(rig: Rig, plan: _Plan) -> Record:
    """Return the record with the inputs of a plan."""
    t = DT * np.arange(N_SAMPLES)
    signals = {
        source.name: plan.first + plan.amplitude * linear_sweep(t, 1.0, 3.0 + 2.0 * i, 40.0)
        for i, source in enumerate(rig.inputs)
    }
    units = {source.name: source.unit for source in rig.inputs}
    return Record(name=plan.rig, dt=DT, signals=signals, units=units, hold=plan.hold)


def values_of(effect: Effect, rig: Rig, plan: _Plan) -> Mapping[str, float]:
    """Return numbers of an effect: those of `EFFECT_VALUES`, else its first starts in the sizes of the motion without it."""
    if kind_of(effect.name) in EFFECT_VALUES:
        return EFFECT_VALUES[kind_of(effect.name)]
    plain = simulate(compose(rig), RIG_VALUES[plan.rig], sweep(rig, plan))
    sizes = characteristic_scales(rig, [plain], RIG_VALUES[plan.rig])
    return {
        p.name: p.starts[0] * characteristic_value(placed_dimension(effect, p.dimension), sizes)
        if p.starts
        else p.default or 0.0
        for p in effect.parameters
    }


@cache
def made_case(name: str) -> Case:
    plan = PLANS[name]
    structure = compose(rig_named(plan.rig), [_at_its_place(effect) for effect in plan.effects])
    known: dict[str, float] = dict(RIG_VALUES[plan.rig])
    for effect in structure.effects:
        own = values_of(effect, structure.rig, plan)
        known |= {structure.parameter_name(effect, key): value for key, value in own.items()}
    known |= plan.values or {}
    model = Model(structure, {key: known[key] for key in structure.names}, plan.hold)
    record = sweep(structure.rig, plan)
    return Case(
        name, model, record.t, fed(structure, record),
        reference=simulate(structure, model.values, record, accuracy=1e-9),
        as_told=simulate(structure, model.values, record),
        smooth=not freeze(structure).modes,
    )  # fmt: skip


def _written(plan: _Plan) -> bool:
    """Return False for forces that go with the acceleration of a prescribed motion: every target but LaTeX refuses them."""
    effects = map(_at_its_place, plan.effects)
    feeling = any(effect.reads(symbols.acceleration) or effect.shifts_the_record for effect in effects)
    return not (feeling and rig_named(plan.rig).mechanism.prescribed)


WRITTEN = [name for name, plan in PLANS.items() if _written(plan)]


@cache
def _unsaid(name: str) -> frozenset[str]:
    return frozenset(unsaid(exported(made_case(name).model, "foh", DT, RESERVED)))


def is_refused(case: Case, target: str) -> bool:
    """Return True for a model that a target lacks words for, by the rule of the export itself; test_targets.py tests the rule."""
    return bool(_unsaid(case.name) & TARGETS[target].lacks)


EACH_FORM = (
    "bouc_wen_hysteresis", "iwan_hysteresis", "stribeck_friction", "presliding_friction", "maxwell_branch", "free_play",
    "end_stop", "backlash", "asymmetric_stiffness", "flexible_mode", "torque_ripple", "speed_limit",
    "input_saturation", "sensor_delay",
    "linear axis", "axis without a spring", "offsets", "start under load", "start held by friction", "all delays",
    "jumps into kinks", "element with sliders", "friction at two joints", "one effect twice", "a saturated control law",
    "a mass matrix of coordinates", "a prescribed road",
)  # fmt: skip
"""One of each form that a text takes: memory, branches, delays, starts, holds, motions; the others differ in a formula."""


@pytest.fixture(params=slow_but(*EACH_FORM, of=WRITTEN))
def case(request: pytest.FixtureRequest) -> Case:
    """Each of the models in turn; `make test` takes one of each form."""
    return made_case(request.param)


@pytest.fixture(
    params=slow_but(
        "linear axis", "a saturated control law", of=WRITTEN,
    )
)  # fmt: skip
def solved_case(request: pytest.FixtureRequest) -> Case:
    """Each of the models in turn, for a target whose solver takes a second or more for each."""
    return made_case(request.param)


@pytest.fixture(scope="session")
def case_named() -> Callable[[str], Case]:
    """One model by its name."""
    return made_case


@pytest.fixture(scope="session")
def case_names() -> tuple[str, ...]:
    """The names of all models."""
    return tuple(WRITTEN)


@pytest.fixture(scope="session")
def refused() -> Callable[[Case, str], bool]:
    """Whether a target refuses a model."""
    return is_refused

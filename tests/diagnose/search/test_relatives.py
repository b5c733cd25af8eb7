"""An effect is told from its nearest relatives: its own numbers come back, and held-out records fit it better."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import pytest
from numpy.typing import NDArray

from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.search.single_effects import fit_candidates, reidentify
from rigsight.diagnose.verdict.ranking import rank
from rigsight.effects import effect_named
from rigsight.identify import characteristic_scales
from rigsight.records.record import Record
from rigsight.rigs import RIGS
from rigsight.simulate import compose, simulate

SIGMAS = 3.0
WORSE = 1.1
"""Factor by which relatives leave more of records that were not fitted, at least."""
NOISE = 1e-3
"""Of each sensor, in units of what it shows."""
STAGE = {"gain": 1.0, "m": 1.0, "d": 1.6, "k": 100.0, "x_off": 0.0, "force_off": 0.0}
FREE_STAGE = {**STAGE, "d": 4.0, "k": 0.0}
ELEMENT = {"d": 1.6, "k": 100.0, "force_off": 0.0}
TRAIN = {
    "k_t": 0.05, "J_m": 1e-4, "J_l": 5e-4, "k_s": 0.4, "d_s": 1e-3, "d_m": 5e-4, "d_l": 1e-3, "k_l": 0.1,
}  # fmt: skip


@dataclass(frozen=True)
class Case:
    """A rig with an effect, and the relatives that it is to be told from."""

    effect: str
    truth: Mapping[str, float]
    relatives: tuple[str, ...]
    generalizations: tuple[str, ...] = ()
    """Effects that contain it, and so fit as well with more numbers."""
    conventions: tuple[str, ...] = ()
    """Numbers that are others where a fit counts from another place."""
    rig: str = "axis"
    values: Mapping[str, float] = field(default_factory=lambda: STAGE)
    dt: float = 0.01
    band: tuple[float, float] = (0.1, 3.0)
    """Lowest and highest frequency of the input [Hz]."""
    size: float = 1.0

    def __str__(self) -> str:
        return self.effect if "@" in self.effect else f"{self.effect} on {self.rig}"


def multisine(
    rng: np.random.Generator, t: NDArray[np.float64], band: tuple[float, float]
) -> NDArray[np.float64]:
    """Return a sum of sines of unit amplitude."""
    frequencies = np.arange(band[0], band[1], 2.0 / t[-1])
    phases = rng.uniform(0.0, 2.0 * np.pi, frequencies.size)
    waves = np.sum(np.cos(2.0 * np.pi * frequencies * t[:, None] + phases), axis=1)
    return waves / np.max(np.abs(waves))


def measured(case: Case, seed: int = 3) -> tuple[Record, ...]:
    """Return two records to fit and one to score."""
    rng, rig = np.random.default_rng(seed), RIGS[case.rig]
    structure = compose(rig, [effect_named(case.effect)])
    t = case.dt * np.arange(1500)
    records = []
    for name, share, role in (
        ("large", 1.0, "estimation"),
        ("small", 0.4, "estimation"),
        ("other", 0.8, "validation"),
    ):
        wave = case.size * share * multisine(rng, t, case.band)
        record = Record(name, case.dt, {rig.inputs[0].name: wave}, {}, role=role)
        shown = simulate(structure, {**case.values, **case.truth}, record)
        noisy = {
            s.name: shown[s.name] + NOISE * np.std(shown[s.name]) * rng.standard_normal(t.size)
            for s in rig.outputs
        }
        records.append(record.with_signals(**noisy))
    return tuple(records)


def bench_of(case: Case, records: tuple[Record, ...]) -> FitContext:
    rig = RIGS[case.rig]
    fitted, scored = (tuple(r for r in records if r.role == role) for role in ("estimation", "validation"))
    values = dict(case.values)
    scales = characteristic_scales(rig, fitted, values)
    noise = {s.name: NOISE * float(np.std(records[0][s.name])) for s in rig.outputs}
    held = frozenset({"k"} if values.get("k") == 0.0 else ())
    return FitContext(rig, fitted, scored, fitted, scales, noise, held, values, values)


def ranked(case: Case, names: tuple[str, ...]) -> tuple[FittedModel, ...]:
    """Return each effect alone, fitted and scored, the likeliest first."""
    context = bench_of(case, measured(case))
    models = fit_candidates(
        context, reidentify(context, context.start), [effect_named(name) for name in names]
    )
    noise = context.floors
    return rank(models, noise, np.random.default_rng(0)).order


POWER_LAW = Case(
    "power_law_stiffness", {"k_p": 60.0, "n": 1.7, "x_r": 0.01}, ("cubic_stiffness", "end_stop", "free_play"),
    conventions=("k_p", "x_r"),
)  # fmt: skip
CASES = [
    Case(
        "directional_friction@motor_bearing", {"T_fwd": 0.012, "T_bwd": 0.005},
        ("coulomb_friction@motor_bearing", "stribeck_friction@motor_bearing"), rig="drive_train", values=TRAIN, band=(0.3, 8.0),
    ),
    Case("load_dependent_friction", {"T_c": 0.03, "mu": 0.12}, ("coulomb_friction", "stribeck_friction")),
    Case(
        "presliding_friction", {"T_c": 0.15, "x_p": 1e-3},
        ("coulomb_friction", "stribeck_friction", "iwan_hysteresis"), ("bouc_wen_hysteresis",),
    ),
    Case(
        "torque_ripple", {"T_sin": 0.1, "T_cos": -0.06, "kappa": 700.0},
        ("cubic_stiffness", "gravity_pendulum", "periodic_disturbance"),
    ),
    Case(
        "torque_ripple@load_bearing", {"T_sin": 0.002, "T_cos": 0.001, "kappa": 12.0},
        ("torque_ripple@motor_bearing", "periodic_disturbance@load_bearing"), rig="drive_train", values=TRAIN, band=(0.3, 8.0),
    ),
    Case("speed_limit", {"u_s": 0.7, "c_u": 1.5}, ("input_saturation", "quadratic_damping", "actuator_lag")),
    Case(
        "encoder_eccentricity", {"e_sin": 2e-4, "e_cos": -1e-4, "kappa": 500.0},
        ("torque_ripple", "asymmetric_stiffness", "sensor_lag"),
    ),
    Case("maxwell_branch", {"k_m": 40.0, "tau_m": 0.15}, ("flexible_mode", "actuator_lag", "bouc_wen_hysteresis")),
    Case(
        "maxwell_branch", {"k_m": 40.0, "tau_m": 0.15}, ("bouc_wen_hysteresis", "iwan_hysteresis"),
        rig="element", values=ELEMENT, band=(0.1, 6.0), size=0.01,
    ),
    POWER_LAW,
    Case("time_shift", {"T_x": -0.03}, ("sensor_delay", "input_delay", "actuator_lag")),
    Case(
        "time_shift", {"T_x": 0.03}, ("maxwell_branch", "bouc_wen_hysteresis", "inertia"),
        rig="element", values=ELEMENT, band=(0.1, 6.0), size=0.01,
    ),
    Case(
        "inertia", {"m_e": 0.05}, ("maxwell_branch", "time_shift", "cubic_stiffness"),
        rig="element", values=ELEMENT, band=(0.1, 6.0), size=0.01,
    ),
]  # fmt: skip


ONE_OF_EACH_RIG = {"power_law_stiffness on axis", "inertia on element"}


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, id=str(case), marks=() if str(case) in ONE_OF_EACH_RIG else pytest.mark.slow)
        for case in CASES
    ],
)
def test_it_is_told_from_its_relatives(case: Case) -> None:
    order = ranked(case, (case.effect, *case.relatives, *case.generalizations))
    found = {model.names[0]: model for model in order}
    own = found[case.effect]
    for name, value in case.truth.items():
        if name in case.conventions:
            continue
        error = own.fit.standard_errors[name]
        assert abs(own.fit.values[name] - value) < SIGMAS * error, (name, own.fit.values[name], error)
        assert error < 0.2 * abs(value)
    left = {name: found[name].error_over_noise / own.error_over_noise for name in case.relatives}
    assert min(left.values()) > WORSE, left
    assert order[0] is own, [(model.names, model.error_over_noise) for model in order]


def test_the_stiffness_of_a_power_law_is_told_at_the_size_of_the_motion() -> None:
    (own,) = ranked(POWER_LAW, (POWER_LAW.effect,))
    k_p, n, x_r = (own.fit.values[name] for name in ("k_p", "n", "x_r"))
    assert 0.005 < x_r < 0.05
    assert k_p * (0.01 / x_r) ** (n - 1.0) == pytest.approx(POWER_LAW.truth["k_p"], rel=0.05)

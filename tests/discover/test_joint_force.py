"""Does the regression of the force missing at each joint point to the joint where it acts, and to its law?"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from rigsight.discover.each_joint import MissingForce, missing_forces
from rigsight.effects import effect_named, placed
from rigsight.records.record import Record
from rigsight.rigs import Rig, read_rig_file
from rigsight.simulate import compose, simulate

from ..tiers import slow_but

DT, SECONDS = 5e-3, 4.0
T = DT * np.arange(round(SECONDS / DT))
TRAIN = {"k_t": 0.05, "J_m": 1e-4, "J_l": 5e-4, "k_s": 2.0, "d_s": 1e-3, "d_m": 1e-3, "d_l": 1e-3, "k_l": 0.5}
RELATIVE_NOISE = 1e-3
FITTED = tuple(name for name in TRAIN if name != "k_t")


def sweep(amplitude: float, phase: float) -> np.ndarray:
    return amplitude * np.sin(phase + 2.0 * np.pi * (0.5 * T + 0.8 * T**2))


def measured(
    rig: Rig, effect: str, values: Mapping[str, float], amplitudes: tuple[float, ...]
) -> tuple[list[Record], dict[str, float]]:
    name, place = effect.split("@")
    structure = compose(rig, [placed(effect_named(name), place)])
    rng = np.random.default_rng(0)
    runs = [
        simulate(structure, values, Record(f"run {i}", DT, {"u": sweep(a, i)}, {}, hold="foh"), accuracy=1e-6)
        for i, a in enumerate(amplitudes)
    ]
    noise = {s.name: RELATIVE_NOISE * max(float(np.std(r[s.name])) for r in runs) for s in rig.outputs}
    noisy = [
        r.with_signals(**{n: r[n] + rng.normal(scale=std, size=r.n_samples) for n, std in noise.items()})
        for r in runs
    ]
    return noisy, noise


def disturbed(values: Mapping[str, float], share: float = 0.05) -> dict[str, float]:
    rng = np.random.default_rng(1)
    return {
        name: value if name == "k_t" else value * (1.0 + share * rng.uniform(-1.0, 1.0))
        for name, value in values.items()
    }


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "parameter", "value"),
    slow_but(
        ("cubic_stiffness@load_bearing", "k_3", 0.3),
        of=[("quadratic_damping@motor_bearing", "c_2", 1e-4), ("cubic_stiffness@load_bearing", "k_3", 0.3)],
    ),
)
def test_law_and_place_of_a_missing_force_are_found(
    drive_train: Rig, effect: str, parameter: str, value: float
) -> None:
    records, noise = measured(drive_train, effect, {**TRAIN, parameter: value}, (0.8, 1.5))
    # The parameters are off: what this adds to the forces is projected out.
    found = missing_forces(drive_train, records, disturbed(TRAIN), noise, FITTED)
    shares = {name: own for force in found.values() for name, own in shares_at(force, drive_train).items()}
    best = max(shares, key=lambda name: shares[name][0])
    assert best == effect
    share, coefficient = shares[best]
    assert share > 0.9
    assert coefficient == pytest.approx(value, rel=0.1)


def shares_at(force: MissingForce, rig: Rig) -> dict[str, tuple[float, float]]:
    """Return the share of a missing force that each term explains, and its coefficient, by the name of the term."""
    place, library, _ = force.place(rig, ())
    explained = {c.name: place.projected.explained(c.column[:, None]) for c in library}
    return {name: (share, float(weights[0])) for name, (weights, share) in explained.items()}


def error_over_noise(force: MissingForce) -> float:
    n_measured = sum(
        r.n_samples * len(force.motion.followed.equations.structure.outputs) for r in force.motion.records
    )
    return float(np.sqrt(force.motion.remainder / n_measured))


def test_a_joint_that_cannot_explain_all_sensors_contradicts_them(drive_train: Rig) -> None:
    values = {**TRAIN, "c_2": 1e-4}
    records, noise = measured(drive_train, "quadratic_damping@motor_bearing", values, (0.8, 1.5))
    found = missing_forces(drive_train, records, TRAIN, noise, ())
    errors = {name: error_over_noise(force) for name, force in found.items()}
    assert errors["motor_bearing"] < 1.2 < errors["shaft"]


PENDULUM = """
name = "pendulum"
summary = "A pendulum swings out; nothing drives it."
parameters.I = { unit = "kg m^2", lower = 1e-6, log = true }
parameters.s = { unit = "kg m", lower = 0.0 }
parameters.d = { unit = "N m s/rad", lower = 0.0 }
coordinates.a = { unit = "rad", about = "from hanging" }
energy = { kinetic = "I*d(a)^2/2", potential = "-9.81*s*cos(a)" }
joints.pivot = { motion = "a", damping = "d" }
sensors.angle = { reads = "a", unit = "rad" }
"""


def test_a_missing_force_is_found_in_free_motion(tmp_path: Path) -> None:
    path = tmp_path / "pendulum.toml"
    path.write_text(PENDULUM, encoding="utf-8")
    rig, values = read_rig_file(path), {"I": 0.02, "s": 0.08, "d": 2e-3}
    structure = compose(rig, [placed(effect_named("quadratic_damping"), "pivot")])
    rng = np.random.default_rng(0)
    records = []
    for begin in (1.0, 0.6):
        still = Record(f"from {begin}", DT, {"angle": np.zeros(T.size)}, {"angle": "rad"})
        run = simulate(structure, {**values, "c_2": 2e-3}, still, np.array([begin, 0.0]))
        records.append(run.with_signals(angle=run["angle"] + rng.normal(scale=1e-4, size=T.size)))
    # Free motion determines all parameters only up to a common factor: the inertia is held.
    (force,) = missing_forces(rig, records, values, {"angle": 1e-4}, ("s", "d")).values()
    assert error_over_noise(force) < 1.3
    shares = shares_at(force, rig)
    assert shares["quadratic_damping@pivot"][0] > 0.9 * max(share for share, _ in shares.values())

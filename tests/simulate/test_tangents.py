"""Derivatives carried along with the motion: those of the accurate simulation, and their products record by record."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from rigsight.effects import effect_named
from rigsight.excitation import log_sweep
from rigsight.records import Record
from rigsight.records.record import Hold
from rigsight.rigs import RUNNING_GEAR
from rigsight.simulate import (
    FittedRecord,
    Structure,
    Substeps,
    compose,
    kernel_of,
    parameter_vector,
    record_input,
    simulate_outputs,
    simulate_sets,
    simulate_tangents,
)
from rigsight.simulate.input_hold import HeldInput

DT = 5e-3
VALUES = {
    "v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27,
    "J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "l_0": 0.25, "c_y": 0.98, "psi_off": 1e-4, "y_off": 0.0,
    "k_3": 5e3, "T_c": 0.05, "T_d": 0.013, "k_g": 10.0, "A": 1.0, "a": 0.3, "beta": 300.0, "gamma": -180.0, "n": 1.4,
    "coulomb_friction.T_c": 0.05, "T_s": 0.07, "w_s": 0.2,
}  # fmt: skip


def structure_of(*effects: str) -> Structure:
    return compose(RUNNING_GEAR, map(effect_named, effects))


def swept(
    structure: Structure, n_samples: int, amplitude: float = 0.5, hold: Hold = "band_limited"
) -> tuple[HeldInput, NDArray[np.float64]]:
    t = DT * np.arange(n_samples)
    record = Record("sweep", DT, {"u": log_sweep(t, amplitude, 1.0, 40.0)}, {"u": "A"}, hold=hold)
    return record_input(structure, record), parameter_vector(structure, VALUES)


def directions(
    structure: Structure, p: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return derivatives by every parameter and initial state, in units of 1 or their size."""
    n = len(structure.states)
    dp = np.hstack([np.diag(np.where(p == 0.0, 1e-2, p)), np.zeros((p.size, n))])
    return dp, np.hstack([np.zeros((n, p.size)), 1e-2 * np.eye(n)])


@pytest.mark.parametrize(
    ("effects", "hold", "limit"),
    [
        # Nothing happens within a step: what is left is the rounding of central differences by what hardly matters.
        (["gravity_pendulum"], "band_limited", 1e-5),
        (["gravity_pendulum", "input_delay"], "zoh", 1e-5),
        # Under a held input the mass reverses, rests and sets out where the accurate integrator has it.
        (["coulomb_friction"], "zoh", 1e-5),
        (["coulomb_friction", "input_delay"], "zoh", 1e-5),
        # Under a smooth one a mass at rest sets out at the end of a step.
        (["coulomb_friction", "input_delay"], "band_limited", 3e-3),
        (["stribeck_friction", "cubic_stiffness"], "foh", 3e-3),
        (["bouc_wen_hysteresis", "coulomb_friction"], "band_limited", 3e-3),
    ],
    ids=lambda value: "-".join(value) if isinstance(value, list) else str(value),
)
def test_they_are_those_of_the_accurate_simulation(effects: list[str], hold: Hold, limit: float) -> None:
    structure, n_samples, step = structure_of(*effects), 800, 3e-5
    held, p = swept(structure, n_samples, 0.6, hold)
    dp, dx0 = directions(structure, p)
    x0 = np.full(len(structure.states), 1e-3)

    def outputs(share: float, i: int) -> NDArray[np.float64]:
        return simulate_outputs(
            structure, held, p + share * dp[:, i], x0 + share * dx0[:, i], n_samples, 1e-10
        )

    found = simulate_tangents(structure, held, p, dp, x0, dx0, n_samples, 16)[:, :, 1:]
    expected = np.array([(outputs(step, i) - outputs(-step, i)) / (2.0 * step) for i in range(dp.shape[1])])
    expected = np.moveaxis(expected, 0, 2)
    error = np.linalg.norm(found - expected, axis=(0, 1)) / np.linalg.norm(expected, axis=(0, 1))
    names = [*structure.names, *structure.state_names]
    assert np.all(error <= limit), {name: f"{e:.1e}" for name, e in zip(names, error, strict=True)}


@pytest.mark.parametrize("sharpness", [1.0, 1.4])
def test_a_power_of_nothing_has_derivatives(sharpness: float) -> None:
    structure = structure_of("bouc_wen_hysteresis")
    held, p = swept(structure, 200)
    p[structure.names.index("n")] = sharpness
    dp, dx0 = directions(structure, p)
    x0 = np.zeros(len(structure.states))
    found = simulate_tangents(structure, held, p, dp, x0, dx0, 200, 2)
    assert np.all(np.isfinite(found))
    x0[-1] = 1e-12
    close = simulate_tangents(structure, held, p, dp, x0, dx0, 200, 2)
    np.testing.assert_allclose(found, close, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("effects", [["coulomb_friction"], ["gravity_pendulum", "input_delay"]])
def test_the_motion_is_that_of_sets_side_by_side(effects: list[str]) -> None:
    structure = structure_of(*effects)
    held, p = swept(structure, 300)
    dp, dx0 = directions(structure, p)
    x0 = np.full(len(structure.states), 1e-3)
    found = simulate_tangents(structure, held, p, dp, x0, dx0, 300, 2)[:, :, 0]
    expected = simulate_sets(structure, held, p[:, None], x0[:, None], 300, 2)[:, :, 0]
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("n_directions", [0, 1, 7, 14])
@pytest.mark.parametrize("effect", ["coulomb_friction", "gravity_pendulum"])
def test_products_are_those_of_the_derivatives(effect: str, n_directions: int) -> None:
    structure, rng, weights = structure_of(effect), np.random.default_rng(4), np.array([2e4, 3e4])
    fitted, expected, states = [], [], []
    p, dp, dx0 = np.zeros(0), np.zeros(0), np.zeros(0)
    # One record ends within the samples that are kept together, the other does not.
    for n_samples, amplitude in ((64, 0.3), (150, 0.6)):
        held, p = swept(structure, n_samples, amplitude)
        dp, dx0 = (own[:, :n_directions] for own in directions(structure, p))
        x0 = 1e-3 * rng.normal(size=len(structure.states))
        measured = 1e-3 * rng.normal(size=(n_samples, 2))
        out = simulate_tangents(structure, held, p, dp, x0, dx0, n_samples, 2)
        rows = np.concatenate([measured[:, :, None] - out[:, :, :1], -out[:, :, 1:]], axis=2)
        rows = (rows * weights[:, None]).reshape(-1, 1 + n_directions)
        expected.append(rows.T @ rows)
        fitted.append(FittedRecord(held, Substeps(2).per_piece(held.n_pieces), measured, weights))
        states.append(x0)
    found = kernel_of(structure).tangent_equations(fitted, p, dp, np.array(states), dx0)
    size = np.sqrt(np.einsum("rii->ri", np.array(expected)))
    np.testing.assert_array_less(
        np.abs(found - expected), 1e-12 * size[:, :, None] * size[:, None, :] + 1e-300
    )


def test_a_motion_beyond_the_range_of_numbers_is_seen() -> None:
    structure = structure_of("gravity_pendulum", "cubic_stiffness")
    held, p = swept(structure, 200)
    dp, dx0 = directions(structure, p)
    p[structure.names.index("k_3")] = -1e30
    record = FittedRecord(held, Substeps(1).per_piece(held.n_pieces), np.zeros((200, 2)), np.ones(2))
    products = kernel_of(structure).tangent_equations(
        [record], p, dp, np.ones((1, len(structure.states))), dx0
    )
    assert not np.isfinite(products[0, 0, 0])

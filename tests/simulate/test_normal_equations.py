"""Products that least squares needs: those of the outputs that the side-by-side integrator gives, record by record."""

import numpy as np
import pytest

from rigsight.effects import effect_named
from rigsight.excitation import log_sweep
from rigsight.records import Record
from rigsight.rigs import RUNNING_GEAR
from rigsight.simulate import (
    FittedRecord,
    Substeps,
    compose,
    kernel_of,
    parameter_vector,
    record_input,
    simulate_sets,
)

DT = 5e-3
VALUES = {
    "v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27,
    "J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "l_0": 0.25, "c_y": 0.98, "psi_off": 0.0, "y_off": 0.0,
    "k_3": 5e3, "T_c": 0.05, "T_d": 0.013, "a": 0.2, "x_s": 0.03, "q": -0.4,
}  # fmt: skip


@pytest.fixture(scope="module")
def rng():
    return np.random.default_rng(4)


def drawn(structure, n_samples, n_sets, rng, amplitude):
    t = DT * np.arange(n_samples)
    record = Record("sweep", DT, {"u": log_sweep(t, amplitude, 1.0, 20.0)}, {"u": "A"}, hold="band_limited")
    held = record_input(structure, record)
    p = parameter_vector(structure, VALUES)
    sets = p[:, None] * (1.0 + 1e-3 * rng.random((p.size, n_sets)))
    states = 1e-4 * rng.normal(size=(len(structure.states), n_sets))
    return held, sets, states


@pytest.mark.parametrize("n_sets", [1, 7, 45])
@pytest.mark.parametrize(
    "effect", ["cubic_stiffness", "input_delay", "iwan_hysteresis", "iwan_hysteresis+coulomb_friction"]
)
def test_they_are_those_of_the_simulated_outputs(effect, n_sets, rng):
    structure = compose(RUNNING_GEAR, map(effect_named, effect.split("+")))
    weights = np.array([2e4, 3e4])
    fitted, expected, states = [], [], []
    # One record ends within the samples that are kept together, the other does not.
    for n_samples, amplitude in ((64, 0.3), (150, 0.6)):
        held, p, x0 = drawn(structure, n_samples, n_sets, np.random.default_rng(1), amplitude)
        x0 *= amplitude
        measured = 1e-3 * rng.normal(size=(n_samples, 2))
        out = simulate_sets(structure, held, p, x0, n_samples, 2)
        rows = out[:, :, :1] - out
        rows[:, :, 0] = measured - out[:, :, 0]
        rows = (rows * weights[:, None]).reshape(-1, n_sets)
        expected.append(rows.T @ rows)
        fitted.append(FittedRecord(held, Substeps(2).per_piece(held.n_pieces), measured, weights))
        states.append(x0)
    found = kernel_of(structure).normal_equations(fitted, p, np.array(states))
    size = np.sqrt(np.einsum("rii->ri", np.array(expected)))
    np.testing.assert_array_less(
        np.abs(found - expected), 1e-12 * size[:, :, None] * size[:, None, :] + 1e-300
    )


def test_an_output_that_was_not_measured_counts_for_nothing(rng):
    structure = compose(RUNNING_GEAR, [])
    held, p, x0 = drawn(structure, 100, 5, rng, 0.5)
    substeps = Substeps(1).per_piece(held.n_pieces)
    measured = 1e-3 * rng.normal(size=(100, 2))
    both = [
        FittedRecord(held, substeps, np.column_stack([measured[:, 0], other]), np.array([1.0, 0.0]))
        for other in (measured[:, 1], np.full(100, np.nan))
    ]
    with_values, without = kernel_of(structure).normal_equations(both, p, np.array([x0, x0]))
    np.testing.assert_array_equal(with_values, without)
    assert np.all(np.isfinite(without))


def test_a_set_that_diverges_spoils_no_other(rng):
    structure = compose(RUNNING_GEAR, [effect_named("cubic_stiffness")])
    held, p, x0 = drawn(structure, 200, 6, rng, 0.5)
    record = FittedRecord(held, Substeps(1).per_piece(held.n_pieces), np.zeros((200, 2)), np.ones(2))
    sound = kernel_of(structure).normal_equations([record], p, x0[None])[0]
    p[structure.names.index("k_3"), 4] = -1e30
    x0[0, 4] = 1.0
    spoiled = kernel_of(structure).normal_equations([record], p, x0[None])[0]
    others = [0, 1, 2, 3, 5]
    assert not np.any(np.isfinite(spoiled[4, [0, 4]]))
    np.testing.assert_array_equal(spoiled[np.ix_(others, others)], sound[np.ix_(others, others)])

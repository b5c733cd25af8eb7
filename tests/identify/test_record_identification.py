"""What one record shows by itself: its amplitude where none is given, and in words what it cannot tell."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.effects import effect_named
from rigsight.excitation import log_sweep, step
from rigsight.identify.measured_amplitude import measured_amplitude
from rigsight.identify.record_identification import EstimationOptions, identify_record
from rigsight.records import Record
from rigsight.rigs import RUNNING_GEAR
from rigsight.simulate import compose, simulate

CONSTANTS = {"v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27}
VALUES = {
    **CONSTANTS, "J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "l_0": 0.25, "c_y": 0.98, "psi_off": -1.3e-3, "y_off": 4e-4,
}  # fmt: skip
DT = 5e-3


def measured(u: np.ndarray, kind: str) -> Record:
    rng = np.random.default_rng(3)
    driven = Record("own", DT, {"u": u}, {"u": "A", "psi": "rad", "y": "m"}, kind=kind)  # type: ignore[arg-type]
    clean = simulate(compose(RUNNING_GEAR), VALUES, driven)
    return clean.with_signals(**{name: clean[name] + rng.normal(0.0, 2e-5, u.size) for name in ("psi", "y")})


def test_the_amplitude_is_that_of_the_sweep_also_if_it_begins_slowly() -> None:
    t = DT * np.arange(6000)
    sweep = measured(log_sweep(t, 0.5, 0.05, 60.0), "sweep")
    assert abs(np.median(sweep["u"])) > 0.02
    assert measured_amplitude(sweep, RUNNING_GEAR)[0] == pytest.approx(0.5, rel=0.01)
    for start in (5.0, 25.0):
        assert measured_amplitude(measured(step(t, 0.6, start), "step"), RUNNING_GEAR)[0] == pytest.approx(
            0.6
        )


def test_offsets_of_a_sweep_are_known_far_better_than_its_motion_is_large() -> None:
    record = measured(log_sweep(DT * np.arange(8000), 0.5, 0.5, 60.0), "sweep")
    found = identify_record(record, RUNNING_GEAR, CONSTANTS, EstimationOptions()).offsets
    assert found is not None
    for name in ("psi_off", "y_off"):
        assert abs(found.values[name] - VALUES[name]) < 4.0 * found.standard_errors[name]
        assert found.standard_errors[name] < 2e-6


def test_a_record_that_is_too_short_is_told_what_would_help() -> None:
    record = measured(log_sweep(DT * np.arange(600), 3e-3, 0.6, 60.0), "sweep")
    motion = identify_record(record, RUNNING_GEAR, CONSTANTS, EstimationOptions()).paths[0]
    assert motion.fit is None
    assert motion.problem is not None
    assert "does not determine" in motion.problem
    assert "Record for longer" in motion.problem


def test_more_data_are_not_advised_where_the_response_is_another() -> None:
    t, rng = DT * np.arange(8000), np.random.default_rng(3)
    drive = log_sweep(t, 0.5, 0.5, 60.0)
    # A resonance inside the band whose reading is rectified: a response that noise does not blur, but that is no PT2.
    structure = compose(RUNNING_GEAR, [])
    own = Record("own", DT, {"u": drive}, {"u": "A", "psi": "rad"}, kind="sweep")
    psi = np.abs(simulate(structure, VALUES, own)["psi"]) + rng.normal(0.0, 2e-5, t.size)
    problem = identify_record(
        own.with_signals(psi=psi), RUNNING_GEAR, CONSTANTS, EstimationOptions()
    ).motion.problem
    assert problem
    assert "Record for longer" not in problem


def test_a_signal_of_the_wrong_sign_is_told_also_where_friction_spoils_the_phases() -> None:
    t = DT * np.arange(8000)
    driven = Record("own", DT, {"u": log_sweep(t, 0.5, 0.5, 60.0)}, {"u": "A", "psi": "rad"}, kind="sweep")
    rng = np.random.default_rng(3)
    structure = compose(RUNNING_GEAR, [effect_named("coulomb_friction")])
    psi = simulate(structure, {**VALUES, "T_c": 0.02}, driven)["psi"] + rng.normal(0.0, 2e-5, t.size)
    right = identify_record(driven.with_signals(psi=psi), RUNNING_GEAR, CONSTANTS, EstimationOptions()).paths[
        0
    ]
    assert right.fit is not None
    assert "magnitudes only" in right.fit.message
    turned = identify_record(driven.with_signals(psi=-psi), RUNNING_GEAR, CONSTANTS, EstimationOptions())
    assert "Change the sign" in turned.paths[0].problem

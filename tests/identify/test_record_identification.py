"""What one record shows by itself: its amplitude where none is given, and in words what it cannot tell."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.effects import effect_named
from rigsight.excitation import linear_sweep, log_sweep, step
from rigsight.identify.amplitude_dependence import measured_amplitude
from rigsight.identify.identification import RecordIdentification
from rigsight.identify.record_identification import EstimationOptions, identify_record
from rigsight.records import Record
from rigsight.rigs import RUNNING_GEAR
from rigsight.simulate import compose, simulate
from rigsight.workflow.campaign.in_memory import make_campaign
from rigsight.workflow.identify import identify_campaign

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


def identified(record: Record) -> RecordIdentification:
    """Return the results of a record in a campaign of its own."""
    campaign = make_campaign(RUNNING_GEAR, [record], constants=CONSTANTS)
    return identify_campaign(campaign, EstimationOptions()).records[0]


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
    found = identified(record).offsets
    assert found is not None
    for name in ("psi_off", "y_off"):
        assert abs(found.values[name] - VALUES[name]) < 4.0 * found.standard_errors[name]
        assert found.standard_errors[name] < 2e-6


def test_a_command_that_is_constant_from_the_first_sample_is_a_step_with_which_the_record_begins() -> None:
    t = DT * np.arange(2500)
    whole = measured(step(t, 0.6, 1.0), "step")
    record = whole.slice(200, t.size)
    assert np.ptp(record["u"]) == 0.0
    assert measured_amplitude(record, RUNNING_GEAR)[0] == pytest.approx(0.6)


@pytest.mark.slow
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


@pytest.mark.slow
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


SOFT = {"J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "psi_off": 1.6e-3, "y_off": 1.9e-4}
STIFF = {"J_z": 0.46, "k_c": 810.0, "k_d": 11.6, "psi_off": -1.4e-3, "y_off": 2e-2}


def swept_at_once(shape: str, own: dict[str, float], first: int = 0) -> Record:
    """A sweep of the thesis's rate that begins with the record, from rest or, cut, in motion."""
    dt, rng = 0.01, np.random.default_rng(5)
    t = dt * np.arange(4000)
    u = linear_sweep(t, 1.0, 1e-3, 170.0) if shape == "linear" else log_sweep(t, 1.0, 0.05, 170.0)
    driven = Record(
        "own", dt, {"u": u}, {"u": "A", "psi": "rad", "y": "m"}, kind="sweep", hold="foh", amplitude=1.0
    )
    clean = simulate(compose(RUNNING_GEAR), {**VALUES, **own}, driven)
    noisy = {name: clean[name] + rng.normal(0.0, 2e-5, t.size) for name in ("psi", "y")}
    return clean.with_signals(**noisy).slice(first, t.size)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["local_rational", "local_polynomial", "h1"])
@pytest.mark.parametrize("own", [SOFT, STIFF], ids=["soft", "stiff"])
@pytest.mark.parametrize(("shape", "first"), [("linear", 0), ("log", 0), ("linear", 250)])
def test_a_sweep_that_begins_with_the_record_gives_its_numbers(
    shape: str, first: int, own: dict[str, float], method: str
) -> None:
    if method != "local_rational" and (own is STIFF or first):
        pytest.skip("one rig shows that every method has the same fit")
    found = identify_record(
        swept_at_once(shape, own, first), RUNNING_GEAR, CONSTANTS, EstimationOptions(method)
    )
    assert not found.warnings
    for name, (value, error) in found.estimates.items():
        assert abs(value - {**VALUES, **own}[name]) < 4.0 * error, name
    # Of soft and stiff rig, the motion is 500 and 50 times as large as its noise.
    assert found.estimates["k_d"][1] < (2e-3 if own is SOFT else 2e-2) * own["k_d"]
    measured_response = found.motion.measured
    assert measured_response is not None
    if method == "h1":
        return
    assert measured_response.omega[0] < 1.0
    gain = CONSTANTS["b"] * CONSTANTS["k_tau"] / CONSTANTS["r_0"]
    s = 1j * measured_response.omega
    truth = gain / (own["J_z"] * s**2 + own["k_d"] * s + own["k_c"])
    assert measured_response.variance is not None
    pulls = np.abs(measured_response.values - truth) / np.sqrt(measured_response.variance)
    assert np.sqrt(np.mean(pulls**2)) < 1.5

"""The identification of rigs of any shape: several inputs and sensors, own names, payloads, no input at all."""

from __future__ import annotations

import json
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from rigsight.errors import InputError
from rigsight.identify.identification import Identification
from rigsight.report.identification import identification_summary
from rigsight.rigs import RIGS, read_rig_file, rig_file_text
from rigsight.workflow.campaign.in_memory import make_campaign
from rigsight.workflow.identify import checked_options, identify_campaign, write_identification

from .any_rig_records import ARM, SERVO, STILL, TRAIN, Floats, identified, multisine, recorded


@pytest.fixture(scope="module")
def arm() -> Identification:
    rng, rig = np.random.default_rng(1), RIGS["two_link_arm"]

    def both(size: float) -> dict[str, Floats]:
        return {"tau_1": multisine(rng, size, 40.0), "tau_2": multisine(rng, 0.4 * size, 40.0)}

    records = [
        recorded("both", rig, ARM, both(0.1), rng),
        recorded("elbow", rig, ARM, {"tau_1": STILL, "tau_2": multisine(rng, 0.04, 40.0)}, rng),
        recorded("check", rig, ARM, both(0.08), rng, "validation"),
    ]
    with pytest.MonkeyPatch.context() as patch:
        return identified(rig, records, {}, ARM, patch)


@pytest.mark.slow
def test_parameters_come_with_what_is_identifiable(arm: Identification) -> None:
    reported = arm.identifiability
    assert reported is not None
    assert reported.determined == ("I_2", "s_2", "d_1", "d_2")
    assert reported.sentence.endswith("I_1, m_2 and s_1 only as I_1 + 0.09 m_2 and s_1 + 0.3 m_2.")
    fit = arm.joint.fit.fit
    for name in reported.determined:
        assert abs(fit.values[name] - ARM[name]) < 4.0 * fit.standard_errors[name] < 0.1 * ARM[name]
    assert all(np.isinf(fit.standard_errors[name]) for name in ("I_1", "m_2", "s_1"))
    sums = {c.text: c for c in reported.combinations}
    for text, truth in (("I_1 + 0.09 m_2", 0.104), ("s_1 + 0.3 m_2", 0.3)):
        assert abs(sums[text].value - truth) < 4.0 * sums[text].std < 0.1 * truth


def test_every_sensor_has_a_response_to_every_input_and_the_model_goes_through_it(
    arm: Identification,
) -> None:
    (view,) = arm.views
    assert view.linearization.stability == "stable"
    assert view.measured is not None
    assert not view.measured.problems
    pairs = {(source, response) for source in ("tau_1", "tau_2") for response in ("angle_1", "angle_2")}
    assert set(view.measured.found) == set(view.model) == pairs
    for pair in pairs:
        # The arm is not quite linear, at these small torques nearly so.
        assert view.misfit(*pair) < 3.0
    assert len(view.modes) == 2
    assert all(0.0 < mode.frequency_std < 0.01 * mode.natural_frequency for mode in view.modes)


def test_a_record_shows_the_paths_of_the_inputs_that_move_in_it(arm: Identification) -> None:
    both, elbow = arm.records
    assert {(path.source, path.response) for path in elbow.paths} == {
        ("tau_2", "angle_1"),
        ("tau_2", "angle_2"),
    }
    assert len(both.paths) == 4
    assert elbow.is_identified
    assert [score.record for score in arm.joint.scores if score.role == "validation"] == ["check"]
    assert all(left < 0.005 for score in arm.joint.scores for left in score.nrmse.values())


@pytest.mark.slow
def test_files_hold_the_same_words_per_input_and_sensor(arm: Identification, tmp_path: Path) -> None:
    written = write_identification(arm, tmp_path)
    assert {path.name for path in written} == {
        "identification.json", "identification.html", "model.json", "responses.svg"
    }  # fmt: skip
    content = json.loads((tmp_path / "identification.json").read_text("utf-8"))
    assert content["joint"]["parameters"]["m_2"]["std"] is None
    assert content["identifiability"]["determined"] == ["I_2", "s_2", "d_1", "d_2"]
    (linear,) = content["linear"]
    path = next(p for p in linear["paths"] if (p["source"], p["response"]) == ("tau_2", "angle_1"))
    omega = 1j * np.array(path["model_response"]["omega"])
    transfer = path["transfer_function"]
    by_polynomials = np.polyval(transfer["numerator"], omega) / np.polyval(transfer["denominator"], omega)
    model = np.array(path["model_response"]["real"]) + 1j * np.array(path["model_response"]["imaginary"])
    np.testing.assert_allclose(by_polynomials, model, rtol=1e-9)
    assert transfer["unit"] == "rad/(N m)"
    measured = path["frequency_response"]
    assert measured["omega"] == path["model_response"]["omega"]
    assert [p["natural_frequency_std"] is not None for p in linear["poles"]] == [True, True]
    page = (tmp_path / "identification.html").read_text("utf-8")
    assert "I_1 + 0.09 m_2" in page
    assert "<svg" in page or "data:image/png" in page


def test_the_terminal_says_it_too(arm: Identification) -> None:
    console = Console(width=100, file=StringIO())
    with console.capture() as captured:
        console.print(identification_summary(arm))
    text = captured.get()
    assert "What these records determine" in text
    assert "damping ratio" in text


@pytest.mark.slow
def test_a_gain_and_all_it_scales_are_said_not_to_be_identifiable(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = rig_file_text("drive_train").replace("[constants.k_t]", "[parameters.k_t]")
    (tmp_path / "free_gain.toml").write_text(text.replace("default = 0.05", "log = true"), "utf-8")
    rig, rng = read_rig_file(tmp_path / "free_gain.toml"), np.random.default_rng(2)
    records = [recorded("one", rig, TRAIN, {"u": multisine(rng, 0.3, 200.0)}, rng)]
    found = identified(rig, records, {}, TRAIN, monkeypatch)
    assert found.identifiability is not None
    assert found.identifiability.determined == ()
    assert "only up to a common factor" in found.identifiability.sentence
    ratio = next(c for c in found.identifiability.combinations if c.text == "J_m/k_t")
    assert abs(ratio.value - 0.002) < 4.0 * ratio.std < 1e-4


def test_inputs_that_move_together_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    rng, rig = np.random.default_rng(3), RIGS["two_link_arm"]
    tau = multisine(rng, 0.05, 40.0)
    records = [recorded("one", rig, ARM, {"tau_1": tau, "tau_2": -0.5 * tau}, rng)]
    found = identified(rig, records, {}, ARM, monkeypatch)
    assert any("'tau_1' changes together with 'tau_2'" in warning for warning in found.warnings)
    (view,) = found.views
    assert view.measured is not None
    assert not view.measured.found
    # Without a frequency response there are poles all the same.
    assert len(view.modes) == 2


def test_records_of_different_payload_are_fitted_together_and_seen_apart(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rng, rig = np.random.default_rng(4), RIGS["servo"]
    records = [
        recorded(f"m = {m}", rig, SERVO, {"goal": multisine(rng, 0.05, 40.0)}, rng, constants={"m": m})
        for m in (0.5, 2.0)
    ]
    found = identified(rig, records, {}, SERVO, monkeypatch)
    light, heavy = found.views
    assert (light.constants, heavy.constants) == ({"m": 0.5}, {"m": 2.0})
    assert light.modes[0].natural_frequency > heavy.modes[0].natural_frequency
    for view in found.views:
        assert view.misfit("goal", "angle") < 3.0
    fit = found.joint.fit.fit
    for name in ("J", "k_v", "d"):
        assert abs(fit.values[name] - SERVO[name]) < 4.0 * fit.standard_errors[name] < 0.1 * SERVO[name]


def test_a_method_for_one_input_is_refused() -> None:
    rng, rig = np.random.default_rng(7), RIGS["drive_train"]
    campaign = make_campaign(rig, [recorded("one", rig, TRAIN, {"u": multisine(rng, 0.3, 200.0)}, rng)])
    with pytest.raises(InputError, match="Allowed: 'local_polynomial', 'local_rational'"):
        identify_campaign(campaign, checked_options("h1", None))


@pytest.mark.slow
def test_a_servo_is_identified_without_any_start_values() -> None:
    rng, rig = np.random.default_rng(10), RIGS["servo"]
    records = [
        recorded(str(size), rig, SERVO, {"goal": multisine(rng, size, 40.0)}, rng) for size in (0.05, 0.1)
    ]
    found = identify_campaign(make_campaign(rig, records), checked_options("local_rational", None))
    fit = found.joint.fit.fit
    for parameter in rig.parameters:
        error = fit.standard_errors[parameter.name]
        assert (
            abs(fit.values[parameter.name] - SERVO[parameter.name])
            < 4.0 * error
            < 0.1 * SERVO[parameter.name]
        )
    assert found.changing == ()


@pytest.mark.slow
def test_a_record_at_rest_is_no_motion_that_the_fit_misses(monkeypatch: pytest.MonkeyPatch) -> None:
    rng, rig = np.random.default_rng(3), RIGS["drive_train"]
    moved = recorded("moved", rig, TRAIN, {"u": multisine(rng, 1.0, 100.0)}, rng)
    noise = {s.name: 1e-3 * np.std(moved[s.name]) * rng.standard_normal(STILL.size) for s in rig.outputs}
    still = recorded("rest", rig, TRAIN, {"u": STILL}, rng).with_signals(**noise)
    rest = replace(still, kind="operation", amplitude=None)
    found = identified(rig, [moved, rest], {"k_t": TRAIN["k_t"]}, TRAIN, monkeypatch)
    assert min(found.joint.scores[1].nrmse.values()) > 0.9
    assert "reliable" not in found.joint.statement
    # A motion of the same size that the fit misses is another matter.
    moving = {name: samples + 1e-3 * np.sin(0.01 * np.arange(STILL.size)) for name, samples in noise.items()}
    missed = identified(rig, [moved, rest.with_signals(**moving)], {"k_t": TRAIN["k_t"]}, TRAIN, monkeypatch)
    assert "reliable" in missed.joint.statement

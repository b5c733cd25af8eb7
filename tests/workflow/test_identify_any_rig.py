"""The identification of rigs of any shape: several inputs and sensors, own names, payloads, no input at all."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from rich.console import Console

from rigsight.errors import InputError
from rigsight.excitation import linear_sweep
from rigsight.identify.identification import Identification
from rigsight.records.record import Record, Role
from rigsight.report.identification import identification_summary
from rigsight.rigs import RIGS, Rig, read_rig_file, rig_file_text
from rigsight.rigs.reading.rig_file import rig_of_text
from rigsight.simulate import compose, simulate
from rigsight.workflow.campaign.in_memory import make_campaign
from rigsight.workflow.discover import regression_data
from rigsight.workflow.identification import any_rig
from rigsight.workflow.identification.json import identification_json
from rigsight.workflow.identify import checked_options, identify_campaign, run_identify, write_identification

Floats = NDArray[np.float64]
DT, N = 0.01, 2000
T = DT * np.arange(N)
STILL = np.zeros(N)
NOISE = 1e-3
ARM = {
    "l_1": 0.3, "g": 9.81, "I_1": 0.05, "I_2": 0.02, "m_2": 0.6, "s_1": 0.12, "s_2": 0.08, "d_1": 0.05, "d_2": 0.02
}  # fmt: skip
TRAIN = {"k_t": 0.05, "J_m": 1e-4, "J_l": 5e-4, "k_s": 2.0, "d_s": 1e-3, "d_m": 1e-3, "d_l": 1e-3, "k_l": 0.5}
SERVO = {"m": 1.0, "l": 0.15, "k_p": 2.0, "J": 0.02, "k_v": 3.0, "d": 0.2, "angle_off": 0.05}


def multisine(rng: np.random.Generator, size: float, high: float) -> Floats:
    omega = 2.0 * np.pi * np.arange(N // 2 + 1) / (N * DT)
    lines = np.where((omega > 0.5) & (omega < high), np.exp(2j * np.pi * rng.random(omega.size)), 0.0)
    signal = np.fft.irfft(lines, N)
    return np.asarray(size * signal / np.std(signal))


def recorded(
    name: str,
    rig: Rig,
    values: Mapping[str, float],
    inputs: Mapping[str, Floats],
    rng: np.random.Generator,
    role: Role = "estimation",
    constants: Mapping[str, float] | None = None,
    start: Floats | None = None,
) -> Record:
    units = {signal.name: signal.unit for signal in (*rig.inputs, *rig.outputs)}
    # A rig without inputs still needs samples of time.
    signals = dict(inputs) or {rig.outputs[0].name: STILL}
    given = Record(name, DT, signals, units, kind="multisine", role=role, constants=dict(constants or {}))
    clean = simulate(compose(rig), {**values, **given.constants}, given, start, accuracy=1e-8)
    noisy = {
        s.name: clean[s.name] + NOISE * np.std(clean[s.name]) * rng.standard_normal(N) for s in rig.outputs
    }
    return clean.with_signals(**noisy)


def identified(
    rig: Rig,
    records: list[Record],
    constants: Mapping[str, float],
    truth: Mapping[str, float],
    monkeypatch: pytest.MonkeyPatch,
) -> Identification:
    """Identify from start values a fifth beside the truth: how such are found is not the question here."""
    start = {p.name: 1.2 * truth[p.name] for p in rig.parameters}
    monkeypatch.setattr(any_rig, "linear_start", lambda *_: start)
    campaign = make_campaign(rig, records, constants=constants)
    return identify_campaign(campaign, checked_options("local_rational", None))


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


def test_parameters_come_with_what_is_identifiable(arm: Identification) -> None:
    told = arm.identifiability
    assert told is not None
    assert told.determined == ("I_2", "s_2", "d_1", "d_2")
    assert told.sentence.endswith("I_1, m_2 and s_1 only as I_1 + 0.09 m_2 and s_1 + 0.3 m_2.")
    fit = arm.joint.fit.fit
    for name in told.determined:
        assert abs(fit.values[name] - ARM[name]) < 4.0 * fit.standard_errors[name] < 0.1 * ARM[name]
    assert all(np.isinf(fit.standard_errors[name]) for name in ("I_1", "m_2", "s_1"))
    sums = {c.text: c for c in told.combinations}
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


DECAY = """
name = "swing"
summary = "A weight on a rod swings until it rests."
[constants.g]
unit = "m/s^2"
default = 9.81
[constants.m]
unit = "kg"
default = 1.0
[parameters.l]
unit = "m"
log = true
about = "length of the rod"
[parameters.c]
unit = "1/s"
lower = 0.0
about = "damping by the mass"
[coordinates.phi]
unit = "rad"
[energy]
kinetic = "m*l^2*d(phi)^2/2"
potential = "-m*g*l*cos(phi)"
[joints.pivot]
motion = "phi"
damping = "c*m*l^2"
[sensors.angle]
reads = "phi"
unit = "rad"
"""


def test_a_rig_without_inputs_has_poles_and_no_responses(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "swing.toml").write_text(DECAY, "utf-8")
    rig, rng = read_rig_file(tmp_path / "swing.toml"), np.random.default_rng(5)
    truth = {"g": 9.81, "m": 1.0, "l": 0.7, "c": 0.2}
    records = [recorded("decay", rig, truth, {}, rng, start=np.array([0.4, 0.0]))]
    found = identified(rig, [replace(r, kind="operation") for r in records], {}, truth, monkeypatch)
    fit = found.joint.fit.fit
    for name in ("l", "c"):
        assert abs(fit.values[name] - truth[name]) < 4.0 * fit.standard_errors[name] < 0.05 * truth[name]
    (view,) = found.views
    assert view.measured is None
    assert view.modes[0].natural_frequency == pytest.approx(np.sqrt(9.81 / 0.7), rel=1e-3)
    write_identification(found, tmp_path / "out")
    assert "no inputs" in (tmp_path / "out" / "identification.html").read_text("utf-8")


STAGE = """
name = "stage"
summary = "A voice coil moves a carriage against a leaf spring."
[inputs.current]
unit = "A"
[constants.force_constant]
unit = "N/A"
default = 12.0
[parameters.carriage]
unit = "kg"
log = true
[parameters.friction]
unit = "N s/m"
lower = 0.0
[parameters.leaf]
unit = "N/m"
lower = 0.0
[coordinates.position]
unit = "m"
[energy]
kinetic = "carriage*d(position)^2/2"
[joints.guide]
motion = "position"
damping = "friction"
stiffness = "leaf"
[drives.coil]
signal = "current"
force = "force_constant*coil"
along = "position"
[sensors.scale]
reads = "position"
unit = "m"
"""


def test_one_mass_with_names_of_its_own_is_identified_from_files(tmp_path: Path) -> None:
    (tmp_path / "stage.toml").write_text(STAGE, "utf-8")
    rig, rng = read_rig_file(tmp_path / "stage.toml"), np.random.default_rng(6)
    truth = {"force_constant": 12.0, "carriage": 0.8, "friction": 3.0, "leaf": 400.0}
    record = recorded("sweep", rig, truth, {"current": linear_sweep(T, 0.5, 2.0, 60.0)}, rng)
    columns = np.column_stack([T, record["current"], record["scale"]])
    np.savetxt(
        tmp_path / "sweep.csv", columns, delimiter=",", header="t,current,scale", comments="", fmt="%.9g"
    )
    (tmp_path / "campaign.toml").write_text(
        '[rig]\nfile = "stage.toml"\n\n[[records]]\nfile = "sweep.csv"\nrole = "estimation"\nkind = "sweep"\n',
        "utf-8",
    )
    found = run_identify(tmp_path, tmp_path / "out", n_jobs=1)
    assert found.identifiability is not None
    assert found.identifiability.determined == ("carriage", "friction", "leaf")
    for name in found.identifiability.determined:
        value, error = found.joint.fit.fit.values[name], found.joint.fit.fit.standard_errors[name]
        assert abs(value - truth[name]) < 4.0 * error < 0.1 * truth[name]
    assert found.views[0].modes[0].natural_frequency == pytest.approx(np.sqrt(400.0 / 0.8), rel=1e-3)
    assert (tmp_path / "out" / "identification.html").is_file()


def test_a_method_for_one_input_is_refused() -> None:
    rng, rig = np.random.default_rng(7), RIGS["drive_train"]
    campaign = make_campaign(rig, [recorded("one", rig, TRAIN, {"u": multisine(rng, 0.3, 200.0)}, rng)])
    with pytest.raises(InputError, match="Allowed: 'local_polynomial', 'local_rational'"):
        identify_campaign(campaign, checked_options("h1", None))


def test_poles_are_those_of_the_place_that_the_records_show(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = DECAY.replace('"-m*g*l*cos(phi)"', '"m*g*l*cos(phi)"')
    (tmp_path / "swing.toml").write_text(text, "utf-8")
    rig, rng = read_rig_file(tmp_path / "swing.toml"), np.random.default_rng(8)
    truth = {"g": 9.81, "m": 1.0, "l": 0.7, "c": 0.2}
    # Counted from above: the start that the file declares, zero, is where no pendulum stays.
    records = [recorded("decay", rig, truth, {}, rng, start=np.array([2.7, 0.0]))]
    (view,) = identified(rig, records, {}, truth, monkeypatch).views
    assert view.linearization.stability == "stable"
    assert view.linearization.at_state[0] == pytest.approx(np.pi)


def test_a_sensor_that_nobody_recorded_is_named_if_it_would_help(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = STAGE.replace(
        "[coordinates.position]", '[parameters.span]\nunit = "1"\nlog = true\n[coordinates.position]'
    )
    text = text.replace('reads = "position"', 'reads = "span*position"')
    for name, sensor in (("laser", "position"), ("tachometer", "span*d(position)")):
        unit = "m" if name == "laser" else "m/s"
        text += f'[sensors.{name}]\nreads = "{sensor}"\nunit = "{unit}"\n'
    (tmp_path / "stage.toml").write_text(text, "utf-8")
    rig, rng = read_rig_file(tmp_path / "stage.toml"), np.random.default_rng(9)
    truth = {"force_constant": 12.0, "carriage": 0.8, "friction": 3.0, "leaf": 400.0, "span": 1.1}
    whole = recorded("sweep", rig, truth, {"current": linear_sweep(T, 0.5, 2.0, 60.0)}, rng)
    kept = {name: whole[name] for name in ("current", "scale")}
    told = identified(rig, [replace(whole, signals=kept)], {}, truth, monkeypatch).identifiability
    assert told is not None
    assert told.determined == ()
    # The tachometer scales as the scale does.
    assert told.remedies == ("If 'laser' were also recorded, these inputs would determine all parameters.",)
    assert told.sentence.endswith(told.remedies[0])


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


def test_the_name_of_a_rig_changes_nothing() -> None:
    """The axis copied into a file of one's own, under a name of one's own, is still the axis."""
    rng, axis = np.random.default_rng(1), RIGS["axis"]
    values = {"gain": 1.0, "m": 1.0, "d": 1.6, "k": 100.0, "x_off": 0.0, "force_off": 0.0}
    record = recorded("one", axis, values, {"u": multisine(rng, 1.0, 60.0)}, rng)
    stage = rig_of_text(rig_file_text("axis").replace('name = "axis"', 'name = "stage"'))
    found = {}
    for rig in (axis, stage):
        campaign = make_campaign(rig, [record], title="same")
        regression_data(campaign)
        found[rig.name] = identify_campaign(campaign, checked_options("local_rational", None))
    own = {name: identification_json(one, {}) for name, one in found.items()}
    assert own["axis"]["records"][0]["paths"][0]["fit"] is not None
    for content in own.values():
        content.pop("rig")
    assert json.dumps(own["axis"]) == json.dumps(own["stage"])


def test_a_rig_of_one_motion_in_other_words_is_refused_where_words_count() -> None:
    words = (
        rig_file_text("axis")
        .replace('name = "axis"', 'name = "stage"')
        .replace("[parameters.d]", "[parameters.damper]")
    )
    stage = rig_of_text(words.replace('damping = "d"', 'damping = "damper"'))
    t = np.linspace(0.0, 1.0, 50)
    record = Record("one", 0.02, {"u": np.sin(t), "x": np.cos(t)}, {"u": "N", "x": "m"})
    with pytest.raises(InputError, match="your rig 'stage': for rigs of one motion it supports only axis"):
        regression_data(make_campaign(stage, [record]))

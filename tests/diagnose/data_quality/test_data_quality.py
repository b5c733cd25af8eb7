"""Faults of the data are told with their mend, and sound records of any rig are left in peace."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from rigsight.diagnose.data_quality.amplitude_response import amplitude_dependences
from rigsight.diagnose.data_quality.checks import data_quality, sensor_faults, with_best_model
from rigsight.diagnose.data_quality.finding import DataQuality, Finding
from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.noise.detection import noise_floors
from rigsight.diagnose.search.single_effects import fit_candidate, reidentify
from rigsight.effects import effect_named
from rigsight.excitation import linear_sweep
from rigsight.identify import characteristic_scales, linear_start
from rigsight.identify.fit.windows import liveliest
from rigsight.records import Hold, Record
from rigsight.rigs import AXIS, ELEMENT, RIGS, RUNNING_GEAR, Rig
from rigsight.simulate import compose, simulate
from rigsight.workflow.campaign.read_campaign import read_campaign

CONSTANTS = {"gain": 1.0}
VALUES = {**CONSTANTS, "m": 2.0, "d": 5.0, "k": 800.0, "x_off": 0.0, "force_off": 0.0}
GEAR_CONSTANTS = {"v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27}
GEAR_VALUES = {
    **GEAR_CONSTANTS, "J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "l_0": 0.25, "c_y": 0.98, "psi_off": 1e-3, "y_off": 2e-4
}  # fmt: skip
DT, NOISE = 5e-3, 2e-5
SHIFTED = 2
CUBIC = ("cubic_stiffness", {"k_3": 5e6})


def sweeps(
    rig: Rig = AXIS,
    values: dict[str, float] = VALUES,
    effect: tuple[str, dict[str, float]] | None = None,
    hold: Hold = "foh",
    seed: int = 0,
    highest: float = 60.0,
) -> list[Record]:
    """Two sweeps to fit and one to score, of three amplitudes, with sensor noise."""
    rng = np.random.default_rng(seed)
    t = DT * np.arange(4000)
    structure = compose(rig, [] if effect is None else [effect_named(effect[0])])
    records = []
    for amplitude, role in ((1.0, "estimation"), (3.0, "estimation"), (2.0, "validation")):
        u = linear_sweep(t, amplitude, 2.0, highest)
        driven = Record(
            f"sweep_{amplitude:g}", DT, {"u": u}, {}, kind="sweep", amplitude=amplitude, hold=hold, role=role
        )
        clean = simulate(structure, {**values, **(effect[1] if effect else {})}, driven)
        outputs = [signal.name for signal in rig.outputs]
        records.append(
            clean.with_signals(
                **{name: clean[name] + rng.normal(scale=NOISE, size=t.size) for name in outputs}
            )
        )
    return records


def prepared(
    records: Sequence[Record], rig: Rig = AXIS, constants: dict[str, float] = CONSTANTS
) -> tuple[FitContext, FittedModel]:
    estimation = [record for record in records if record.role == "estimation"]
    start = {**constants, **linear_start(rig, estimation, constants, {})}
    context = FitContext(
        rig=rig,
        estimation=tuple(estimation),
        scoring=tuple(record for record in records if record.role == "validation"),
        look=liveliest(estimation, rig, 8000),
        scales=characteristic_scales(rig, estimation, start),
        noise={floor.output: floor.std for floor in noise_floors(rig, records)},
        held=frozenset(),
    )
    return context, reidentify(context, start)


def examined(
    records: Sequence[Record], rig: Rig = AXIS, constants: dict[str, float] = CONSTANTS
) -> DataQuality:
    context, reidentified = prepared(records, rig, constants)
    return data_quality(context, records, reidentified)


def misdeclared(records: Sequence[Record], hold: Hold) -> list[Record]:
    return [replace(record, hold=hold) for record in records]


def with_first(records: list[Record], change: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> Record:
    return records[0].with_signals(x=change(np.array(records[0]["x"])))


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("hold", ["zoh", "foh", "band_limited"])
def test_sound_records_are_left_in_peace(hold: Hold, seed: int):
    quality = examined(sweeps(hold=hold, seed=seed))
    assert quality.findings == ()
    assert quality.amplitudes[0].response == "no"


def test_sound_records_of_the_running_gear_are_left_in_peace():
    quality = examined(sweeps(RUNNING_GEAR, GEAR_VALUES), RUNNING_GEAR, GEAR_CONSTANTS)
    assert quality.findings == ()
    assert quality.amplitudes[0].response == "no"


@pytest.mark.parametrize(
    "effect",
    [
        CUBIC,
        ("coulomb_friction", {"T_c": 0.3}),
        ("bouc_wen_hysteresis", {"A": 1.0, "a": 0.4, "beta": 500.0, "gamma": -100.0, "n": 1.0}),
        ("quadratic_damping", {"c_2": 100.0}),
    ],
    ids=lambda effect: effect[0],
)
def test_a_nonlinear_effect_is_no_fault_of_the_data(effect):
    quality = examined(sweeps(effect=effect))
    assert quality.findings == ()
    assert quality.amplitudes[0].response == "yes"
    assert "a nonlinear effect is involved" in quality.notes[-1]


def test_what_scatters_too_much_is_not_called_linear():
    """Play scatters the response from line to line by more than it changes with the amplitude."""
    quality = examined(sweeps(effect=("backlash", {"g": 5e-4})))
    assert quality.findings == ()
    assert quality.amplitudes[0].response == "cannot tell"


def test_a_flexible_mode_is_linear():
    quality = examined(sweeps(effect=("flexible_mode", {"m_a": 0.3, "w_a": 35.0, "zeta_a": 0.03})))
    assert quality.findings == ()
    assert quality.amplitudes[0].response == "no"


@pytest.mark.parametrize(("true", "given"), [("foh", "zoh"), ("band_limited", "zoh")])
def test_a_wrong_hold_that_no_delay_explains_is_serious(true: Hold, given: Hold):
    (finding,) = examined(misdeclared(sweeps(hold=true), given)).findings
    assert (finding.kind, finding.serious) == ("hold", True)
    assert finding.explained == pytest.approx(1.0, abs=0.01)
    assert f'"{true}"' in finding.remedy
    assert "campaign.toml" in finding.remedy


def test_a_hold_that_a_delay_explains_as_well_is_told_with_its_rival():
    (finding,) = examined(misdeclared(sweeps(hold="zoh"), "foh")).findings
    assert (finding.kind, finding.serious) == ("hold", False)
    assert 'hold = "zoh"' in finding.remedy
    assert "a time offset of 2.5" in finding.sentence


@pytest.mark.parametrize(("sign", "serious"), [(-1, True), (1, False)])
def test_a_shift_of_the_time_base_is_measured(sign: int, serious: bool):
    """Outputs ahead of their cause are a fault of the data; late ones may be a delay."""
    cut = {
        -1: (slice(None, -SHIFTED), slice(SHIFTED, None)),
        1: (slice(SHIFTED, None), slice(None, -SHIFTED)),
    }
    inputs, outputs = cut[sign]
    records = [replace(r, signals={"u": r["u"][inputs], "x": r["x"][outputs]}) for r in sweeps()]
    (finding,) = examined(records).findings
    assert (finding.kind, finding.serious) == ("time_shift", serious)
    reported = re.search(r"come (\S+) ms", finding.sentence)
    assert reported is not None
    assert float(reported.group(1)) == pytest.approx(1e3 * SHIFTED * DT, abs=0.05)
    assert finding.explained == pytest.approx(1.0, abs=0.01)


def test_a_hold_hidden_by_an_effect_shows_with_the_effect_in_the_model():
    context, reidentified = prepared(misdeclared(sweeps(effect=CUBIC, hold="foh"), "zoh"))
    quality = data_quality(context, (*context.estimation, *context.scoring), reidentified)
    assert quality.findings == ()
    model = fit_candidate(context, (effect_named("cubic_stiffness"),), reidentified.fit)
    (finding,) = with_best_model(quality, context, model).findings
    assert finding.kind == "hold"
    assert finding.sentence.startswith("With cubic_stiffness in the model: ")
    assert '"foh"' in finding.remedy
    assert finding.explained == pytest.approx(1.0, abs=0.02)


@pytest.mark.slow
def test_a_delay_of_half_a_sample_in_the_model_hides_no_wrong_hold():
    context, reidentified = prepared([replace(r, hold="foh") for r in sweeps(effect=CUBIC, hold="zoh")])
    pair = (effect_named("cubic_stiffness"), effect_named("input_delay"))
    single = fit_candidate(context, pair[:1], reidentified.fit)
    model = fit_candidate(context, pair, single.fit)
    assert model.fit.values["T_d"] == pytest.approx(0.5 * DT, rel=0.1)
    quality = data_quality(context, (*context.estimation, *context.scoring), reidentified)
    (finding,) = with_best_model(replace(quality, findings=()), context, model).findings
    assert finding.kind == "hold"
    assert finding.sentence.startswith("With cubic_stiffness in the model: ")
    assert '"zoh"' in finding.remedy
    assert "a delay in the rig" in finding.sentence
    assert finding.serious


def test_a_hold_that_seemed_wrong_without_the_effect_is_not_told_with_it():
    context, reidentified = prepared(sweeps(effect=CUBIC))
    quality = data_quality(context, (*context.estimation, *context.scoring), reidentified)
    seemed = replace(quality, findings=(Finding("hold", "Another hold.", "Set it."), *quality.findings))
    model = fit_candidate(context, (effect_named("cubic_stiffness"),), reidentified.fit)
    assert with_best_model(seemed, context, model).findings == quality.findings


def test_a_right_hold_stays_right_with_the_effect_in_the_model():
    context, reidentified = prepared(sweeps(effect=CUBIC))
    quality = data_quality(context, (*context.estimation, *context.scoring), reidentified)
    model = fit_candidate(context, (effect_named("cubic_stiffness"),), reidentified.fit)
    assert with_best_model(quality, context, model) is quality


def clipped(x):
    return np.clip(x, -0.7 * np.max(x), 0.7 * np.max(x))


def stuck(x):
    x[1500:1600] = x[1500]
    return x


def coarse(x):
    return np.round(x / (np.ptp(x) / 60)) * (np.ptp(x) / 60)


def with_spike(x):
    x[2000] += np.std(x)
    return x


def with_lost_counts(x):
    x[2000:] += 0.5 * np.std(x)
    return x


@pytest.mark.parametrize(
    ("fault", "kind", "reported"),
    [
        (clipped, "clipping", "is clipped at"),
        (stuck, "stuck", "is exactly constant from 7.5 s to 7.995 s"),
        (coarse, "quantization", "61 levels"),
        (with_spike, "jump", "at 10 s"),
        (with_lost_counts, "jump", "at 10 s"),
    ],
)
def test_a_channel_at_fault_is_told_with_its_place(fault, kind, reported):
    records = sweeps()
    found = sensor_faults(AXIS, [with_first(records, fault)])
    assert {finding.kind for finding in found} == {kind}
    assert reported in found[0].sentence
    assert {(finding.record, finding.signal) for finding in found} == {("sweep_1", "x")}
    for record in records:
        assert sensor_faults(AXIS, [record]) == []


def test_a_level_that_another_record_exceeds_is_not_the_end_of_a_range():
    """A servo rests at its target."""
    smaller, larger = with_first(sweeps(), clipped), sweeps()[1]
    assert {finding.kind for finding in sensor_faults(AXIS, [smaller])} == {"clipping"}
    assert sensor_faults(AXIS, [smaller, larger]) == []


def test_the_force_of_an_element_that_is_moved_in_steps_is_not_coarse():
    x = 1e-3 * np.repeat([0.0, 1.0, 3.0, 0.0], 500)
    staircase = Record("steps", DT, {"x": x, "force": 1e4 * x}, {}, kind="step")
    assert sensor_faults(ELEMENT, [staircase]) == []
    (finding,) = sensor_faults(
        ELEMENT, [staircase.with_signals(force=coarse(1e4 * x + np.sin(np.arange(x.size))))]
    )
    assert finding.kind == "quantization"


def test_a_channel_at_fault_does_not_speak_of_amplitude():
    """Clipping makes the gain fall with amplitude as a nonlinear effect does."""
    records = sweeps()
    first, largest, last = records
    quality = examined([first, largest.with_signals(x=clipped(largest["x"])), last])
    assert {finding.kind for finding in quality.findings} == {"clipping"}
    assert quality.amplitudes[0].response == "no"
    assert largest.name not in quality.amplitudes[0].records


def test_a_rig_at_rest_and_dry_friction_are_not_stuck():
    """Without noise a sticking mass stands exactly still; it comes to rest and leaves it without a jump."""
    t = DT * np.arange(3000)
    u = np.where(t > 5.0, 1.0, 0.0) * np.sin(3.0 * t)
    record = Record("rest", DT, {"u": u}, {})
    moving = simulate(
        compose(AXIS, [effect_named("coulomb_friction")]), {**VALUES, "d": 60.0, "T_c": 0.6}, record
    )
    assert np.count_nonzero(np.diff(moving["x"]) == 0.0) > 500
    assert sensor_faults(AXIS, [moving]) == []


def test_a_constant_start_is_not_stuck():
    """An encoder stands exactly still until the drive sets in, and leaves its rest by whole steps."""
    t = 1e-4 * np.arange(6000)
    drive = np.where(t > 0.1, 1.0, 0.0) * np.sin(20.0 * (t - 0.1))
    moving = simulate(compose(AXIS), VALUES, Record("start", 1e-4, {"u": 0.5 + drive}, {}))
    encoder = 0.5 * np.max(np.abs(np.diff(moving["x"])))
    counted = moving.with_signals(x=encoder * np.round(moving["x"] / encoder))
    still = np.flatnonzero(np.diff(counted["x"]))[0]
    assert still > 500
    assert not [f for f in sensor_faults(AXIS, [counted]) if f.kind == "stuck"]


def test_an_encoder_that_begins_again_at_any_number_is_offered_its_period() -> None:
    angle = 40.0 * np.sin(2.0 * DT * np.arange(4000))
    counts = np.floor(np.mod(angle / (2.0 * np.pi) * 1000.0, 1000.0))
    record = sweeps()[0].with_signals(x=counts * 2.0 * np.pi / 1000.0)
    (found,) = sensor_faults(AXIS, [record])
    assert (found.kind, "unwrap = N" in found.remedy, "6.283 m" in found.remedy) == ("jump", True, True)


def test_an_encoder_that_toggles_by_one_count_does_not_jump():
    record = sweeps()[0]
    size = np.ptp(record["u"]) / 20
    given, resting = size * np.round(record["u"] / size), np.zeros(record.n_samples)
    # Of fewer levels than the input, so that it is not called coarse.
    resting[300::397] = 1e-3
    assert sensor_faults(AXIS, [record.with_signals(u=given, x=resting)]) == []
    resting[2100:] += 5e-3
    (found,) = sensor_faults(AXIS, [record.with_signals(u=given, x=resting)])
    assert found.kind == "jump"


def test_steps_of_several_heights_are_not_said_to_be_one_amplitude():
    record = replace(sweeps()[0], kind="step", amplitude=None)
    steps = [replace(record.with_signals(u=h * record["u"]), name=f"s{h}") for h in (1.0, 2.0, 3.0)]
    (reported,) = amplitude_dependences(AXIS, steps)
    assert (reported.response, "3 heights" in reported.sentence) == ("cannot tell", True)


def test_one_amplitude_cannot_tell():
    record = sweeps()[0]
    quality = examined([record, replace(record, name="again", role="validation")])
    assert quality.amplitudes[0].response == "cannot tell"
    assert "Record another amplitude" in quality.amplitudes[0].sentence


def test_the_list_of_the_file_says_the_same():
    quality = examined(misdeclared(sweeps(), "zoh"))
    content = json.loads(json.dumps(quality.to_json()))
    assert [entry["kind"] for entry in content] == ["hold", "amplitude_dependence"]
    assert content[0]["mend"] == quality.findings[0].remedy
    assert content[1]["answer"] == "no"


def measured(folder: Path, hold: Hold | None = None) -> tuple[FitContext, FittedModel, DataQuality]:
    campaign = read_campaign(folder)
    records = campaign.records if hold is None else misdeclared(campaign.records, hold)
    context, reidentified = prepared(records, campaign.rig, campaign.constants)
    return context, reidentified, data_quality(context, records, reidentified)


def test_measured_oscillator_shows_its_hold_once_the_cubic_spring_is_in(shared_data: Path):
    context, reidentified, quality = measured(shared_data / "silverbox", "foh")
    assert quality.findings == ()
    model = fit_candidate(context, (effect_named("cubic_stiffness"),), reidentified.fit)
    (finding,) = with_best_model(quality, context, model).findings
    assert (finding.kind, finding.serious) == ("hold", True)
    assert '"band_limited"' in finding.remedy
    assert finding.explained is not None
    assert finding.explained > 0.8


@pytest.mark.parametrize("campaign", ["silverbox", "boucwen", "mr_damper/campaign_off.toml"])
def test_measured_campaigns_as_they_are_declared_have_no_fault(shared_data: Path, campaign: str):
    assert measured(shared_data / campaign)[2].findings == ()


def test_an_element_has_no_frequency_response(shared_data: Path):
    _, _, quality = measured(shared_data / "mr_damper/campaign_on.toml")
    assert ELEMENT.is_driven is False
    assert quality.amplitudes[0].response == "cannot tell"


def test_a_reading_that_an_input_may_move_at_once_is_not_told_to_jump():
    """An acceleration jumps with the force; a displacement does not."""
    rng = np.random.default_rng(0)
    travel, body = (np.cumsum(rng.normal(size=4000)) for _ in range(2))
    travel, body = (uniform_filter1d(samples, 50) for samples in (travel, body))
    jumps = np.where(np.arange(4000) > 2000, np.ptp(travel) + np.ptp(body), 0.0)
    record = Record("r", DT, {"travel": travel + jumps, "body": body + jumps}, {})
    assert [found.signal for found in sensor_faults(RIGS["quarter_car"], [record])] == ["travel"]

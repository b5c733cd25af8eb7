"""The whole diagnosis names what was hidden, and says so where it cannot."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from rigsight.campaign import Campaign
from rigsight.diagnose.diagnosis import diagnose
from rigsight.diagnose.result import Diagnosis
from rigsight.effects import effect_named
from rigsight.errors import InputError
from rigsight.excitation import linear_sweep
from rigsight.records import Record
from rigsight.report.wording import basis_sentence
from rigsight.rigs import AXIS, ELEMENT, RUNNING_GEAR, Rig
from rigsight.simulate import compose, simulate

DT = 5e-3
T = DT * np.arange(1500)
NOISE = 2e-5
STAGE = {"gain": 1.0, "m": 2.0, "d": 5.0, "k": 800.0, "x_off": 0.0, "force_off": 0.0}
GIVEN = {name: STAGE[name] for name in ("m", "d", "k")}
GEAR = {
    "v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27,
    "J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "psi_off": 0.0, "l_0": 0.25, "c_y": 0.98, "y_off": 0.0,
}  # fmt: skip
RUNS = ((4.0, "estimation"), (2.0, "estimation"), (3.0, "validation"))
CANDIDATES = ("cubic_stiffness", "quadratic_damping")


def sweep(amplitude: float) -> NDArray[np.float64]:
    """A second of rest, from which the noise is known, and a sweep through the resonance."""
    return np.concatenate([np.zeros(200), linear_sweep(T, amplitude, 3.0, 50.0)])


def measured(
    rig: Rig,
    effects: Sequence[str],
    values: Mapping[str, float],
    inputs: Sequence[NDArray[np.float64]],
    noise: float = NOISE,
) -> tuple[Record, ...]:
    """Records of a rig with hidden effects: two to fit, one to score."""
    structure = compose(rig, [effect_named(name) for name in effects])
    records = []
    for i, (samples, (_, role)) in enumerate(zip(inputs, RUNS, strict=True)):
        rng = np.random.default_rng(i)
        signals = {rig.inputs[0].name: samples}
        record = Record(name=f"run {i}", dt=DT, signals=signals, units={}, role=role, kind="sweep")
        clean = simulate(structure, values, record)
        noisy = {s.name: clean[s.name] + noise * rng.standard_normal(samples.size) for s in rig.outputs}
        records.append(clean.with_signals(**noisy))
    return tuple(records)


def stage(effects: Sequence[str], **values: float) -> tuple[Record, ...]:
    return measured(AXIS, effects, {**STAGE, **values}, [sweep(amplitude) for amplitude, _ in RUNS])


def diagnosed(
    records: Sequence[Record],
    candidates: Sequence[str] = CANDIDATES,
    given: Mapping[str, float] = GIVEN,
    seed: int = 0,
) -> Diagnosis:
    campaign = Campaign("stage", AXIS, {"gain": 1.0}, given, tuple(records))
    return diagnose(campaign, [effect_named(name) for name in candidates], seed)


@pytest.fixture(scope="module")
def cubic_records() -> tuple[Record, ...]:
    return stage(["cubic_stiffness"], k_3=5e6)


@pytest.fixture(scope="module")
def cubic(cubic_records: tuple[Record, ...]) -> Diagnosis:
    return diagnosed(cubic_records)


def test_the_hidden_effect_is_named_and_closes_the_gap(cubic: Diagnosis) -> None:
    assert (cubic.verdict, cubic.effects, cubic.where) == ("effect", ("cubic_stiffness",), ("dynamics",))
    assert cubic.ambiguous_with == ()
    gap = cubic.gap["x"]
    assert gap.before > gap.reidentified > gap.after
    assert gap.closed == pytest.approx(1.0, abs=0.01)
    # The model was never fitted to the validation record, so nothing but its sensor noise may remain.
    assert gap.after == pytest.approx(gap.noise_floor, rel=0.1)


def test_its_parameters_come_with_standard_errors(cubic: Diagnosis) -> None:
    parameters = cubic.candidates[0].parameters
    assert parameters["k_3"].unit == "N/m^3"
    for name, true in {**GIVEN, "k_3": 5e6}.items():
        estimate = parameters[name]
        assert abs(estimate.value - true) < 4.0 * estimate.std < 0.1 * true, name


def test_the_model_is_the_simulation_with_the_effect(cubic: Diagnosis) -> None:
    assert cubic.model["effects"] == ["cubic_stiffness"]
    assert cubic.model["effect_parameters"]["k_3"] == cubic.candidates[0].parameters["k_3"].value


def test_the_gap_is_that_of_the_given_simulation(cubic: Diagnosis, cubic_records: tuple[Record, ...]) -> None:
    validation = cubic_records[-1]
    given = simulate(compose(AXIS), STAGE, validation)
    error = np.std(validation["x"] - given["x"]) / np.std(validation["x"])
    # The diagnosis estimates offset and initial state, which a rig at rest hardly needs.
    assert cubic.gap["x"].before == pytest.approx(error, rel=0.02)


@pytest.mark.slow
def test_what_a_loose_rig_does_at_rest_is_not_taken_for_noise(cubic_records: tuple[Record, ...]) -> None:
    rng = np.random.default_rng(3)
    wandering = []
    for record in cubic_records:
        x = record["x"].copy()
        x[:200] += 10.0 * NOISE * rng.standard_normal(200)
        wandering.append(record.with_signals(x=x))
    diagnosis = diagnosed(wandering)
    assert diagnosis.effects == ("cubic_stiffness",)
    assert diagnosis.noise_floors[0].lower_bound
    assert diagnosis.noise_floors[0].std == pytest.approx(NOISE, rel=0.2)
    assert any("the rig was moving at rest" in note for note in diagnosis.notes)


def test_none_when_the_given_simulation_is_right() -> None:
    diagnosis = diagnosed(stage([]))
    assert (diagnosis.verdict, diagnosis.effects, diagnosis.where) == ("none", (), ())
    assert diagnosis.gap["x"].before == pytest.approx(diagnosis.gap["x"].noise_floor, rel=0.1)


def test_parameters_when_only_the_numbers_are_wrong() -> None:
    diagnosis = diagnosed(stage([]), given={"m": 2.2, "d": 8.0, "k": 800.0})
    assert (diagnosis.verdict, diagnosis.effects) == ("parameters", ())
    assert diagnosis.gap["x"].closed == pytest.approx(1.0, abs=0.01)
    assert diagnosis.model["parameters"]["m"] == pytest.approx(2.0, rel=0.01)


def test_unknown_when_the_true_effect_is_not_among_the_candidates() -> None:
    """The rig has a dead zone in its drive; the candidates are a cubic spring and quadratic damping."""
    diagnosis = diagnosed(stage(["input_dead_zone"], u_0=0.6))
    assert (diagnosis.verdict, diagnosis.effects) == ("unknown", ())
    assert diagnosis.gap["x"].reidentified > 5.0 * diagnosis.gap["x"].noise_floor
    assert diagnosis.candidates[0].probability < 0.5


@pytest.mark.slow
def test_without_given_numbers_the_gap_is_that_of_the_best_linear_ones(cubic_records) -> None:
    diagnosis = diagnosed(cubic_records, ("cubic_stiffness",), given={})
    gap = diagnosis.gap["x"]
    assert gap.before == gap.reidentified
    assert diagnosis.effects == ("cubic_stiffness",)


@pytest.mark.slow
def test_models_of_an_axis_without_a_spring_follow_its_motion() -> None:
    records = stage(["coulomb_friction"], T_c=0.8, k=0.0, d=3.0)
    diagnosis = diagnosed(records, ("coulomb_friction", "quadratic_damping"), {"m": 2.0, "d": 3.0, "k": 0.0})
    assert diagnosis.effects == ("coulomb_friction",)
    assert diagnosis.windows is None
    assert diagnosis.bandwidth is not None
    assert diagnosis.to_json()["observer_bandwidth"] == diagnosis.bandwidth
    assert any(f"up to {diagnosis.bandwidth:.3g} rad/s" in note for note in diagnosis.notes)
    friction = diagnosis.candidates[0].parameters["T_c"]
    assert abs(friction.value - 0.8) < 4.0 * friction.std < 0.08
    assert "k" not in diagnosis.candidates[0].parameters


def context(effect: str, own: Mapping[str, float]) -> Diagnosis:
    values = {"k": 4e3, "d": 120.0, "force_off": 3.0, **own}
    t = T[:800]
    inputs = [0.005 * amplitude * np.sin(3.0 * t + 2.0 * t**2) for amplitude, _ in RUNS]
    records = measured(ELEMENT, [effect], values, inputs, noise=0.05)
    candidates = [effect_named(name) for name in ("coulomb_friction", "bouc_wen_hysteresis")]
    return diagnose(Campaign("damper", ELEMENT, {}, {"k": 4e3, "d": 120.0}, records), candidates)


@pytest.mark.parametrize(
    ("effect", "own"),
    [
        ("coulomb_friction", {"T_c": 30.0}),
        ("bouc_wen_hysteresis", {"A": 1.0, "a": 0.4, "beta": 200.0, "gamma": -50.0, "n": 1.0}),
    ],
)
def test_a_force_element(effect: str, own: Mapping[str, float]) -> None:
    diagnosis = context(effect, own)
    assert (diagnosis.verdict, diagnosis.effects) == ("effect", (effect,))
    # The noise is 0.05 N; a force that jumps at each reversal must not be taken for it.
    (floor,) = diagnosis.noise_floors
    assert floor.std == pytest.approx(0.05, rel=0.2)
    assert diagnosis.gap["force"].closed == pytest.approx(1.0, abs=0.01)


@pytest.mark.slow
def test_a_running_gear_whose_records_lack_the_lateral_displacement() -> None:
    inputs = [sweep(0.25 * amplitude) for amplitude, _ in RUNS]
    full = measured(RUNNING_GEAR, ["cubic_stiffness"], {**GEAR, "k_3": 2e5}, inputs)
    records = tuple(
        Record(name=r.name, dt=r.dt, signals={n: r[n] for n in ("u", "psi")}, units={}, role=r.role)
        for r in full
    )
    constants = {name: GEAR[name] for name in ("v", "r_0", "b", "k_tau")}
    given = {name: GEAR[name] for name in ("J_z", "k_c", "k_d")}
    candidates = [effect_named(name) for name in CANDIDATES]
    diagnosis = diagnose(Campaign("gear", RUNNING_GEAR, constants, given, records), candidates)
    assert (diagnosis.effects, diagnosis.where) == (("cubic_stiffness",), ("yaw_dynamics",))
    assert set(diagnosis.gap) == {"psi"}
    assert diagnosis.gap["psi"].closed == pytest.approx(1.0, abs=0.01)
    # What no record speaks of is not among the estimates.
    assert not {"l_0", "c_y", "y_off"} & set(diagnosis.candidates[0].parameters)


@pytest.mark.slow
def test_without_a_validation_record_errors_are_those_of_the_fit_and_it_says_so(cubic_records) -> None:
    fitted = [r for r in cubic_records if r.role == "estimation"]
    diagnosis = diagnosed(fitted, ("cubic_stiffness",))
    assert (diagnosis.scored_on, diagnosis.effects) == ("estimation", ("cubic_stiffness",))
    assert basis_sentence(diagnosis).startswith("There is no validation record")


def test_validation_records_alone_are_an_error(cubic_records) -> None:
    with pytest.raises(InputError, match="estimation"):
        diagnosed(cubic_records[-1:])


@pytest.mark.slow
def test_validation_records_are_never_fitted(cubic: Diagnosis, cubic_records) -> None:
    """Another validation record must leave every estimate as it was."""
    *fitted, validation = cubic_records
    other = validation.with_signals(x=validation["x"] * 1.3)
    diagnosis = diagnosed((*fitted, other))
    for candidate in diagnosis.candidates:
        before = next(c for c in cubic.candidates if c.effects == candidate.effects)
        if candidate.effects == cubic.effects:
            for name, estimate in candidate.parameters.items():
                assert estimate.value == pytest.approx(before.parameters[name].value, rel=1e-3), name


@pytest.mark.slow
def test_the_same_seed_gives_identical_results(cubic: Diagnosis, cubic_records: tuple[Record, ...]) -> None:
    again = diagnosed(cubic_records)
    assert json.dumps(again.to_json()) == json.dumps(cubic.to_json())
    assert json.dumps(again.model) == json.dumps(cubic.model)


@pytest.mark.slow
def test_the_number_of_jobs_does_not_change_the_result(cubic: Diagnosis, cubic_records) -> None:
    campaign = Campaign("stage", AXIS, {"gain": 1.0}, GIVEN, cubic_records)
    parallel = diagnose(campaign, [effect_named(name) for name in CANDIDATES], n_jobs=2)
    assert json.dumps(parallel.to_json()) == json.dumps(cubic.to_json())


def test_a_given_simulation_that_cannot_follow_a_validation_record_is_told() -> None:
    """Its spring softens so much that the strongest input, which only judges, carries it over the barrier."""
    records = measured(AXIS, (), STAGE, [sweep(amplitude) for amplitude in (1.0, 0.5, 6.0)])
    softening = effect_named("cubic_stiffness")
    given = {**GIVEN, "k_3": -800.0 / 0.03**2}
    campaign = Campaign("stage", AXIS, {"gain": 1.0}, given, records, (softening,))
    with pytest.raises(InputError, match=r"The given simulation cannot be run: .*'run 2'.*diverges"):
        diagnose(campaign, [effect_named("quadratic_damping")])


def test_json_follows_the_contract(cubic: Diagnosis) -> None:
    content = json.loads(json.dumps(cubic.to_json(), allow_nan=False))
    assert content["schema_version"] == 2
    contract = {
        "schema_version", "verdict", "effects", "where", "ambiguous_with", "candidates",
        "gap", "gap_by_record", "gap_by_band", "gap_by_amplitude", "gap_by_state",
    }  # fmt: skip
    assert contract <= set(content)
    assert set(content["gap"]["x"]) == {
        "before",
        "reidentified",
        "after",
        "noise_floor",
        "closed",
        "interval",
    }
    # These records name no amplitude of their input.
    assert all(
        content[name]
        for name in ("gap_by_record", "gap_by_band", "gap_by_state", "gap_by_path", "gap_by_time")
    )
    for own in content["gap_by_record"]:
        assert own["rms"] == pytest.approx(own["after"] * own["measured_rms"])
        assert 1.0 <= own["freedom"] <= own["n_samples"]
    asked = {(own["record"], own["name"]) for own in content["numbers_by_record"]}
    assert asked >= {
        (own["record"], name) for own in content["gap_by_record"] for name in ("k_3", "gain of x")
    }
    for candidate in content["candidates"]:
        assert {"effects", "probability", "validation_nrmse", "parameters"} <= set(candidate)
        assert set(candidate["validation_nrmse"]) == {"x"}
        for estimate in candidate["parameters"].values():
            assert set(estimate) == {"value", "std", "unit"}
    probabilities = [candidate["probability"] for candidate in content["candidates"]]
    assert probabilities == sorted(probabilities, reverse=True)
    assert math.fsum(probabilities) <= 1.0
    gap = content["gap"]["x"]
    closed = (gap["before"] - gap["after"]) / (gap["before"] - gap["noise_floor"])
    assert gap["closed"] == pytest.approx(closed, rel=1e-12)


def test_traces_hold_the_signals_behind_the_gap(cubic: Diagnosis, cubic_records: tuple[Record, ...]) -> None:
    trace = cubic.traces[0]
    assert (trace.record, trace.role) == ("run 2", "validation")
    np.testing.assert_array_equal(trace.measured["x"], cubic_records[-1]["x"])
    for stage_name in ("before", "reidentified", "after"):
        error = trace.measured["x"] - getattr(trace, stage_name)["x"]
        nrmse = np.sqrt(np.mean(error**2)) / np.std(trace.measured["x"])
        assert nrmse == pytest.approx(getattr(cubic.gap["x"], stage_name), rel=1e-9)

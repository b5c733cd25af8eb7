"""Models of a rig that drifts follow the measured motion: what they lack shows, what they drift does not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from rigsight.campaign import Campaign
from rigsight.diagnose.diagnosis import diagnose
from rigsight.diagnose.fit_context import start_values_of, structures_to_fit
from rigsight.diagnose.search.horizon import windowing_of
from rigsight.effects import CATALOGUE, effect_named, placed
from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.identify.fit.windows import Observer, followed_sensors
from rigsight.records import Record
from rigsight.rigs import AXIS, ELEMENT, read_rig_file
from rigsight.simulate import compose, record_values, simulate, simulate_outputs, structure_of_fit
from rigsight.simulate.simulation import parameter_vector, record_input

DT = 2e-3
T = DT * np.arange(4000)
VALUES = {"gain": 1.0, "m": 2.0, "d": 4.0, "k": 0.0, "x_off": 0.0, "force_off": 0.0}
NOISE = 1e-5
FRICTION = 1.0


def stage(
    effects: dict[str, dict[str, float]], disturbance: float = 0.0, seed: int = 0
) -> tuple[Record, ...]:
    """An axis without a spring on which a force acts that nobody recorded; its size is told in units of the friction."""
    rng = np.random.default_rng(seed)
    values = {**VALUES, **{name: value for own in effects.values() for name, value in own.items()}}
    structure = compose(AXIS, map(effect_named, effects))
    records = []
    for name, amplitude, role in (
        ("a", 2.0, "estimation"),
        ("b", 3.5, "estimation"),
        ("c", 2.5, "validation"),
    ):
        phases = rng.uniform(0.0, 2.0 * np.pi, 6)
        u = amplitude * sum(
            np.sin(2.0 * np.pi * f * T + p)
            for f, p in zip((0.3, 0.7, 1.1, 1.9, 2.7, 3.7), phases, strict=True)
        )
        force = lfilter([0.01], [1.0, -0.99], rng.standard_normal(T.size))
        force *= disturbance * FRICTION / float(np.std(force))
        x = simulate(structure, values, Record(name, DT, {"u": u + force}, {}))["x"]
        signals = {"u": u, "x": x + NOISE * rng.standard_normal(T.size)}
        records.append(Record(name, DT, signals, {}, role=role))
    return tuple(records)


def followed(record: Record, bandwidth: float) -> Record:
    return Observer(("x",), bandwidth).following([record])[0]


def outputs(
    record: Record, values: dict[str, float], start: list[float], effects: tuple[str, ...] = ()
) -> np.ndarray:
    structure = structure_of_fit(compose(AXIS, map(effect_named, effects)), [record])
    p = parameter_vector(structure, record_values(structure, values, record))
    held = record_input(structure, record)
    return simulate_outputs(structure, held, p, np.array(start), record.n_samples, 1e-9)[:, 0]


@pytest.mark.parametrize("mass", [0.02, 2.0, 200.0])
def test_an_error_dies_away_as_declared_whatever_the_mass(mass: float) -> None:
    """``e'' + sqrt(2) w e' + w^2 e = 0`` from ``e = 0.01``, the mass at rest without force or damping."""
    bandwidth, values = 10.0, {**VALUES, "m": mass, "d": 0.0}
    resting = Record("rest", DT, {"u": np.zeros(T.size), "x": np.full(T.size, 0.3)}, {})
    shown = outputs(followed(resting, bandwidth), values, [0.31, 0.0])
    pole = bandwidth / np.sqrt(2.0)
    expected = 0.01 * np.exp(-pole * T) * (np.cos(pole * T) + np.sin(pole * T))
    np.testing.assert_allclose(shown - 0.3, expected, atol=1e-8)


@pytest.mark.parametrize(
    ("effect", "own"),
    [("sensor_delay", {"T_s": 0.004}), ("iwan_hysteresis", None), ("coulomb_friction", {"T_c": FRICTION})],
)
def test_a_true_model_is_not_moved(effect: str, own: dict[str, float] | None) -> None:
    """What it would show by itself it shows as an observer of its own readings too."""
    structure = compose(AXIS, [effect_named(effect)])
    if own is None:
        scales = {"x": 0.1, "force": 2.0, "time": 0.1}
        own = {
            p.name: (p.starts[0] if p.starts else 1.0) * scales.get(p.dimension, 1.0)
            for p in structure.parameters[6:]
        }
    values = {**VALUES, **own}
    u = 4.0 * np.sin(4.0 * T) * np.minimum(T, 1.0)
    start = [0.0] * len(structure.states)
    free = simulate(structure, values, Record("r", DT, {"u": u}, {}), np.array(start), 1e-9)["x"]
    record = followed(Record("r", DT, {"u": u, "x": free}, {}), 30.0)
    shown = outputs(record, values, start, (effect,))
    assert np.max(np.abs(shown - free)) < 2e-4 * np.ptp(free)


def test_a_record_without_the_sensor_runs_freely() -> None:
    (record,) = Observer(("x",), 30.0).following([Record("r", DT, {"u": np.ones(T.size)}, {})])
    structure = structure_of_fit(
        compose(AXIS), [followed(replace(record, signals={"u": record["u"], "x": record["u"]}), 30.0)]
    )
    p = parameter_vector(structure, record_values(structure, VALUES, record))
    shown = simulate_outputs(
        structure, record_input(structure, record), p, np.zeros(2), record.n_samples, 1e-9
    )[:, 0]
    free = simulate(compose(AXIS), VALUES, record, np.zeros(2), 1e-9)["x"]
    np.testing.assert_allclose(shown, free, atol=1e-9)


def test_an_observer_is_no_part_of_a_result() -> None:
    records = [followed(record, 30.0) for record in stage({})]
    structure = compose(AXIS)
    scales = characteristic_scales(AXIS, records, VALUES)
    fit = GreyBoxFit(structure, records, scales, {"x": NOISE}).fit({**VALUES, "m": 1.0}, ["m", "d"])
    assert fit.structure is structure
    assert set(fit.values) == set(structure.names)
    assert fit.initial_states[0].size == len(structure.states)
    assert fit.values["m"] == pytest.approx(2.0, rel=1e-3)
    assert fit.weighted_rms == pytest.approx(1.0, abs=0.05)


def test_only_a_rig_that_drifts_is_followed_and_by_sensors_of_its_motion() -> None:
    records = stage({})
    assert followed_sensors(AXIS, records) == ("x",)
    assert followed_sensors(ELEMENT, [Record("r", DT, {"x": T, "force": T}, {})]) == ()
    sprung = Campaign("s", AXIS, {"gain": 1.0}, {"k": 50.0}, records)
    assert structures_to_fit(sprung, [compose(AXIS)]) == [compose(AXIS)]
    campaign = Campaign("s", AXIS, {"gain": 1.0}, {"k": 0.0}, records)
    (structure,) = structures_to_fit(campaign, [compose(AXIS)])
    assert structure.observed == ("x",)


@pytest.mark.slow
@pytest.mark.parametrize("disturbance", [0.05, 0.3])
def test_friction_of_a_disturbed_stage_is_named_with_its_numbers(disturbance: float) -> None:
    """In free runs or long windows the drift that the disturbance makes hides the friction (97 and 15 % of the gap closed)."""
    names = ("coulomb_friction", "quadratic_damping", "flexible_mode", "input_dead_zone", "backlash")
    effects = [effect for effect in CATALOGUE if effect.name in names]
    campaign = Campaign(
        "s", AXIS, {"gain": 1.0}, {"k": 0.0}, stage({"coulomb_friction": {"T_c": FRICTION}}, disturbance)
    )
    found = diagnose(campaign, effects)
    assert (found.verdict, found.effects) == ("effect", ("coulomb_friction",))
    numbers = found.candidates[0].parameters
    assert numbers["T_c"].value == pytest.approx(FRICTION, rel=0.15)
    assert numbers["m"].value == pytest.approx(2.0, rel=0.03)
    assert 1.0 - (1.0 - found.gap["x"].closed) ** 2 > 0.7


@pytest.mark.slow
def test_a_spring_that_nobody_left_out_and_that_is_not_there_is_found_to_be_none() -> None:
    names = ("coulomb_friction", "bouc_wen_hysteresis", "quadratic_damping")
    effects = [effect for effect in CATALOGUE if effect.name in names]
    campaign = Campaign("s", AXIS, {"gain": 1.0}, {}, stage({"coulomb_friction": {"T_c": FRICTION}}, 0.3))
    found = diagnose(campaign, effects)
    assert found.bandwidth is not None
    assert (found.verdict, found.effects) == ("effect", ("coulomb_friction",))
    stiffness = found.candidates[0].parameters["k"]
    assert abs(stiffness.value) < 3.0 * stiffness.std < 2.0


CYLINDER = """
name = "cylinder"
summary = "A valve feeds a cylinder that moves a mass."
[inputs.u]
unit = "V"
[parameters.c]
unit = "Pa/m"
lower = 0.0
[parameters.k_v]
unit = "Pa/(s V)"
lower = 0.0
[parameters.leak]
unit = "1/s"
lower = 0.0
[parameters.m]
unit = "kg"
lower = 0.0
[parameters.d]
unit = "N s/m"
lower = 0.0
[constants.area]
unit = "m^2"
default = 1e-3
[coordinates.x]
unit = "m"
[energy]
kinetic = "m*d(x)^2/2"
[states.p]
rate = "k_v*valve - c*d(x) - leak*p"
unit = "Pa"
[joints.piston]
motion = "x"
damping = "d"
[drives.valve]
signal = "u"
force = "area*p"
along = "x"
[sensors.pressure]
reads = "p"
unit = "Pa"
[sensors.position]
reads = "x"
unit = "m"
"""


@pytest.mark.slow
def test_noise_that_is_followed_shows_in_a_pressure_and_counts_as_its_floor(tmp_path: Path) -> None:
    """A cylinder hands the noise of its position on to its pressure; a true model cannot leave less."""
    (tmp_path / "cylinder.toml").write_text(CYLINDER)
    rig = read_rig_file(tmp_path / "cylinder.toml")
    truth = {"area": 1e-3, "c": 6e8, "k_v": 4e7, "leak": 3.0, "m": 60.0, "d": 900.0, "T_c": 150.0}
    noise = {"pressure": 300.0, "position": 1e-5}
    structure = compose(rig, [placed(effect_named("coulomb_friction"), "piston")])
    rng, records = np.random.default_rng(4), []
    for amplitude, role in ((1.0, "estimation"), (2.0, "estimation"), (1.5, "validation")):
        u = amplitude * np.sin(2.0 * np.pi * (0.3 * T + 0.12 * T**2))
        run = simulate(structure, truth, Record(f"at_{amplitude:g}", DT, {"u": u}, {}, role=role))
        shown = {name: run[name] + rng.normal(scale=std, size=T.size) for name, std in noise.items()}
        records.append(run.with_signals(**shown))
    given = {name: value for name, value in truth.items() if name not in ("area", "T_c")}
    campaign = Campaign("cylinder", rig, {"area": 1e-3}, given, tuple(records))
    windowing, amplified = windowing_of(campaign, noise, 1, start_values_of(campaign))
    left = {}
    for bandwidth in (100.0, windowing.bandwidth):
        (record,) = Observer(("position",), bandwidth).following(records[1:2])
        following = structure_of_fit(structure, [record])
        p = parameter_vector(following, record_values(following, truth, record))
        out = simulate_outputs(following, record_input(following, record), p, np.zeros(3), T.size, 1e-8)
        left[bandwidth] = float(np.std(record["pressure"] - out[:, 0])) / noise["pressure"]
    assert left[100.0] > 2.0
    assert left[windowing.bandwidth] == pytest.approx(amplified["pressure"], rel=0.1)

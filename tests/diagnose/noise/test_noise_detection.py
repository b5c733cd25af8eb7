"""The noise floor comes from the records: what is known to be noise is found, what moves is not taken for it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rigsight.diagnose.noise.detection import NoiseFloor, noise_floors
from rigsight.excitation import linear_sweep
from rigsight.records import Record
from rigsight.rigs import AXIS, RIGS, RUNNING_GEAR
from rigsight.simulate import compose, simulate

DT = 5e-3
STAGE = {"gain": 1.0, "m": 2.0, "d": 5.0, "k": 800.0, "x_off": 1e-4, "force_off": 0.0}
SIGMA = 1e-5


def driven(u: NDArray[np.float64], force: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
    """Noise-free displacement of the axis under input and disturbance."""
    total = u if force is None else u + force
    record = Record(name="r", dt=DT, signals={"u": total}, units={})
    return np.asarray(simulate(compose(AXIS), STAGE, record)["x"])


def axis_record(u: NDArray[np.float64], x: NDArray[np.float64]) -> Record:
    return Record(name="r", dt=DT, signals={"u": u, "x": x}, units={})


def floor_of(*records: Record) -> NoiseFloor:
    (floor,) = noise_floors(AXIS, records)
    return floor


def multisine(n: int, rng: np.random.Generator) -> NDArray[np.float64]:
    phase = rng.uniform(0.0, 2.0 * np.pi, 40)
    t = np.arange(n) / n
    return np.sum([np.cos(2.0 * np.pi * (i + 1) * t + p) for i, p in enumerate(phase)], axis=0)


def test_repeated_periods() -> None:
    rng = np.random.default_rng(1)
    u = np.tile(multisine(1000, rng), 5)
    x = driven(u) + SIGMA * rng.standard_normal(u.size)
    floor = floor_of(axis_record(u, x))
    assert "repeated" in floor.method
    # Four settled periods leave three degrees of freedom at each of 1000 samples.
    assert floor.std == pytest.approx(SIGMA, rel=3.0 / np.sqrt(2.0 * 3000))


def test_where_a_free_mass_has_drifted_to_is_not_noise() -> None:
    rng = np.random.default_rng(7)
    u = np.tile(multisine(1000, rng), 6)
    free = compose(AXIS)
    run = Record(name="r", dt=DT, signals={"u": u + 0.05}, units={})
    x = simulate(free, {**STAGE, "k": 0.0}, run)["x"] + SIGMA * rng.standard_normal(u.size)
    assert np.ptp(x[::1000]) > 1000.0 * SIGMA
    (floor,) = noise_floors(AXIS, [axis_record(u, x)], drifts=True)
    assert "repeated" in floor.method
    assert floor.std == pytest.approx(SIGMA, rel=0.1)


def test_repeated_records() -> None:
    rng = np.random.default_rng(2)
    u = linear_sweep(DT * np.arange(1500), 4.0, 3.0, 50.0)
    records = [axis_record(u, driven(u) + SIGMA * rng.standard_normal(u.size)) for _ in range(3)]
    floor = floor_of(*records)
    assert "repeated" in floor.method
    # Three records leave two degrees of freedom at each of the 750 samples of their second half.
    assert floor.std == pytest.approx(SIGMA, rel=3.0 / np.sqrt(2.0 * 1500))


def test_repeated_records_that_start_in_different_motion() -> None:
    """The free motion dies within three seconds; it is no scatter of the sensor."""
    rng = np.random.default_rng(10)
    u = linear_sweep(DT * np.arange(4000), 4.0, 3.0, 50.0)
    bare = Record(name="r", dt=DT, signals={"u": u}, units={})
    records = []
    for state in ([0.0, 0.0], [5e-3, 0.1]):
        x = simulate(compose(AXIS), STAGE, bare, np.array(state))["x"]
        records.append(axis_record(u, x + SIGMA * rng.standard_normal(u.size)))
    floor = floor_of(*records)
    assert "repeated" in floor.method
    assert floor.std == pytest.approx(SIGMA, rel=3.0 / np.sqrt(2.0 * 2000))


@pytest.mark.parametrize("change", [{"constants": {"payload": 2.0}}, {"dt": 0.5 * DT}])
def test_the_same_input_to_another_rig_is_no_repeat(change: dict[str, Any]) -> None:
    """Another payload, or the same samples played twice as fast."""
    rng = np.random.default_rng(11)
    u = linear_sweep(DT * np.arange(1500), 4.0, 3.0, 50.0)
    one, other = (axis_record(u, a * driven(u) + SIGMA * rng.standard_normal(u.size)) for a in (1.0, 1.2))
    assert "repeated" in floor_of(one, other).method
    assert "repeated" not in floor_of(one, replace(other, **change)).method


def test_repeated_records_of_a_rig_with_two_inputs() -> None:
    rng = np.random.default_rng(12)
    chirp = linear_sweep(DT * np.arange(1500), 4.0, 3.0, 50.0)
    rig = next(rig for rig in RIGS.values() if len(rig.inputs) == 2)
    response = rng.standard_normal(chirp.size)
    records = [
        Record(
            name=f"r{i}",
            dt=DT,
            signals={source.name: chirp for source in rig.inputs}
            | {sensor.name: response + SIGMA * rng.standard_normal(chirp.size) for sensor in rig.outputs},
            units={},
        )
        for i in range(2)
    ]
    for floor in noise_floors(rig, records):
        assert "repeated" in floor.method
        assert floor.std == pytest.approx(SIGMA, rel=3.0 / np.sqrt(2.0 * 750))


def test_two_repeats_are_one_difference() -> None:
    """Their deviations from the mean are equal and opposite; 95 % of the intervals contain the truth."""
    rng = np.random.default_rng(13)
    u = linear_sweep(DT * np.arange(2000), 4.0, 3.0, 50.0)
    contained = []
    for _ in range(200):
        floor = floor_of(*(axis_record(u, SIGMA * rng.standard_normal(u.size)) for _ in range(2)))
        contained.append(floor.interval[0] <= SIGMA <= floor.interval[1])
    assert 0.88 <= np.mean(contained) <= 0.99


def test_repetitions_see_the_disturbance_too() -> None:
    rng = np.random.default_rng(3)
    u = np.tile(multisine(1000, rng), 9)
    disturbance = 0.2 * rng.standard_normal(u.size)
    shaken = driven(np.zeros(u.size), disturbance)[1000:]
    floor = floor_of(axis_record(u, driven(u, disturbance) + SIGMA * rng.standard_normal(u.size)))
    # The axis rings for m/d = 0.4 s, so 40 s hold about 100 independent stretches.
    assert np.std(shaken) > 5.0 * SIGMA
    assert floor.std == pytest.approx(np.hypot(np.std(shaken), SIGMA), rel=0.2)


def test_quiet_stretch_before_a_sweep() -> None:
    rng = np.random.default_rng(4)
    u = np.concatenate([np.zeros(800), linear_sweep(DT * np.arange(1500), 4.0, 3.0, 50.0)])
    floor = floor_of(axis_record(u, driven(u) + SIGMA * rng.standard_normal(u.size)))
    assert "rests" in floor.method
    assert floor.std == pytest.approx(SIGMA, rel=4.0 / np.sqrt(2.0 * 800))


@pytest.mark.parametrize("level", [0.0, 2.5], ids=["at zero", "at a constant command"])
@pytest.mark.parametrize("backwards", [False, True], ids=["first", "last"])
def test_a_rest_from_which_an_input_moves_off_gently(level: float, backwards: bool) -> None:
    """The steps of a slow start are as small as those of a rest: the rest counts, the motion does not."""
    rng = np.random.default_rng(9)
    t = DT * np.arange(2000)
    slow = 4.0 * np.sin(0.02 * t**3) * np.minimum(t / 2.0, 1.0)
    u = level + np.concatenate([np.zeros(800), slow if not backwards else slow[::-1]])
    u = u[::-1] if backwards else u
    floor = floor_of(axis_record(u, driven(u) + SIGMA * rng.standard_normal(u.size)))
    assert "rests" in floor.method
    assert floor.std == pytest.approx(SIGMA, rel=4.0 / np.sqrt(2.0 * 400))


def test_quiet_stretches_see_the_disturbance_that_passes_the_rig() -> None:
    rng = np.random.default_rng(5)
    u = np.concatenate([np.zeros(4000), linear_sweep(DT * np.arange(1500), 4.0, 3.0, 50.0)])
    disturbance = 0.2 * rng.standard_normal(u.size)
    shaken = driven(np.zeros(u.size), disturbance)
    floor = floor_of(axis_record(u, driven(u, disturbance) + SIGMA * rng.standard_normal(u.size)))
    assert "rests" in floor.method
    # 20 s of ringing with 0.4 s memory: some fifty independent values, 10 % each way.
    assert floor.std == pytest.approx(np.hypot(np.std(shaken[400:]), SIGMA), rel=0.3)
    assert floor.std > 5.0 * SIGMA


def test_top_of_the_spectrum_is_the_white_noise_of_the_sensor() -> None:
    rng = np.random.default_rng(6)
    u = linear_sweep(DT * np.arange(4000), 4.0, 3.0, 50.0)
    floor = floor_of(axis_record(u, driven(u) + SIGMA * rng.standard_normal(u.size)))
    assert "top of the spectrum" in floor.method
    # Median of 300 exponentially distributed powers: sigma of the median is 1/ (ln 2 sqrt(300)), halved for the root;
    # the window makes neighbors depend on each other, which doubles it at most.
    assert floor.std == pytest.approx(SIGMA, rel=3.0 * 2.0 * 0.5 / (np.log(2.0) * np.sqrt(300.0)))


@pytest.mark.parametrize("damping_ratio", [0.002, 0.01, 0.03])
def test_the_decay_after_a_pulse_is_not_noise(damping_ratio: float) -> None:
    """The input rests for three seconds while the axis still rings, up to thousands of times the noise."""
    rng = np.random.default_rng(7)
    u = np.concatenate([linear_sweep(DT * np.arange(1500), 4.0, 3.0, 20.0), np.zeros(600)])
    values = {**STAGE, "d": 2.0 * damping_ratio * np.sqrt(STAGE["k"] * STAGE["m"])}
    ringing = simulate(compose(AXIS), values, Record(name="r", dt=DT, signals={"u": u}, units={}))["x"]
    assert np.std(ringing[-300:]) > 3.0 * SIGMA
    floor = floor_of(axis_record(u, ringing + SIGMA * rng.standard_normal(u.size)))
    assert floor.std == pytest.approx(SIGMA, rel=0.3)


def test_a_decay_of_few_samples_per_period_is_not_noise() -> None:
    """Its differences from sample to sample are as large as those of noise."""
    rng = np.random.default_rng(7)
    omega = float(np.sqrt(STAGE["k"] / STAGE["m"]))
    dt = 2.0 * np.pi / omega / 8.0
    u = np.concatenate([linear_sweep(dt * np.arange(600), 4.0, 0.3 * omega, 1.5 * omega), np.zeros(240)])
    values = {**STAGE, "d": 0.02 * STAGE["m"] * omega}
    ringing = simulate(compose(AXIS), values, Record(name="r", dt=dt, signals={"u": u}, units={}))["x"]
    assert np.std(ringing[-120:]) > 3.0 * SIGMA
    measured = ringing + SIGMA * rng.standard_normal(u.size)
    floor = floor_of(Record(name="r", dt=dt, signals={"u": u, "x": measured}, units={}))
    assert floor.std < 2.0 * SIGMA


def test_a_drift_is_not_noise() -> None:
    rng = np.random.default_rng(8)
    u = np.concatenate([np.zeros(800), linear_sweep(DT * np.arange(1500), 4.0, 3.0, 50.0)])
    creeping = 100.0 * SIGMA * np.linspace(-1.0, 1.0, u.size)
    floor = floor_of(axis_record(u, driven(u) + creeping + SIGMA * rng.standard_normal(u.size)))
    assert floor.std == pytest.approx(SIGMA, rel=0.3)


@pytest.mark.parametrize("kind", ["quiet", "repeated", "spectrum"])
def test_noise_free_records_have_a_positive_floor(kind: str) -> None:
    sweep = linear_sweep(DT * np.arange(1500), 4.0, 3.0, 50.0)
    u = {
        "quiet": np.concatenate([np.zeros(800), sweep]),
        "repeated": np.tile(sweep, 3),
        "spectrum": sweep,
    }[kind]
    x = driven(u)
    floor = floor_of(axis_record(u, x))
    assert 0.0 < floor.std < 1e-3 * np.std(x)


def test_a_still_output_has_a_floor_that_can_divide() -> None:
    """An output that never moves and has no noise: residuals are still divided by the floor."""
    u = linear_sweep(DT * np.arange(1500), 4.0, 3.0, 50.0)
    assert floor_of(axis_record(u, np.full(u.size, 0.1))).std > 0.0


def test_each_output_has_its_own_floor_and_one_never_measured_has_none() -> None:
    rng = np.random.default_rng(9)
    u = np.concatenate([np.zeros(800), linear_sweep(DT * np.arange(1500), 1.0, 3.0, 30.0)])
    values = {
        "v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27,
        "J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "psi_off": 1e-3, "l_0": 0.25, "c_y": 0.98, "y_off": -5e-4,
    }  # fmt: skip
    clean = simulate(compose(RUNNING_GEAR), values, Record(name="r", dt=DT, signals={"u": u}, units={}))
    noisy = clean.with_signals(
        psi=clean["psi"] + SIGMA * rng.standard_normal(u.size),
        y=clean["y"] + 5.0 * SIGMA * rng.standard_normal(u.size),
    )
    psi, y = noise_floors(RUNNING_GEAR, [noisy])
    assert (psi.output, psi.unit, y.output, y.unit) == ("psi", "rad", "y", "m")
    assert psi.std == pytest.approx(SIGMA, rel=0.1)
    assert y.std == pytest.approx(5.0 * SIGMA, rel=0.1)
    yaw = Record(name="yaw", dt=DT, signals={n: noisy[n] for n in ("u", "psi")}, units={})
    (only,) = noise_floors(RUNNING_GEAR, [yaw])
    assert only.output == "psi"


@pytest.mark.parametrize("share", [5e-4, 2e-3, 5e-3])
def test_repeats_are_found_where_the_input_is_measured_with_noise(share: float) -> None:
    rng = np.random.default_rng(3)
    true = np.tile(multisine(1000, rng), 4)
    u = true + share * np.std(true) * rng.standard_normal(true.size)
    floor = floor_of(axis_record(u, driven(true) + SIGMA * rng.standard_normal(u.size)))
    assert "repeated" in floor.method
    assert floor.std == pytest.approx(SIGMA, rel=0.1)


def test_inputs_of_a_slightly_other_amplitude_are_no_repeats() -> None:
    rng = np.random.default_rng(4)
    u = multisine(2000, rng)
    records = [axis_record(a * u, driven(a * u) + SIGMA * rng.standard_normal(u.size)) for a in (1.0, 1.006)]
    assert "repeated" not in floor_of(*records).method


def test_rest_is_found_where_the_input_is_measured_with_noise() -> None:
    rng = np.random.default_rng(5)
    true = np.concatenate([np.zeros(400), linear_sweep(DT * np.arange(2000), 3.0, 3.0, 50.0)])
    u = true + 2e-3 * rng.standard_normal(true.size)
    floor = floor_of(axis_record(u, driven(true) + SIGMA * rng.standard_normal(u.size)))
    assert "rests" in floor.method
    assert floor.std == pytest.approx(SIGMA, rel=0.2)


def test_a_floor_from_rest_has_an_interval_that_holds_the_truth() -> None:
    rng = np.random.default_rng(6)
    u = np.concatenate([np.zeros(600), linear_sweep(DT * np.arange(2000), 3.0, 3.0, 50.0)])
    low, high = floor_of(axis_record(u, driven(u) + SIGMA * rng.standard_normal(u.size))).interval
    assert 0.7 * SIGMA < low < SIGMA < high < 1.3 * SIGMA


def test_a_filtered_output_counts_no_more_than_the_others() -> None:
    """Only the top of the spectrum is seen, and a filter has taken the noise of one output away there."""
    t, rng = DT * np.arange(4000), np.random.default_rng(5)
    signals = {
        "tau_m": np.sin(2.0 * np.pi * (0.2 + 0.1 * t) * t),
        "phi_m": np.sin(2.0 * np.pi * 0.5 * t) + 1e-4 * rng.standard_normal(t.size),
        "phi_l": 0.1 * np.sin(2.0 * np.pi * 0.5 * t + 0.2),
    }
    rig = RIGS["drive_train"]
    names = dict(zip(signals, [s.name for s in (*rig.inputs, *rig.outputs)], strict=True))
    record = Record("r", DT, {names[name]: signal for name, signal in signals.items()}, {})
    motor, load = noise_floors(rig, [record])
    assert motor.lower_bound
    assert load.lower_bound
    assert load.std == pytest.approx(0.1 * motor.std, rel=0.01)
    assert load.interval == (load.std, np.inf)


def test_of_a_lower_bound_nobody_knows_the_upper_limit() -> None:
    rng = np.random.default_rng(6)
    u = multisine(4000, rng)
    floor = floor_of(axis_record(u, driven(u) + SIGMA * rng.standard_normal(u.size)))
    assert floor.lower_bound
    assert floor.interval == (floor.std, np.inf)


def test_what_swings_by_itself_is_no_noise() -> None:
    """Two modes that beat: no few exponentials follow a chaotic swing either, and nothing drives it."""
    rng = np.random.default_rng(8)
    t = DT * np.arange(3000)
    x = np.sin(7.0 * t + 2.0 * np.sin(3.1 * t) + np.cumsum(0.05 * rng.standard_normal(t.size)))
    floor = floor_of(axis_record(np.zeros(t.size), x + SIGMA * rng.standard_normal(t.size)))
    assert floor.std < 0.1
    assert floor.lower_bound

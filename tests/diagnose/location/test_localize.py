"""Where the gap lies: shares add up, the lacking force is the one that was hidden, the path names the right leg."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence

import numpy as np
import pytest
import scipy.signal

from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.location.gap_parts import Localization
from rigsight.diagnose.location.localize import localize
from rigsight.diagnose.location.trace import STAGES, Trace
from rigsight.diagnose.noise.detection import NoiseFloor
from rigsight.diagnose.search.single_effects import reidentify
from rigsight.effects import effect_named
from rigsight.excitation import linear_sweep
from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.json_data import json_data
from rigsight.metrics import nrmse
from rigsight.records import Record
from rigsight.rigs import AXIS, ELEMENT, RUNNING_GEAR, Rig
from rigsight.simulate import compose, simulate

DT = 5e-3
T = DT * np.arange(1500)
NOISE = 2e-5
STAGE = {"gain": 1.0, "m": 2.0, "d": 5.0, "k": 800.0, "x_off": 0.0, "force_off": 0.0}
GEAR = {
    "v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27,
    "J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "psi_off": 0.0, "l_0": 0.25, "c_y": 0.98, "y_off": 0.0,
}  # fmt: skip
RUNS = ((4.0, "estimation"), (2.0, "validation"), (3.0, "validation"))


def measured(
    rig: Rig, effects: Sequence[str], values: Mapping[str, float], top: float = 50.0
) -> tuple[Record, ...]:
    """Sweeps at three amplitudes of a rig with hidden effects."""
    structure = compose(rig, [effect_named(name) for name in effects])
    records = []
    for i, (amplitude, role) in enumerate(RUNS):
        rng = np.random.default_rng(i)
        source = {rig.inputs[0].name: linear_sweep(T, amplitude, 3.0, top)}
        bare = Record(name=f"run {i}", dt=DT, signals=source, units={}, role=role, amplitude=amplitude)  # type: ignore[arg-type]
        clean = simulate(structure, values, bare)
        noisy = {s.name: clean[s.name] + NOISE * rng.standard_normal(T.size) for s in rig.outputs}
        records.append(clean.with_signals(**noisy))
    return tuple(records)


def workbench(rig: Rig, records: Sequence[Record], values: Mapping[str, float]) -> FitContext:
    fitted = tuple(r for r in records if r.role == "estimation")
    return FitContext(
        rig=rig,
        estimation=fitted,
        scoring=tuple(r for r in records if r.role == "validation"),
        look=fitted,
        scales=characteristic_scales(rig, fitted, values),
        noise={signal.name: NOISE for signal in rig.outputs},
        held=frozenset(),
    )


def as_given(context: FitContext, values: Mapping[str, float]) -> FittedModel:
    """The simulation with these very numbers; only initial states are estimated."""
    fit = GreyBoxFit(context.composed(), context.estimation, context.scales, context.noise).fit(values, [])
    return context.score((), fit)


def traces(context: FitContext, *stages: FittedModel) -> tuple[Trace, ...]:
    names = [signal.name for signal in context.rig.outputs]
    found = []
    for i, record in enumerate(context.scoring):
        outputs = {n: record[n] for n in names}
        simulated = [
            {n: record[n] - model.residuals[i][:, j] for j, n in enumerate(names)} for model in stages
        ]
        source = context.rig.inputs[0].name
        found.append(
            Trace(
                record.name,
                record.role,
                "sweep",
                record.amplitude,
                record.t,
                {source: record[source]},
                outputs,
                *simulated,
            )
        )
    return tuple(found)


def localized(
    context: FitContext, before: FittedModel, reidentified: FittedModel, after: FittedModel
) -> tuple[Localization, tuple[Trace, ...]]:
    shown = traces(context, before, reidentified, after)
    where = localize(context, shown, "validation", before, reidentified, after, np.random.default_rng(0))
    return where, shown


@pytest.fixture(scope="module")
def friction() -> tuple[Localization, tuple[Trace, ...]]:
    """Coulomb friction of 0.5 N hidden from a stage that is otherwise simulated with its true numbers."""
    records = measured(AXIS, ["coulomb_friction"], {**STAGE, "T_c": 0.5})
    context = workbench(AXIS, records, STAGE)
    given = as_given(context, {**STAGE, "d": 8.0})
    true = as_given(context, STAGE)
    return localized(context, given, true, true)


def test_shares_of_a_split_add_up_to_the_gap(friction: tuple[Localization, tuple[Trace, ...]]) -> None:
    where, shown = friction
    for stage in STAGES:
        together = np.concatenate([t.residual(stage, "x") for t in shown])
        gap = nrmse(together, np.concatenate([t.measured["x"] for t in shown]))
        bands = sum(getattr(part, stage) ** 2 for part in where.by_band)
        assert np.sqrt(bands) == pytest.approx(gap, rel=1e-6)
        samples = sum(part.n_samples for part in where.by_state)
        states = sum(part.n_samples * getattr(part, stage) ** 2 for part in where.by_state) / samples
        assert np.sqrt(states) == pytest.approx(gap, rel=1e-6)
    for parts in (where.by_record, where.by_amplitude, where.by_band, where.by_time):
        assert sum(part.share for part in parts) == pytest.approx(1.0)
        noise = sum(part.noise_share for part in parts)
        assert noise == pytest.approx(
            (where.by_path[0].noise_floor / where.by_path[0].reidentified) ** 2, rel=0.02
        )


def test_a_record_is_split_off_relative_to_its_own_motion(
    friction: tuple[Localization, tuple[Trace, ...]],
) -> None:
    where, shown = friction
    for part, trace in zip(where.by_record, shown, strict=True):
        assert part.reidentified == pytest.approx(
            nrmse(trace.residual("reidentified", "x"), trace.measured["x"])
        )
        low, high = part.interval["reidentified"]
        assert low < part.reidentified < high


def test_friction_weighs_more_at_a_small_amplitude(friction: tuple[Localization, tuple[Trace, ...]]) -> None:
    small, large = friction[0].by_amplitude
    assert (small.amplitude, large.amplitude) == (2.0, 3.0)
    assert small.reidentified > 1.2 * large.reidentified


def test_the_force_that_is_lacking_is_the_hidden_friction(
    friction: tuple[Localization, tuple[Trace, ...]],
) -> None:
    """Away from the reversals, where the filter smears the jump, it is -T_c sign(v)."""
    cells = friction[0].by_state
    size = max(part.v_high for part in cells)
    fast = [part for part in cells if min(abs(part.v_low), abs(part.v_high)) > 0.3 * size]
    weights = [part.n_samples for part in fast]
    along = [-part.force_mean * np.sign(part.v_low + part.v_high) for part in fast]
    assert np.average(along, weights=weights) == pytest.approx(0.5, rel=0.1)
    assert all(part.force_noise < 0.2 for part in cells)
    assert cells[0].units["force_mean"] == "N"


def test_it_is_plain_json(friction: tuple[Localization, tuple[Trace, ...]]) -> None:
    written = json.loads(json.dumps(json_data(friction[0].to_json()), allow_nan=False))
    for name in (
        "gap_by_record",
        "gap_by_band",
        "gap_by_amplitude",
        "gap_by_state",
        "gap_by_time",
        "gap_by_path",
    ):
        for part in written[name]:
            assert {"output", "before", "reidentified", "after", "noise_floor", "units"} <= set(part), name


def test_a_gap_at_the_floor_lacks_no_force() -> None:
    records = measured(AXIS, [], STAGE)
    context = workbench(AXIS, records, STAGE)
    true = as_given(context, STAGE)
    where, _ = localized(context, true, true, true)
    assert all(np.isnan(part.force_mean) for part in where.by_state)
    assert where.by_path[0].noise_share == pytest.approx(1.0, abs=0.1)


def test_the_force_of_a_bench_is_its_residual() -> None:
    values = {"k": 100.0, "d": 2.0, "force_off": 0.0}
    records = measured(ELEMENT, ["coulomb_friction"], {**values, "T_c": 0.5})
    context = workbench(ELEMENT, records, values)
    true = as_given(context, values)
    where, shown = localized(context, true, true, true)
    samples = sum(part.n_samples for part in where.by_state)
    squares = sum(part.n_samples * part.force_rms**2 for part in where.by_state) / samples
    residual = np.concatenate([trace.residual("reidentified", "force") for trace in shown])
    assert np.sqrt(squares) == pytest.approx(np.sqrt(np.mean(residual**2)), rel=1e-6)


@pytest.mark.parametrize(
    ("effect", "values", "said"),
    [
        ("input_delay", {"T_d": 0.02}, "before psi is measured"),
        ("sensor_delay", {"T_s": 0.02}, "if psi is assumed to be measured 20 ms later than y"),
    ],
)
def test_the_path_tells_a_late_input_from_a_late_sensor(
    effect: str, values: dict[str, float], said: str
) -> None:
    """Both delay u -> psi alike; only the leg from the measured psi to y knows which of them it is."""
    context = workbench(RUNNING_GEAR, measured(RUNNING_GEAR, [effect], {**GEAR, **values}, 30.0), GEAR)
    reidentified = reidentify(context, GEAR)
    where, _ = localized(context, as_given(context, GEAR), reidentified, reidentified)
    motion, lateral = where.by_path
    assert said in where.sentence
    assert motion.reidentified > 5.0 * motion.noise_floor
    if effect == "sensor_delay":
        assert lateral.shift == pytest.approx(0.02, abs=max(1e-4, 5.0 * lateral.shift_std))
        assert lateral.shifted < 1.1 * lateral.noise_floor < 0.5 * lateral.before
    else:
        assert lateral.reidentified < 1.1 * lateral.noise_floor


def test_the_path_tells_a_gap_of_the_lateral_part_from_a_late_sensor() -> None:
    records = measured(RUNNING_GEAR, ["creep_saturation"], {**GEAR, "s": 0.03}, 30.0)
    context = workbench(RUNNING_GEAR, records, GEAR)
    reidentified = reidentify(context, GEAR)
    where, _ = localized(context, as_given(context, GEAR), reidentified, reidentified)
    motion, lateral = where.by_path
    assert motion.reidentified < 1.1 * motion.noise_floor
    assert lateral.reidentified > 2.0 * lateral.noise_floor
    assert "The lateral part or a sensor has a gap of its own" in where.sentence


def test_a_clean_path_says_so() -> None:
    context = workbench(RUNNING_GEAR, measured(RUNNING_GEAR, [], GEAR, 30.0), GEAR)
    true = as_given(context, GEAR)
    where, _ = localized(context, true, true, true)
    assert "No section of the signal path has a noticeable gap" in where.sentence


def test_the_floor_of_a_band_follows_the_noise_where_it_was_seen_alone() -> None:
    """Noise below 6 rad/s only: the bands there carry the floor, those above nothing; white noise spreads over all."""
    records = measured(AXIS, ["coulomb_friction"], {**STAGE, "T_c": 0.5})
    context = workbench(AXIS, records, STAGE)
    true = as_given(context, STAGE)
    shown = traces(context, true, true, true)
    rng = np.random.default_rng(0)
    slow = scipy.signal.sosfiltfilt(
        scipy.signal.butter(4, 6.0 * DT / np.pi, output="sos"), rng.standard_normal(4000)
    )
    seen = NoiseFloor("x", "m", NOISE, "stretches in which the input rests", stretches=((slow, DT),))

    def localized_with(*floors: NoiseFloor) -> Localization:
        return localize(
            context, shown, "validation", true, true, true, np.random.default_rng(0), floors=floors
        )

    colored, white = localized_with(seen), localized_with()
    assert (colored.noise_shape, white.noise_shape) == ({"x": "measured"}, {"x": "white"})
    for where in (colored, white):
        total = sum(part.noise_floor**2 for part in where.by_band)
        assert total == pytest.approx(where.by_record[0].noise_floor ** 2, rel=0.5)
    fast = [part.noise_floor for part in colored.by_band if part.omega_low > 12.0]
    assert max(fast) < 0.05 * max(part.noise_floor for part in colored.by_band)
    spread = [part.noise_floor for part in white.by_band if part.omega_low > 12.0]
    assert max(spread) == max(part.noise_floor for part in white.by_band)

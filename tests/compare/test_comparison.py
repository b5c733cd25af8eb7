"""Models on records: the truth leaves the noise floor, a wrong one more, a diverging one is told and the others go on."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from rigsight.compare import (
    Column,
    Comparison,
    Competitor,
    Floor,
    RecordComparison,
    Score,
    Yardstick,
    compare_on_record,
)
from rigsight.compare.comparison import best
from rigsight.effects import effect_named
from rigsight.excitation import log_sweep, step
from rigsight.records import Kind, Record
from rigsight.rigs import AXIS, ELEMENT
from rigsight.simulate import compose, simulate
from rigsight.simulate.model import Model

STRUCTURE = compose(AXIS, [effect_named("cubic_stiffness")])
TRUTH = {"gain": 1.0, "m": 2.0, "d": 5.0, "k": 800.0, "x_off": 1e-3, "force_off": 0.0, "k_3": 5e6}
NOISE = 2e-5
DT = 5e-3


def measured(name: str, kind: Kind, u: np.ndarray) -> Record:
    bare = Record(name, DT, {"u": u}, {"u": "N", "x": "m"}, kind=kind)
    clean = simulate(STRUCTURE, TRUTH, bare)
    return clean.with_signals(x=clean["x"] + np.random.default_rng(5).normal(scale=NOISE, size=u.size))


def sweep() -> Record:
    rest = np.zeros(400)
    return measured(
        "sweep", "sweep", np.concatenate([rest, log_sweep(DT * np.arange(4000), 4.0, 2.0, 80.0), rest])
    )


def jump() -> Record:
    return measured("step", "step", step(DT * np.arange(2000), 4.0, 5.0))


def competitor(name: str, **changed: float) -> Competitor:
    return Competitor(name, Model(STRUCTURE, {**TRUTH, **changed}, "foh"), name)


def compared(records: list[Record], *competitors: Competitor) -> Comparison:
    floors = (Floor("x", "m", NOISE, "known"),)
    yardstick = Yardstick(AXIS, floors)
    found = tuple(compare_on_record(competitors, record, (record,), yardstick) for record in records)
    return Comparison("stage", "axis", "local_rational", 4.0, None, competitors, found, floors)


def of(scores: tuple[Score, ...], model: str) -> Mapping[str, Score]:
    return {f"{score.record} {score.column.quantity}": score for score in scores if score.model == model}


def test_the_truth_leaves_the_noise_floor_and_a_wrong_model_more() -> None:
    comparison = compared([sweep(), jump()], competitor("truth"), competitor("linear", k_3=0.0))
    truth, linear = (of(comparison.scores, name) for name in ("truth", "linear"))
    assert set(truth) == {
        "sweep magnitude_rmse", "sweep phase_rmse", "sweep magnitude_db", "sweep free_run_nrmse", "step step_rmse",
        "step free_run_nrmse",
    }  # fmt: skip
    for name, score in truth.items():
        assert score.noise_floor is not None
        assert 0.7 * score.noise_floor < score.value < 1.3 * score.noise_floor, name
        assert linear[name].value > 3.0 * score.value, name
    for name in ("sweep free_run_nrmse", "step step_rmse", "step free_run_nrmse"):
        # An RMS of 801 samples (the step's window) has a standard error of 2.5 %.
        assert truth[name].value == pytest.approx(truth[name].noise_floor, rel=0.075)
    rows = comparison.overall()
    assert all(best(rows, column) == {"truth"} for column in comparison.columns())


def test_a_record_that_begins_in_motion_is_no_fault_of_the_model() -> None:
    """Initial states are estimated: a part cut out of a sweep leaves the floor as well."""
    comparison = compared([sweep().slice(2000, None)], competitor("truth"))
    score = of(comparison.scores, "truth")["sweep free_run_nrmse"]
    assert score.value == pytest.approx(score.noise_floor, rel=0.05)


def test_an_offset_of_a_model_counts_in_free_run_and_not_after_a_step() -> None:
    comparison = compared([jump()], competitor("truth"), competitor("shifted", x_off=3e-3))
    truth, shifted = (of(comparison.scores, name) for name in ("truth", "shifted"))
    assert shifted["step free_run_nrmse"].value > 20.0 * truth["step free_run_nrmse"].value
    assert shifted["step step_rmse"].value < 30.0 * truth["step step_rmse"].value


def test_a_diverging_model_is_told_and_the_others_go_on() -> None:
    comparison = compared([sweep()], competitor("unstable", d=0.0, k_3=-4e7), competitor("truth"))
    (failure,) = comparison.failures
    assert (failure.model, failure.record, failure.column) == ("unstable", "sweep", None)
    assert "unstable" in failure.reason
    assert len(of(comparison.scores, "truth")) == 4
    assert comparison.overall()["unstable"] == {}


def test_the_mean_over_records_is_quadratic_and_leaves_out_a_model_that_failed_on_one() -> None:
    column = Column("step_rmse", "x", "m")
    record = sweep()

    def one(name: str, values: Mapping[str, float]) -> RecordComparison:
        scores = tuple(Score(model, name, column, value, 0.5, 10) for model, value in values.items())
        return RecordComparison(record, {}, scores=scores)

    comparison = Comparison(
        "", "axis", "local_rational", 4.0, None, (competitor("a"), competitor("b")),
        (one("first", {"a": 3.0, "b": 1.0}), one("second", {"a": 4.0})), (),
    )  # fmt: skip
    assert comparison.overall() == {"a": {column: pytest.approx(np.sqrt(12.5))}, "b": {}}
    assert comparison.floor(column) == pytest.approx(0.5)


def test_models_that_read_alike_share_the_first_place() -> None:
    column = Column("step_rmse", "x", "m")
    rows = {"a": {column: 1.0}, "b": {column: 1.0001}, "c": {column: 1.01}, "d": {column: float("nan")}}
    assert best(rows, column) == {"a", "b"}
    assert best({"a": {}}, column) == frozenset()


def test_a_force_element_is_compared_by_its_dynamic_stiffness() -> None:
    structure = compose(ELEMENT)
    values = {"k": 2000.0, "d": 30.0, "force_off": 5.0}
    x = 1e-3 * np.concatenate([np.zeros(200), log_sweep(DT * np.arange(4000), 1.0, 2.0, 80.0), np.zeros(200)])
    record = Record("bench", DT, {"x": x}, {"x": "m", "force": "N"}, kind="sweep")
    clean = simulate(structure, values, record)
    noisy = clean.with_signals(
        force=clean["force"] + np.random.default_rng(2).normal(scale=1e-3, size=x.size)
    )
    rivals = [
        Competitor(name, Model(structure, {**values, **changed}, "foh"), name)
        for name, changed in {"truth": {}, "stiffer": {"k": 4000.0}}.items()
    ]
    found = compare_on_record(
        rivals, noisy, (noisy,), Yardstick(ELEMENT, (Floor("force", "N", 1e-3, "known"),))
    )
    truth, stiffer = (of(found.scores, name) for name in ("truth", "stiffer"))
    assert set(found.measured) == {"x -> force"}
    assert truth["bench free_run_nrmse"].value == pytest.approx(
        truth["bench free_run_nrmse"].noise_floor, rel=0.05
    )
    for name, score in truth.items():
        assert score.value < 0.5 * stiffer[name].value, name

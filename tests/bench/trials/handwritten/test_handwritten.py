"""Trials of design handwritten hold all kinds evenly, follow from their seed, and hide what the key says."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from rigsight.diagnose.fit_context import candidates_on
from rigsight.effects import CATALOGUE, kind_of
from rigsight.identify import characteristic_scales
from rigsight.rigs import RIGS
from rigsight.simulate import compose
from rigsight.units import characteristic_value
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight_bench.running.files import BenchFolder
from rigsight_bench.trials import n_trials
from rigsight_bench.trials.handwritten.cells import TURNS, Cell, handwritten_cell_of, handwritten_cells
from rigsight_bench.trials.handwritten.plan import between_samples, draw_plan
from rigsight_bench.trials.handwritten.plants import DRIVE_LAWS, JOINT_LAWS, PRESCRIBED
from rigsight_bench.trials.handwritten.shapes import SHAPES, Sizes, draw_shape
from rigsight_bench.trials.handwritten.trial import _by_names_of_fit, draw_bench, draw_handwritten_trial
from rigsight_bench.trials.runs import Run

SEED = 7
SIZES = Sizes(x=0.1, v=1.0, force=5.0, stiffness=50.0, input=2.0)
SINGLES = [cell for cell in handwritten_cells() if cell.kind == "single"]


def offered(cell: Cell) -> dict[tuple[str, str], object]:
    rig = RIGS[cell.rig]
    return {(kind_of(e.name), rig.where(e)): e for e in candidates_on(rig, CATALOGUE)}


@pytest.mark.parametrize("n", [8, 20, 40, 96])
def test_any_first_trials_hold_all_kinds_evenly(n: int) -> None:
    turn = {cell: number for number, cells in enumerate(TURNS) for cell in cells}
    counts = Counter(turn[handwritten_cell_of(SEED, number)] for number in range(n))
    assert max(counts.values()) - min(counts.values()) <= 1
    assert len(counts) == min(n, len(TURNS))


def test_a_pass_takes_every_cell_once_and_an_eighth_are_controls() -> None:
    cells = [handwritten_cell_of(SEED, number) for number in range(n_trials("handwritten"))]
    assert Counter(cells) == Counter(handwritten_cells())
    assert cells != [handwritten_cell_of(SEED + 1, number) for number in range(len(cells))]
    kinds = Counter(cell.kind for cell in cells)
    assert kinds["none"] + kinds["parameters"] == kinds["outside"] == len(cells) // 8


def test_at_least_ten_effects_are_hidden_where_the_diagnosis_looks() -> None:
    assert len({cell.effect for cell in SINGLES}) >= 10
    assert len({cell.rig for cell in SINGLES}) >= 3
    for cell in SINGLES:
        assert (cell.effect, cell.place) in offered(cell)


def test_effects_from_outside_are_in_no_catalogue() -> None:
    outside = [cell for cell in handwritten_cells() if cell.kind == "outside"]
    assert not {cell.effect for cell in outside} & {effect.name for effect in CATALOGUE}
    for cell in outside:
        assert cell.effect in {**JOINT_LAWS, **DRIVE_LAWS}
        assert cell.place in {place for _, place in offered(cell)}


@pytest.mark.parametrize("cell", SINGLES, ids=lambda c: f"{c.rig}-{c.effect}-{c.place}")
def test_a_shape_has_every_parameter_of_the_catalogue_within_its_bounds(cell: Cell) -> None:
    effect = offered(cell)[cell.effect, cell.place]
    own = draw_shape(cell.effect, SIZES, np.random.default_rng(SEED)).at(0.4)
    assert own.keys() == {p.name for p in effect.parameters}
    assert all(p.lower <= own[p.name] <= p.upper for p in effect.parameters)
    structure = compose(RIGS[cell.rig], [effect])
    assert _by_names_of_fit(cell, own).keys() == {structure.parameter_name(effect, name) for name in own}


@pytest.mark.parametrize("effect", SHAPES)
def test_a_strength_of_nearly_nothing_leaves_nearly_nothing(effect: str) -> None:
    shape = draw_shape(effect, SIZES, np.random.default_rng(SEED))
    little, much = shape.at(1e-6), shape.at(1.0)
    assert all(abs(little[name]) == pytest.approx(1e-6 * abs(much[name])) for name in shape.growing)
    assert all(little[name] == pytest.approx(1e6 * much[name]) for name in shape.thresholds)
    assert all(little[name] == pytest.approx(1.0, abs=1e-5) for name in shape.elastic)


@pytest.mark.slow
def test_forms_are_no_starts_of_the_search() -> None:
    """As they would be if forms were drawn from what the search begins with, spread or not."""
    cell = Cell("single", "running_gear", "bouc_wen_hysteresis", "yaw_dynamics")
    bench = draw_bench(cell, np.random.default_rng(SEED))
    scales = characteristic_scales(bench.rig, bench.linear, bench.values)
    drawn = [draw_shape(cell.effect, bench.sizes, np.random.default_rng(i)).at(1.0) for i in range(40)]
    effect = offered(cell)[cell.effect, cell.place]
    for p in effect.parameters:
        if p.fitted:
            starts = [start * characteristic_value(p.dimension, scales) for start in p.starts]
            assert all(own[p.name] != pytest.approx(start, rel=1e-6) for own in drawn for start in starts)
            assert len({own[p.name] for own in drawn}) == len(drawn)


def plans(prescribed: bool, n: int = 40) -> list[tuple[Run, ...]]:
    return [
        draw_plan({"u": 1.0}, (2.0, 40.0), np.random.default_rng(i), prescribed=prescribed) for i in range(n)
    ]


def test_rates_holds_kinds_and_lengths_differ_from_trial_to_trial() -> None:
    drawn = plans(prescribed=False)
    assert len({plan[0].dt for plan in drawn}) >= 5
    assert {r.hold for plan in drawn for r in plan} == {"zoh", "foh", "band_limited"}
    assert {r.kind for plan in drawn for r in plan if r.role} == {"sweep", "multisine", "operation", "step"}
    assert len({len(plan) for plan in drawn}) >= 4
    assert all(r.hold == "zoh" for plan in drawn for r in plan if r.kind == "step")
    assert all(r.dt * r.n_samples >= 9.9 for plan in drawn for r in plan)


@pytest.mark.slow
def test_every_plan_has_two_amplitudes_to_fit_and_another_waveform_to_score() -> None:
    for plan in plans(prescribed=False) + plans(prescribed=True):
        fitted = [r for r in plan if r.role == "estimation"]
        scored = [r for r in plan if r.role == "validation"]
        sizes = [float(np.max(np.abs(r.inputs()["u"]))) for r in fitted[:2]]
        assert sizes[0] < 0.8 * sizes[1]
        assert scored[0].kind != fitted[0].kind
        assert [r.role for r in plan].count(None) == 2


def test_a_prescribed_motion_has_no_corners() -> None:
    assert all(r.hold == "band_limited" for plan in plans(prescribed=True) for r in plan)
    assert all(r.kind in ("sweep", "multisine") for plan in plans(prescribed=True) for r in plan)


def test_a_held_input_reaches_the_plant_as_its_record_says() -> None:
    steps = next(r for plan in plans(prescribed=False) for r in plan if r.hold == "zoh" and r.kind == "sweep")
    u, (held,) = steps.inputs()["u"], between_samples(steps)
    for i in (0, 100, 2000):
        between = held.during(i * steps.dt, (i + 1) * steps.dt)
        assert between((i + 0.3) * steps.dt) == between((i + 0.9) * steps.dt) == u[i]


@pytest.mark.slow
def test_a_trial_follows_from_its_seed_and_its_campaign_reads(tmp_path: Path) -> None:
    number = next(
        n for n in range(96)
        if (cell := handwritten_cell_of(SEED, n)).kind == "single" and cell.rig == PRESCRIBED
    )  # fmt: skip
    trial, again = (draw_handwritten_trial(SEED, number) for _ in range(2))
    assert trial.key == again.key
    assert trial.given == again.given
    for one, other in zip(trial.records, again.records, strict=True):
        assert all(np.array_equal(one[name], other[name]) for name in one.signals)
    cell = handwritten_cell_of(SEED, number)
    key = trial.key
    assert (key["kind"], key["rig"], key["design"]) == ("single", cell.rig, "handwritten")
    assert set(key["noise_floor"]) == {s.name for s in RIGS[cell.rig].outputs}
    assert key["gap"] >= 5.0
    structure = compose(RIGS[cell.rig], [offered(cell)[cell.effect, cell.place]])
    assert set(structure.names) <= set(key["values"])
    folder = BenchFolder(tmp_path / "bench")
    folder.settle("handwritten", SEED)
    folder.write_trial("000", trial)
    campaign = read_campaign(folder.campaign("000"))
    assert campaign.parameters == trial.given
    assert [r.hold for r in campaign.records] == [r.hold for r in trial.records]
    assert [r.name for r in folder.withheld_records("000", RIGS[cell.rig])]

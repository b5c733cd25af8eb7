"""Offsets of a sensor that differ from record to record: estimated where that is declared, told where it is not."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rigsight.campaign import Campaign
from rigsight.compare.comparison import Competitor
from rigsight.diagnose.noise.detection import noise_floors
from rigsight.diagnose.result import Diagnosis
from rigsight.effects import effect_named
from rigsight.errors import InputError
from rigsight.excitation import linear_sweep
from rigsight.identify.identification import Identification
from rigsight.records import Record
from rigsight.rigs import AXIS, RIGS, Rig
from rigsight.simulate import compose, simulate
from rigsight.workflow.campaign.in_memory import make_campaign
from rigsight.workflow.campaign.model_file import model_of
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.compare import compare_campaign
from rigsight.workflow.diagnose import diagnose_campaign
from rigsight.workflow.discover import discover_campaign
from rigsight.workflow.identify import checked_options, identify_campaign

from ..tiers import slow_but

DT, NOISE = 5e-3, 2e-5
AXIS_VALUES = {"gain": 1.0, "m": 2.0, "d": 5.0, "k": 800.0, "x_off": 0.0, "force_off": 0.0}
TRAIN_VALUES = {
    "k_t": 0.05, "J_m": 1e-4, "J_l": 5e-4, "k_s": 0.4, "d_s": 1e-3, "d_m": 5e-4, "d_l": 1e-3, "k_l": 0.1,
}  # fmt: skip
FRICTION = ("coulomb_friction", {"T_c": 0.3})
OFFSETS = {"sweep_1": 1e-4, "sweep_3": -8e-5, "sweep_2": 5e-5, "sweep_1.5": -3e-4}
# Those that a memory imitates, and the true ones.
RIVALS = ("coulomb_friction", "bouc_wen_hysteresis", "sensor_delay", "asymmetric_stiffness")


def records(
    effects: Sequence[tuple[str, Mapping[str, float]]] = (FRICTION,),
    factor: float = 1.0,
    seconds: float = 5.0,
) -> list[Record]:
    """Two sweeps to fit and two to score, whose sensor was zeroed anew in between."""
    rng, t = np.random.default_rng(0), DT * np.arange(round(seconds / DT))
    structure = compose(AXIS, [effect_named(name) for name, _ in effects])
    values = AXIS_VALUES | {name: value for _, own in effects for name, value in own.items()}
    found = []
    for amplitude, role in (
        (1.0, "estimation"),
        (3.0, "estimation"),
        (2.0, "validation"),
        (1.5, "validation"),
    ):
        name = f"sweep_{amplitude:g}"
        driven = Record(
            name,
            DT,
            {"u": linear_sweep(t, amplitude, 1.0, 12.0)},
            {},
            kind="sweep",
            amplitude=amplitude,
            role=role,
        )
        x = simulate(structure, values, driven)["x"] + rng.normal(scale=NOISE, size=t.size)
        found.append(driven.with_signals(x=x + factor * OFFSETS[name]))
    return found


def campaign(offsets: Any = "shared", **drawn: Any) -> Campaign:
    return make_campaign("axis", records(**drawn), offsets=offsets)


def identified(made: Campaign) -> Identification:
    return identify_campaign(made, checked_options("local_rational", None))


def diagnosed(made: Campaign, names: Sequence[str] = RIVALS) -> Diagnosis:
    return diagnose_campaign(made, [effect_named(name) for name in names])


def reported(diagnosis: Diagnosis) -> list[Any]:
    assert diagnosis.data_quality is not None
    return [finding for finding in diagnosis.data_quality.findings if finding.kind == "offset"]


@pytest.mark.slow
def test_offsets_that_nobody_declared_are_told_before_a_second_effect_is_believed() -> None:
    found = diagnosed(campaign(), ["coulomb_friction", "iwan_hysteresis"])
    assert found.effects == ("coulomb_friction",)
    (finding,) = reported(found)
    assert 'offsets = "per_record"' in finding.remedy
    assert finding.signal == "x"
    assert found.gap["x"].after == pytest.approx(found.gap["x"].noise_floor, rel=0.1)
    # What is estimated is no part of the model.
    assert not any("offset" in name for name in found.model["parameters"])


@pytest.mark.slow
@pytest.mark.parametrize("factor", slow_but(1.0, of=[1.0, 1e4]))
def test_declared_offsets_leave_the_numbers_right(factor: float) -> None:
    found = diagnosed(campaign("per_record", factor=factor))
    assert found.effects == ("coulomb_friction",)
    assert reported(found) == []
    best = found.candidates[0].parameters
    for name, true in {**AXIS_VALUES, "T_c": 0.3}.items():
        if name in best:
            assert best[name].value == pytest.approx(true, abs=4.0 * best[name].std)
    # A rest position says the same as offsets do.
    assert "x_off" not in best
    # The motion is what counts, not how far apart records were zeroed.
    assert found.gap["x"].reidentified == pytest.approx(0.155, rel=0.1)


@pytest.mark.slow
def test_a_memory_beside_offsets_is_named_alone() -> None:
    memory = ("bouc_wen_hysteresis", {"A": 1.0, "a": 0.4, "beta": 500.0, "gamma": -100.0, "n": 1.0})
    found = diagnosed(campaign(effects=[memory]))
    assert found.effects == ("bouc_wen_hysteresis",)
    assert len(reported(found)) == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    "effects",
    [
        pytest.param([], id="linear"),
        pytest.param([FRICTION], id="friction", marks=pytest.mark.slow),
        pytest.param(
            [FRICTION, ("asymmetric_stiffness", {"k_2": 2e4})],
            id="one that pulls to one side",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_records_without_such_offsets_are_left_in_peace(effects: Any) -> None:
    found = diagnosed(campaign(effects=effects, factor=0.0))
    assert [finding for finding in reported(found) if finding.serious] == []
    assert "coulomb_friction" in found.effects or not effects


@pytest.mark.slow
def test_levels_farther_apart_than_the_motion_are_told() -> None:
    (finding,) = reported(diagnosed(campaign(factor=1e3), ["coulomb_friction"]))
    assert finding.serious
    assert "times its motion in any record" in finding.sentence


def test_identify_estimates_them_and_compare_scores_without_them() -> None:
    made = campaign("per_record", effects=[])
    found = identified(made)
    for name in ("m", "d", "k"):
        value, error = found.joint.fit.fit.values[name], found.joint.fit.fit.standard_errors[name]
        assert value == pytest.approx(AXIS_VALUES[name], abs=4.0 * error)
    (said,) = [warning for warning in found.warnings if warning.startswith("Offset of x in each record")]
    first, second = (float(number) for number in re.findall(r"'sweep_\d' ([^,]+?)[,.]?(?= |$)", said))
    # From the rest position, which nothing tells: their difference is what the records know.
    assert first - second == pytest.approx(OFFSETS["sweep_1"] - OFFSETS["sweep_3"], abs=2e-6)
    model = model_of(found.model)
    compared = compare_campaign(made, [Competitor("identified", model, "")])
    moved = {record.name: float(np.std(record["x"])) for record in made.records}
    errors = {s.record: s.value for s in compared.scores if s.column.quantity == "free_run_nrmse"}
    assert errors == {name: pytest.approx(NOISE / std, rel=0.2) for name, std in moved.items()}
    # Elsewhere the model has no offset.
    at_rest = simulate(model.structure, model.values, Record("rest", DT, {"u": np.zeros(100)}, {}))
    assert abs(at_rest["x"][-1]) < 1e-3


@pytest.mark.slow
def test_discovery_finds_the_friction_beside_them() -> None:
    found = discover_campaign(campaign("per_record"))
    assert found.model["effects"] == ["coulomb_friction"]


@pytest.mark.slow
def test_two_sensors_have_an_offset_each() -> None:
    rig: Rig = RIGS["drive_train"]
    rng, t = np.random.default_rng(1), DT * np.arange(1200)
    made = []
    for index, (amplitude, role) in enumerate(
        ((1.0, "estimation"), (0.4, "estimation"), (0.7, "validation"))
    ):
        driven = Record(f"run_{index}", DT, {"u": linear_sweep(t, amplitude, 0.5, 8.0)}, {}, role=role)
        shown = simulate(compose(rig), TRAIN_VALUES, driven)
        made.append(
            driven.with_signals(
                **{
                    s.name: shown[s.name] + 0.05 * rng.normal() + rng.normal(scale=1e-4, size=t.size)
                    for s in rig.outputs
                }
            )
        )
    found = identified(make_campaign(rig, made, constants={"k_t": 0.05}, offsets="per_record"))
    assert found.joint.fit.fit.values["k_s"] == pytest.approx(0.4, rel=0.02)
    assert sum(warning.startswith("Offset of ") for warning in found.warnings) == 2


def test_repeats_that_were_zeroed_anew_are_repeats() -> None:
    first = records()[0]
    rng = np.random.default_rng(2)
    clean = np.array(first["x"])
    repeats = [
        Record(
            f"run_{i}",
            DT,
            {"u": first["u"], "x": clean + 1e-3 * i + rng.normal(scale=NOISE, size=clean.size)},
            {},
        )
        for i in range(3)
    ]
    (floor,) = noise_floors(AXIS, [record.with_free_offsets(["x"]) for record in repeats])
    assert floor.std == pytest.approx(NOISE, rel=0.1)


def test_a_wrong_value_is_refused_with_the_allowed_ones(axis_campaign: Path) -> None:
    with pytest.raises(InputError, match=r"offsets.*'each'|'each'.*offsets"):
        campaign("each")
    path = axis_campaign / "campaign.toml"
    text = path.read_text(encoding="utf-8")
    path.write_text('offsets = "each"\n' + text, encoding="utf-8")
    with pytest.raises(InputError, match=r"offsets.*per_record"):
        read_campaign(axis_campaign)
    path.write_text('offsets = "per_record"\n' + text, encoding="utf-8")
    assert all(record.free_offsets == ("x",) for record in read_campaign(axis_campaign).records)

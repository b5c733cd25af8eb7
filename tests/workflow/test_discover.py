"""What does `rigsight discover` leave, and can the model be simulated?"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rigsight.campaign import Campaign
from rigsight.cli import app
from rigsight.discover.own_laws import own_laws
from rigsight.discover.records import DiscoveryData
from rigsight.discover.result import Discovery, JointForce, OfferedShape, Run
from rigsight.discover.shape import Shape
from rigsight.discover.terms import MONOMIALS
from rigsight.effects import effect_named
from rigsight.errors import InputError
from rigsight.identify.fit.windows import cut
from rigsight.inverse import MissingForce
from rigsight.records import Record
from rigsight.records.record import Role
from rigsight.rigs import AXIS
from rigsight.simulate import compose
from rigsight.simulate.model import Model
from rigsight.workflow.campaign.model_file import read_model
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.discover import check_kept, discover_campaign, only, run_discover, write_discovery
from rigsight.workflow.own.own_effects import own_effects
from rigsight.workflow.run.progress import Step
from rigsight.workflow.simulate import run_simulate


def test_a_discovery_is_written_whole_and_its_model_simulates(axis_campaign: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    steps: list[Step] = []
    found = run_discover(axis_campaign, out, n_jobs=1, listener=steps.append)
    assert {path.name for path in out.iterdir()} == {"discovery.json", "model.json", "discovery.svg"}
    written = json.loads((out / "discovery.json").read_text())
    assert written == json.loads(json.dumps(found.to_json()))
    assert written["schema_version"] == 2
    kept = [term for term in written["terms"] if term["kept"]]
    assert [term["name"] for term in kept] == ["cubic_stiffness"]
    k_3 = kept[0]["coefficients"]["k_3"]
    assert k_3["unit"] == "N/m^3"
    assert k_3["interval_95"][0] < 5e6 < k_3["interval_95"][1]
    assert all(0.0 <= term["inclusion_probability"] <= 1.0 for term in kept)
    assert "k_3" in written["equations"][0]
    assert "k_{3}" in written["latex"][0]
    assert steps[-1].done <= steps[-1].total

    assert written["offered_shape"] is None
    assert written["own_laws"] is None

    campaign = read_campaign(axis_campaign)
    validation = campaign.validation[0]
    assert validation.source is not None
    simulated = run_simulate(out, validation.source, tmp_path / "predicted.csv")
    error = validation["x"] - simulated["x"]
    assert np.sqrt(np.mean(error**2)) < 3.0 * found.noise_floor * np.std(validation["x"])


def test_laws_that_no_catalogue_has_are_written_as_effects(tmp_path: Path) -> None:
    (joint,) = AXIS.mechanism.joints
    shape = Shape(joint, "velocity", 0.1, ("coulomb_friction",), (3, 7), (0.2, 0.1), 0.9)
    structure = compose(AXIS, [MONOMIALS[0]])
    model = Model.of(structure, dict.fromkeys(structure.names, 1.0), "foh")
    laws = own_laws(model, (), {"x": 0.1, "force": 1.0, "time": 0.1})
    nothing = np.zeros(40)
    missing = MissingForce("dynamics", "m", "N", 0.0, 1.0, ("a",) * 40, *(3 * [nothing + 1.0]), nothing)
    offered = OfferedShape(
        effect=shape.effect, equation=shape.equation, argument="velocity", in_place_of=shape.in_place_of,
        n_knots=2, share=0.9, error_before=9.0, error_over_noise=2.0,
        force=JointForce(missing, nothing, (shape.effect.name,)),
    )  # fmt: skip
    run = Run("a", "validation", 0.1 * np.arange(40), nothing, nothing, "x", "m")
    found = Discovery(
        title="", rig="axis", equations=(), latex=(), rig_parameters={}, terms=(), alternatives=(), held_out=(),
        held_out_error=9.0, held_out_nrmse=0.1, noise_floor=0.01, independent=9.0, runs=(run,), output="x", unit="m",
        model={}, warnings=(), offered=offered, own_laws=laws,
    )  # fmt: skip
    write_discovery(found, tmp_path)
    written = json.loads((tmp_path / "discovery.json").read_text())
    for entry, expected in (("offered_shape", [shape.effect]), ("own_laws", list(laws))):
        file = tmp_path / written[entry]["file"]
        assert own_effects([file], check=False) == tuple(expected)
        with pytest.raises(InputError, match=re.escape(str(file))):
            check_kept([file], tmp_path)
    check_kept([tmp_path / "shape.py"], tmp_path / "again")
    assert written["offered_shape"]["error_in_noise_floors"] == {"before": 9.0, "with_it": 2.0}


@pytest.mark.slow
def test_each_record_alone_is_reported_beside_all_together(axis_campaign: Path) -> None:
    found = run_discover(axis_campaign, one_by_one=True, n_jobs=1)
    campaign = read_campaign(axis_campaign)
    assert [name for name, _ in found.by_record] == [record.name for record in campaign.estimation]
    assert set(found.to_json()["by_record"]) == {record.name for record in campaign.estimation}


def test_a_record_alone_is_not_joined_by_one_whose_name_begins_alike() -> None:
    def named(name: str, role: Role = "estimation") -> Record:
        t = 0.01 * np.arange(300)
        return Record(name, 0.01, {"u": np.sin(t), "x": np.cos(t)}, {}, role=role)

    whole = (named("sine_1"), named("sine_10"), named("other", "validation"))
    data = DiscoveryData(Campaign("axis", AXIS, {"gain": 1.0}, {}, whole), {"x": 1e-3})
    assert [r.name for r in only(data, whole[0]).records] == ["sine_1", "other"]
    cut_up = replace(data, windows=cut(whole, 1.0))
    assert {r.origin for r in only(cut_up, whole[0]).records} == {"sine_1", "other"}
    assert len(only(cut_up, whole[0]).records) == 6


def test_effects_that_are_modelled_already_stay_in_every_equation(axis_campaign: Path) -> None:
    read = read_campaign(axis_campaign)
    modelled = (effect_named("cubic_stiffness"),)
    campaign = replace(read, modelled=modelled, parameters={**read.parameters, "k_3": 4e6})
    found = discover_campaign(campaign, n_jobs=1)
    assert found.kept == ()
    assert found.held_out_error < 1.2
    assert found.model["effects"] == ["cubic_stiffness"]


@pytest.mark.slow
def test_the_command_says_the_equation_and_where_it_is(axis_campaign: Path, tmp_path: Path) -> None:
    from typer.testing import CliRunner

    out = tmp_path / "out"
    result = CliRunner().invoke(app, ["discover", str(axis_campaign), "--out", str(out)])
    assert result.exit_code == 0, result.output
    assert "m x'' =" in result.output
    assert "k_3" in result.output
    assert "model.json" in result.output


@pytest.mark.parametrize("effect", MONOMIALS, ids=lambda effect: effect.name)
def test_a_model_may_hold_a_monomial_that_no_effect_is(effect: Any, write_model: Callable[..., Path]) -> None:
    name = effect.parameters[0].name
    unit = {p.name: p.unit for p in compose(AXIS, [effect]).parameters}[name]

    def change(model: dict[str, Any]) -> None:
        model.update(effects=[effect.name], effect_parameters={name: 2.0}, units={name: unit})

    model = read_model(write_model(change))
    assert model.structure.effect_names == (effect.name,)
    assert model.values[name] == 2.0
    assert model.to_json()["effects"] == [effect.name]

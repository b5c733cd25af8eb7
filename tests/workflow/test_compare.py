"""The comparison of models as a command: all results or none, bad models told in words."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from rigsight.cli import app
from rigsight.errors import InputError
from rigsight.excitation import log_sweep, step
from rigsight.workflow.compare import run_compare
from rigsight.workflow.demo import VirtualRig

GEAR = """\
title = "rear <axle>"

[rig]
model = "running_gear"
constants = { v = 1.0, r_0 = 0.1, b = 0.3, k_tau = 0.27 }
"""


@pytest.fixture(scope="module")
def gear(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign of the virtual rig: a sweep and a step."""
    folder = tmp_path_factory.mktemp("gear")
    rig, rng = VirtualRig(), np.random.default_rng(1)
    rest = np.zeros(400)
    u = np.concatenate([rest, log_sweep(rig.time(25.0), 1.0, 0.8, 80.0), rest])
    records = {
        "sweep": rig.measure("sweep", u, rng, kind="sweep"),
        "step": rig.measure("step", step(rig.time(10.0), 0.6, 5.0), rng, kind="step", hold="zoh"),
    }
    text = GEAR
    for name, record in records.items():
        np.savetxt(
            folder / f"{name}.csv",
            np.column_stack([record.t, record["u"], record["psi"], record["y"]]),
            delimiter=",",
            header="t,u,psi,y",
            comments="",
        )
        text += f'\n[[records]]\nfile = "{name}.csv"\nkind = "{name}"\nhold = "{record.hold}"\n'
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    return folder


@pytest.fixture
def linear_model(write_model: Callable[..., Path]) -> Path:
    def linear(content: dict[str, Any]) -> None:
        content.update(effects=[], effect_parameters={}, units={})

    return write_model(linear)


@pytest.mark.slow
def test_the_command_writes_tables_a_page_and_figures(gear: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    models = ["nominal", "iwan_tables", "mine=identified"]
    result = CliRunner().invoke(app, ["compare", str(gear), *models, "--out", str(out), "--jobs", "1"])
    assert result.exit_code == 0, result.output
    assert {path.name for path in out.iterdir()} == {
        "comparison.json", "comparison.csv", "comparison.html", "errors.svg", "responses_01_sweep.svg", "step_02_step.svg"
    }  # fmt: skip
    rows = list(csv.DictReader((out / "comparison.csv").read_text(encoding="utf-8").splitlines()))
    assert len({(r["model"], r["record"], r["signal"], r["quantity"]) for r in rows}) == len(rows)
    # Two paths with three errors and two outputs in free run on the sweep; two outputs twice on the step.
    assert len(rows) == 3 * (2 * 3 + 2 + 4)
    assert {r["model"] for r in rows} == {"nominal", "iwan_tables", "mine"}
    truth = [r for r in rows if r["model"] == "iwan_tables" and r["signal"] in ("psi", "u -> psi")]
    assert all(r["best"] == "yes" for r in truth)
    # The floor is of the rig at rest, where its resonance does not amplify the disturbance.
    assert all(float(r["value"]) < 2.5 * float(r["noise_floor"]) for r in truth)
    content = json.loads((out / "comparison.json").read_text(encoding="utf-8"))
    assert (content["schema_version"], len(content["scores"]), content["failures"]) == (1, len(rows), [])
    assert [s["value"] for s in content["scores"]] == pytest.approx(
        [float(r["value"]) for r in rows], rel=1e-8
    )
    assert content["models"][2]["model"]["parameters"]["k_c"] == 81.0
    page = (out / "comparison.html").read_text(encoding="utf-8")
    assert "rear &lt;axle&gt;" in page
    assert "<script" not in page
    assert not re.findall(r'(?:src|href)="(?!#|data:)', page)
    ids = re.findall(r'\bid="([^"]+)"', page)
    assert len(ids) == len(set(ids))
    assert "noise floor" in result.output
    assert re.search(r"iwan_tables +[0-9.e-]+\*", result.output)


def test_the_given_simulation_is_a_model_where_all_its_parameters_are_given(axis_campaign: Path) -> None:
    given = (axis_campaign / "campaign.toml").read_text(encoding="utf-8")
    assert "k = 800.0\n" in given
    comparison = run_compare(axis_campaign, ["given"], n_jobs=1)
    (competitor,) = comparison.competitors
    assert competitor.model.values["k"] == 800.0
    part = given.replace("k = 800.0\n", "")
    (axis_campaign / "campaign.toml").write_text(part, encoding="utf-8")
    with pytest.raises(InputError, match="has no value of k"):
        run_compare(axis_campaign, ["given"], n_jobs=1)


def test_the_method_of_the_thesis_is_an_option(gear: Path) -> None:
    comparison = run_compare(gear, ["identified", "nominal"], method="thesis", n_jobs=1)
    errors = {(s.model, s.column.signal, s.column.quantity): s for s in comparison.scores}
    yaw = errors["identified", "u -> psi", "magnitude_rmse"]
    assert yaw.column.unit == "rad/A"
    assert yaw.noise_floor is not None
    assert 0.0 < yaw.noise_floor < errors["nominal", "u -> psi", "magnitude_rmse"].value
    # Table 5.1 has the same order at 1 A.
    assert yaw.value < errors["nominal", "u -> psi", "magnitude_rmse"].value


@pytest.mark.parametrize("method", ["local_polynomial", "h1"])
def test_with_any_estimator_the_truth_is_best(gear: Path, method: str) -> None:
    comparison = run_compare(gear, ["identified", "iwan_tables"], method=method, n_jobs=1)
    rows = comparison.table("sweep")
    columns = [column for column in comparison.columns("sweep") if column.signal == "u -> psi"]
    assert len(columns) == 3
    for column in columns:
        assert rows["iwan_tables"][column] < rows["identified"][column]


def test_a_model_of_another_rig_is_refused_before_anything_is_done(
    axis_campaign: Path, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=r"'nominal' is of the rig 'running_gear'.*rig 'axis'"):
        run_compare(axis_campaign, ["nominal"], tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("model", "reported"),
    [("nominl", "Did you mean 'nominal'"), ("=nominal", "NAME=MODEL"), ("missing.json", "does not exist")],
)
def test_a_model_that_is_none_is_told(axis_campaign: Path, model: str, reported: str) -> None:
    with pytest.raises(InputError, match=reported):
        run_compare(axis_campaign, [model])


def test_a_diverging_model_is_marked_and_the_others_go_on(
    axis_campaign: Path, linear_model: Path, tmp_path: Path
) -> None:
    content = json.loads(linear_model.read_text())
    content.update(effects=["cubic_stiffness"], effect_parameters={"k_3": -4e7})
    (tmp_path / "softening.json").write_text(json.dumps(content), encoding="utf-8")
    out = tmp_path / "out"
    result = CliRunner().invoke(
        app,
        [
            "compare",
            str(axis_campaign),
            str(tmp_path / "softening.json"),
            f"linear={linear_model}",
            "--out",
            str(out),
        ],
    )
    assert result.exit_code == 0, result.output
    rows = list(csv.DictReader((out / "comparison.csv").read_text(encoding="utf-8").splitlines()))
    failed = [r for r in rows if r["model"] == "softening" and r["record"] == "fit"]
    assert failed
    assert all(r["value"] == "" and "unstable" in r["problem"] for r in failed)
    assert all(r["value"] for r in rows if r["model"] == "linear")
    assert "softening on 'fit' cannot be simulated" in " ".join(result.output.split())


def test_if_no_model_can_be_simulated_nothing_is_written(
    axis_campaign: Path, linear_model: Path, tmp_path: Path
) -> None:
    content = json.loads(linear_model.read_text())
    content.update(effects=["cubic_stiffness"], effect_parameters={"k_3": -4e8})
    linear_model.write_text(json.dumps(content), encoding="utf-8")
    out = tmp_path / "out"
    result = CliRunner().invoke(app, ["compare", str(axis_campaign), str(linear_model), "--out", str(out)])
    assert result.exit_code == 2
    assert "No model can be compared" in result.output
    assert not out.exists()


def test_without_sweeps_the_steps_and_free_runs_are_compared(gear: Path, tmp_path: Path) -> None:
    text = (gear / "campaign.toml").read_text(encoding="utf-8")
    head, _, last = text.split("[[records]]")
    (tmp_path / "campaign.toml").write_text(f"{head}[[records]]{last}", encoding="utf-8")
    (tmp_path / "step.csv").write_bytes((gear / "step.csv").read_bytes())
    comparison = run_compare(tmp_path, ["nominal", "nominal"], n_jobs=1)
    assert {s.column.quantity for s in comparison.scores} == {"step_rmse", "free_run_nrmse"}
    assert any("no frequency responses" in note for note in comparison.notes)
    assert [c.name for c in comparison.competitors] == ["nominal", "nominal_2"]


def test_other_constants_than_the_campaign_has_are_told(gear: Path, tmp_path: Path) -> None:
    for file in gear.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    campaign = tmp_path / "campaign.toml"
    campaign.write_text(campaign.read_text().replace("v = 1.0", "v = 2.0"), encoding="utf-8")
    notes = run_compare(tmp_path, ["nominal"], n_jobs=1).notes
    assert (
        "Model 'nominal' has other constants than the campaign: v = 1 (campaign: 2). It is compared with its own constants."
        in notes
    )


def test_what_was_done_to_a_record_is_told(axis_campaign: Path, linear_model: Path, tmp_path: Path) -> None:
    file = axis_campaign / "fit.csv"
    file.write_text(file.read_text().replace("t,u,x", "t,u,x_mm", 1))
    toml = axis_campaign / "campaign.toml"
    toml.write_text(
        toml.read_text().replace('file = "fit.csv"', 'file = "fit.csv"\ncolumns = { x = "x_mm" }', 1)
    )
    result = CliRunner().invoke(
        app, ["compare", str(axis_campaign), str(linear_model), "--out", str(tmp_path / "o")]
    )
    assert result.exit_code == 0, result.output
    (reported,) = [
        n for n in json.loads((tmp_path / "o" / "comparison.json").read_text())["notes"] if "x_mm" in n
    ]
    assert reported.startswith("Record 'fit': fit.csv, column 'x_mm': values taken as m without conversion")
    assert "values taken as m" in (tmp_path / "o" / "comparison.html").read_text()
    assert "taken as m" in re.sub(r"\s+", " ", result.output)


def test_a_rig_without_a_spring_is_run_in_windows(axis_campaign: Path, linear_model: Path) -> None:
    content = json.loads(linear_model.read_text())
    content["parameters"]["k"] = 0.0
    linear_model.write_text(json.dumps(content), encoding="utf-8")
    comparison = run_compare(axis_campaign, [linear_model], n_jobs=1)
    assert comparison.window_length is not None
    assert comparison.window_length < 9.0

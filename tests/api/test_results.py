"""Can every result be looked at, tabulated and saved, and is what cannot be shown told?"""

from __future__ import annotations

import sys
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import rigsight as rs
from rigsight.effects import effect_named
from rigsight.workflow.diagnose import run_diagnose

RESULTS = ("diagnosis", "identification", "discovery", "comparison")
PICTURES = [
    ("diagnosis", {}), ("diagnosis", {"picture": "candidates"}), ("diagnosis", {"picture": "record"}),
    ("diagnosis", {"picture": "record", "record": "fit", "output": "x"}),
    ("identification", {}), ("identification", {"picture": "amplitudes"}),
    ("identification", {"picture": "bode", "record": "fit"}),
    ("discovery", {}), ("comparison", {}), ("comparison", {"record": "score"}),
]  # fmt: skip
FILES = {
    "diagnosis": {"diagnosis.json", "model.json", "report.html"},
    "identification": {
        "identification.json",
        "identification.html",
        "model.json",
        "bode_fit.svg",
        "responses.svg",
        "amplitudes.svg",
    },
    "discovery": {"discovery.json", "model.json", "discovery.svg"},
    "comparison": {"comparison.json", "comparison.csv", "comparison.html", "errors.svg"},
}


@pytest.fixture
def result(request: pytest.FixtureRequest) -> Any:
    """The result that the test is parametrized with."""
    name = request.param
    if name == "comparison":
        return request.getfixturevalue("comparison")
    holder = {"diagnosis": "diagnoser", "identification": "identifier", "discovery": "discoverer"}[name]
    return getattr(request.getfixturevalue(holder), f"{name}_")


@pytest.mark.parametrize(("result", "arguments"), PICTURES, indirect=["result"])
def test_a_picture_is_a_figure_with_something_in_it(result: Any, arguments: dict[str, str]) -> None:
    figure = result.plot(**arguments)
    assert isinstance(figure, Figure)
    axes = figure.axes
    assert any(ax.lines or ax.patches or ax.collections for ax in axes)
    assert result.plot(**arguments) is not figure


@pytest.mark.parametrize(
    ("result", "arguments", "message"),
    [
        ("diagnosis", {"picture": "gaps"}, "The picture is 'gaps'. Did you mean 'gap'"),
        ("diagnosis", {"picture": "record", "record": "scorre"}, "Did you mean 'score'"),
        ("diagnosis", {"picture": "record", "output": "y"}, "The output is 'y'.*Allowed: 'x'"),
        ("identification", {"picture": "bode", "record": "score"}, "Allowed: 'fit'"),
        (
            "diagnosis",
            {"picture": "gap", "output": "x"},
            "output can be chosen only for the picture 'record'",
        ),
        ("identification", {"picture": "responses", "record": "fit"}, "only for the picture 'bode'"),
        ("comparison", {"record": "scorre"}, "Did you mean 'score'"),
    ],
    indirect=["result"],
)
def test_what_is_not_there_to_be_drawn_is_told(result: Any, arguments: dict[str, str], message: str) -> None:
    with pytest.raises(rs.InputError, match=message):
        result.plot(**arguments)


@pytest.mark.parametrize("result", RESULTS, indirect=True)
def test_a_notebook_shows_title_and_table(result: Any) -> None:
    shown = result._repr_html_()
    assert result.title in shown
    assert "<table>" in shown
    assert "<script" not in shown
    assert "http" not in shown


@pytest.mark.parametrize("result", RESULTS, indirect=True)
def test_what_comes_from_data_cannot_become_markup(result: Any) -> None:
    hostile = replace(result, title="<script>alert('1')</script>")
    shown = hostile._repr_html_()
    assert "<script" not in shown
    assert "&lt;script&gt;" in shown


@pytest.mark.parametrize("result", RESULTS, indirect=True)
def test_a_console_shows_one_line(result: Any) -> None:
    assert "\n" not in repr(result)
    assert result.title in repr(result)
    assert len(repr(result)) < 200


@pytest.mark.slow
@pytest.mark.parametrize("result", RESULTS, indirect=True)
def test_saved_it_is_what_the_command_leaves(result: Any, tmp_path: Path) -> None:
    files = result.save(tmp_path / "out")
    names = {path.name for path in files}
    assert names == {path.name for path in (tmp_path / "out").iterdir()}
    (expected,) = (own for name, own in FILES.items() if f"{name}.json" in names)
    assert expected <= names


def test_campaign_record_and_model_are_one_line_each(campaign: rs.Campaign, diagnoser: rs.Diagnoser) -> None:
    assert repr(campaign) == "Campaign('Example stage', rig='axis', records=['fit', 'score'])"
    assert repr(campaign.records[0]) == (
        "Record('fit', 2000 samples of u, x, dt=0.005 s, role='estimation', kind='sweep')"
    )
    assert repr(diagnoser.model_) == "Model(rig='axis', effects=['cubic_stiffness'], hold='foh')"


@pytest.mark.slow
def test_a_page_quotes_what_made_it(diagnoser: rs.Diagnoser, tmp_path: Path) -> None:
    diagnoser.diagnosis_.save(tmp_path)
    page = unescape((tmp_path / "report.html").read_text("utf-8"))
    assert "rigsight.Diagnoser(effects=['cubic_stiffness', 'quadratic_damping'], seed=0).fit(...)" in page


@pytest.mark.slow
def test_a_result_that_a_workflow_returned_can_be_looked_at(axis_campaign: Path) -> None:
    found = run_diagnose(axis_campaign, effects=[effect_named("cubic_stiffness")], n_jobs=1)
    shown = rs.DiagnosisResult.of(found)
    assert shown.to_json() == found.to_json()
    assert isinstance(shown.plot(), Figure)


class TestTables:
    """What `to_dataframe` gives."""

    @pytest.fixture(autouse=True)
    def _needs_pandas(self) -> None:
        pytest.importorskip("pandas", reason="pandas, which tables are made with, is not installed")

    def test_candidates(self, diagnoser: rs.Diagnoser) -> None:
        table = diagnoser.diagnosis_.to_dataframe()
        assert list(table.columns) == ["effects", "probability", "error_over_noise", "nrmse_x", "converged"]
        assert list(table["effects"]) == [", ".join(c.effects) for c in diagnoser.diagnosis_.candidates]
        assert table.iloc[0]["effects"] == "cubic_stiffness"
        assert table["probability"].sum() <= 1.0 + 1e-12

    def test_gap(self, diagnoser: rs.Diagnoser) -> None:
        (row,) = diagnoser.diagnosis_.to_dataframe("gap").to_dict("records")
        gap = diagnoser.diagnosis_.gap["x"]
        assert row == {
            "output": "x", "before": gap.before, "reidentified": gap.reidentified, "after": gap.after,
            "noise_floor": gap.noise_floor, "closed": gap.closed,
        }  # fmt: skip

    def test_parameters(self, diagnoser: rs.Diagnoser) -> None:
        table = diagnoser.diagnosis_.to_dataframe("parameters").set_index("parameter")
        assert table.loc["k_3", "unit"] == "N/m^3"
        assert table.loc["k_3", "value"] == diagnoser.model_.values["k_3"]

    def test_numbers_of_records_and_of_all_together(self, identifier: rs.LinearIdentifier) -> None:
        found = identifier.identification_
        table = found.to_dataframe()
        assert list(table.columns) == ["record", "amplitude", "parameter", "value", "std", "unit"]
        assert set(table["record"]) == {"fit"}
        assert dict(zip(table["parameter"], table["value"], strict=True)) == {
            name: value for name, (value, _) in found.records[0].estimates.items()
        }
        joint = found.to_dataframe("joint").set_index("parameter")
        assert list(joint.index) == list(found.joint.names)
        assert joint.loc["m", "value"] == identifier.model_.values["m"]

    def test_equations(self, discoverer: rs.EquationDiscoverer) -> None:
        found = discoverer.discovery_
        numbers = found.to_dataframe().set_index("coefficient")
        assert numbers.loc["k_3", "value"] == discoverer.model_.values["k_3"]
        terms = found.to_dataframe("terms")
        assert list(terms["term"]) == [term.name for term in found.terms]
        others = found.to_dataframe("alternatives")
        assert len(others) == len(found.alternatives) > 1
        assert others["held_out"].idxmin() == 0

    def test_scores(self, comparison: rs.ComparisonResult) -> None:
        table = comparison.to_dataframe()
        assert len(table) == len(comparison.scores)
        free_run = table[table["quantity"] == "free_run_nrmse"].set_index(["model", "record"])["value"]
        assert free_run["diagnosed", "score"] < 0.01 * free_run["linear", "score"]
        assert np.isfinite(table["value"]).all()

    @pytest.mark.parametrize("result", ["diagnosis", "identification", "discovery"], indirect=True)
    def test_an_unknown_table_is_told(self, result: Any) -> None:
        with pytest.raises(rs.InputError, match="The table is 'nonsense'"):
            result.to_dataframe("nonsense")


@pytest.mark.parametrize("result", RESULTS, indirect=True)
def test_without_pandas_its_extra_is_named(result: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(rs.InputError, match=r'pip install "rigsight\[notebook\]"'):
        result.to_dataframe()

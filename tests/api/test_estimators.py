"""Do the estimators keep scikit-learn's promises, and do they find what the commands find?"""

from __future__ import annotations

import inspect
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.exceptions import NotFittedError

import rigsight as rs
from rigsight.effects import effect_named
from rigsight.workflow.compare import run_compare
from rigsight.workflow.diagnose import run_diagnose
from rigsight.workflow.discover import run_discover
from rigsight.workflow.identification.json import identification_json
from rigsight.workflow.identify import run_identify

ESTIMATORS = (rs.Diagnoser, rs.EquationDiscoverer, rs.LinearIdentifier)
OTHER: dict[str, Any] = {
    "effects": ["end_stop"], "seed": 7, "n_jobs": 3, "verbose": True, "method": "thesis",
    "one_by_one": True, "resolution": 0.5, "rig": "axis",
    "objective": "free-run", "initial_samples": 30,
}  # fmt: skip


def fitted_attributes(estimator: object) -> set[str]:
    return {name for name in vars(estimator) if name.endswith("_")}


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_the_constructor_only_keeps_its_settings(estimator: type) -> None:
    settings = {name: OTHER[name] for name in inspect.signature(estimator).parameters}
    made = estimator(**settings)
    assert vars(made) == settings
    assert made.get_params() == settings
    assert clone(made).get_params() == settings
    assert estimator().set_params(**settings).get_params() == settings
    with pytest.raises(ValueError, match="Invalid parameter 'nonsense'"):
        made.set_params(nonsense=1)


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_unfitted_it_predicts_nothing(estimator: type, campaign: rs.Campaign) -> None:
    with pytest.raises(NotFittedError, match=estimator.__name__):
        estimator().predict(campaign.records[0])


@pytest.mark.parametrize(
    "name",
    [
        "identifier",
        pytest.param("diagnoser", marks=pytest.mark.slow),
        pytest.param("discoverer", marks=pytest.mark.slow),
    ],
)
def test_fitting_leaves_a_result_and_a_model_that_predicts(
    name: str, campaign: rs.Campaign, request: pytest.FixtureRequest
) -> None:
    estimator = request.getfixturevalue(name)
    results = fitted_attributes(estimator) - {"model_"}
    assert len(results) == 1
    assert fitted_attributes(clone(estimator)) == set()
    predicted = estimator.predict(campaign.validation[0])
    assert isinstance(predicted, rs.Record)
    assert predicted.n_samples == campaign.validation[0].n_samples
    found = getattr(estimator, results.pop())
    assert estimator.model_.to_json() == dict(found.model)


def test_fit_returns_the_estimator_and_leaves_the_settings(campaign: rs.Campaign) -> None:
    estimator = rs.LinearIdentifier(n_jobs=1)
    assert estimator.fit(campaign) is estimator
    assert estimator.get_params() == {
        "effects": (),
        "method": "local_rational",
        "n_jobs": 1,
        "initial_samples": None,
        "objective": "windows",
        "resolution": None,
        "rig": None,
        "seed": 0,
        "verbose": False,
    }


def test_the_hidden_spring_is_found_and_predicts_down_to_the_noise(
    campaign: rs.Campaign,
    diagnoser: rs.Diagnoser,
    identifier: rs.LinearIdentifier,
    discoverer: rs.EquationDiscoverer,
) -> None:
    assert diagnoser.diagnosis_.effects == ("cubic_stiffness",)
    assert [term.name for term in discoverer.discovery_.kept] == ["cubic_stiffness"]
    k_3 = diagnoser.diagnosis_.candidates[0].parameters["k_3"]
    assert k_3.value == pytest.approx(5e6, abs=4.0 * k_3.std)
    measured = campaign.validation[0]
    left = {
        type(estimator).__name__: float(np.std(measured["x"] - estimator.predict(measured)["x"]))
        for estimator in (diagnoser, identifier, discoverer)
    }
    assert left["Diagnoser"] < 1.2 * 2e-5
    assert left["EquationDiscoverer"] < 1.2 * 2e-5
    assert left["LinearIdentifier"] > 100.0 * 2e-5


@pytest.mark.slow
def test_a_folder_gives_what_the_commands_give(axis_campaign: Path) -> None:
    few = ["cubic_stiffness"]
    for file in axis_campaign.glob("*.csv"):
        # Half a sweep passes the resonance.
        file.write_text("".join(file.read_text("utf-8").splitlines(keepends=True)[:1100]), "utf-8")
    diagnosed = rs.Diagnoser(effects=few, n_jobs=1).fit(axis_campaign).diagnosis_
    effects = [effect_named(name) for name in few]
    assert diagnosed.to_json() == run_diagnose(axis_campaign, effects=effects, n_jobs=1).to_json()

    identified = rs.LinearIdentifier("h1", n_jobs=1).fit(axis_campaign).identification_
    same = run_identify(axis_campaign, method="h1", n_jobs=1)
    assert identification_json(identified, {}) == identification_json(same, {})


@pytest.mark.slow
def test_a_discovery_of_a_folder_is_that_of_the_command(axis_campaign: Path) -> None:
    discovered = rs.EquationDiscoverer(seed=3, n_jobs=1).fit(str(axis_campaign)).discovery_
    assert discovered.to_json() == run_discover(axis_campaign, seed=3, n_jobs=1).to_json()


@pytest.mark.slow
def test_a_comparison_of_files_is_that_of_the_command(axis_campaign: Path, diagnoser: rs.Diagnoser) -> None:
    diagnoser.diagnosis_.save(axis_campaign / "found")
    models = [axis_campaign / "found"]
    mine = rs.compare_models(axis_campaign, models, n_jobs=1)
    assert mine.scores == run_compare(axis_campaign, models, n_jobs=1).scores
    by_name = rs.compare_models(axis_campaign, {"found": rs.read_model(models[0])}, n_jobs=1)
    assert by_name.scores == mine.scores


@pytest.mark.slow
def test_an_own_effect_competes_and_its_model_predicts(campaign: rs.Campaign) -> None:
    own = replace(effect_named("cubic_stiffness"), name="my_spring")
    diagnoser = rs.Diagnoser(effects=["quadratic_damping", own], n_jobs=1).fit(campaign)
    assert diagnoser.diagnosis_.effects == ("my_spring",)
    assert diagnoser.model_.structure.effect_names == ("my_spring",)
    assert diagnoser.predict(campaign.records[0]).n_samples == campaign.records[0].n_samples


def test_none_is_the_whole_catalogue(campaign: rs.Campaign, monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[str] = []

    def diagnose(*arguments: Any, **_: Any) -> None:
        tried.extend(effect.name for effect in arguments[1])
        raise rs.SimulationError("enough")

    monkeypatch.setattr("rigsight.api.estimators.diagnose_campaign", diagnose)
    with pytest.raises(rs.SimulationError):
        rs.Diagnoser(n_jobs=1).fit(campaign)
    assert tried == [effect.name for effect in rs.CATALOGUE]


@pytest.mark.parametrize(
    ("estimator", "message"),
    [
        (rs.Diagnoser(effects=["cubic"]), "Did you mean 'cubic_stiffness'"),
        (rs.Diagnoser(n_jobs=0), "number of jobs"),
        (rs.LinearIdentifier(method="local"), "The method is 'local'"),
        (rs.LinearIdentifier(resolution=-1.0), "resolution must be a positive number"),
    ],
    ids=lambda value: type(value).__name__,
)
def test_a_wrong_setting_is_told_when_it_is_used(estimator: Any, message: str, campaign: rs.Campaign) -> None:
    with pytest.raises(rs.InputError, match=message):
        estimator.fit(campaign)
    assert fitted_attributes(estimator) == set()


@pytest.mark.slow
def test_verbose_says_what_is_done(campaign: rs.Campaign, capfd: pytest.CaptureFixture[str]) -> None:
    rs.LinearIdentifier(n_jobs=1).fit(campaign)
    assert capfd.readouterr() == ("", "")
    rs.LinearIdentifier(n_jobs=1, verbose=True).fit(campaign)
    out, err = capfd.readouterr()
    assert out == ""
    assert "Identifying" in err


def test_results_are_data_that_json_takes(diagnoser: rs.Diagnoser) -> None:
    assert json.loads(json.dumps(diagnoser.diagnosis_.to_json()))["effects"] == ["cubic_stiffness"]

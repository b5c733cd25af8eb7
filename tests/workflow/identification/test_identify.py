"""The identification of whole campaigns: true numbers within their intervals, complete results."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.identify.identification import Identification
from rigsight.workflow.identify import run_identify
from rigsight.workflow.run.progress import Step
from rigsight.workflow.simulate import run_simulate

from ...tiers import slow_but
from ..virtual_campaign import CONSTANTS, NOISE, TRUTH, jump, sweep, write_campaign


@pytest.fixture(scope="module")
def linear_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("linear")
    runs = [
        sweep("low", 0.4),
        sweep("high", 0.9),
        jump("step", 0.6),
        sweep("check", 0.7, "validation"),
        sweep("beyond", 1.5, "validation"),
    ]
    return write_campaign(folder / "campaign", runs)


@pytest.fixture(scope="module")
def steps_told() -> list[Step]:
    return []


@pytest.fixture(scope="module")
def linear(linear_folder: Path, steps_told: list[Step]) -> Identification:
    return run_identify(linear_folder, linear_folder.parent / "out", n_jobs=1, listener=steps_told.append)


@pytest.fixture(scope="module")
def written(linear: Identification, linear_folder: Path) -> dict[str, Any]:
    return json.loads((linear_folder.parent / "out" / "identification.json").read_text("utf-8"))


def test_every_record_of_a_linear_rig_gives_the_truth_within_its_errors(linear: Identification) -> None:
    assert [r.record.name for r in linear.records] == ["low", "high", "step"]
    for record in linear.records:
        assert set(record.estimates) == set(TRUTH)
        for name, (value, error) in record.estimates.items():
            assert abs(value - TRUTH[name]) < 4.0 * error, (record.record.name, name)
        for name in ("J_z", "k_c", "k_d", "l_0", "c_y"):
            assert record.estimates[name][0] == pytest.approx(TRUTH[name], rel=0.01), (
                record.record.name,
                name,
            )


def test_the_joint_set_is_better_than_any_record_alone(linear: Identification) -> None:
    fit = linear.joint.fit.fit
    for name, value in TRUTH.items():
        assert abs(fit.values[name] - value) < 4.0 * fit.standard_errors[name], name
        assert fit.standard_errors[name] < min(r.estimates[name][1] for r in linear.records), name
    assert linear.joint.statement.startswith("One parameter set fits all 3")
    assert linear.joint.conicity is not None
    low, high = linear.joint.conicity.interval or (np.nan, np.nan)
    assert low < 0.024 < high
    assert linear.joint.pooled is None


def test_validation_records_are_scored_and_never_fitted(linear: Identification) -> None:
    scores = {s.record: s for s in linear.joint.scores if s.role == "validation"}
    assert set(scores) == {"check", "beyond"}
    assert {alone.kind for alone in linear.joint.fit.kinds} == {"low", "high", "step"}
    for score in scores.values():
        assert score.nrmse["psi"] < 0.01
        assert score.nrmse["y"] < 0.05


def test_a_validation_amplitude_outside_what_was_identified_is_told(linear: Identification) -> None:
    reported = [warning for warning in linear.warnings if "than in the fitted records" in warning]
    assert len(reported) == 1
    assert "'beyond'" in reported[0]
    assert "1.5 A" in reported[0]
    assert "0.4 to 0.9 A" in reported[0]


def test_a_linear_rig_does_not_change_with_the_amplitude(linear: Identification) -> None:
    assert linear.changing == ()
    assert linear.amplitude_statement.startswith("No parameter changes with the amplitude")


def test_the_resonance_is_seen_where_it_is(linear: Identification) -> None:
    damped = np.sqrt(TRUTH["k_c"] / TRUTH["J_z"] - 0.5 * (TRUTH["k_d"] / TRUTH["J_z"]) ** 2)
    for record in linear.records[:2]:
        assert record.resonance == pytest.approx(damped, rel=0.03)
    assert linear.records[2].resonance is None


def test_the_results_are_complete(
    linear: Identification, written: dict[str, Any], linear_folder: Path, steps_told: list[Step]
) -> None:
    out = linear_folder.parent / "out"
    figures = {"bode_low.svg", "bode_high.svg", "responses.svg", "amplitudes.svg"}
    files = {"identification.json", "identification.html", "model.json", *figures}
    assert {path.name for path in out.iterdir()} == files
    assert written["schema_version"] == 1
    assert set(written["figures"]) == figures
    for file in figures:
        assert (out / file).read_text().lstrip().startswith("<?xml")
    for row in written["amplitudes"]["table"]:
        assert {"record", "kind", "amplitude", "resonance", *TRUTH} == set(row)
        assert set(row["k_c"]) == {"value", "std", "unit"}
    record = written["records"][0]
    assert record["identified"]
    psi, y = record["paths"]
    assert (psi["fit"]["form"], y["fit"]["form"]) == ("PT2", "PT1")
    low, high = psi["physical"]["k_c"]["interval"]
    assert low < psi["physical"]["k_c"]["value"] < high
    response = psi["frequency_response"]
    assert len(response["omega"]) == len(response["real"]) == len(response["variance"])
    assert min(psi["coherence"]["values"]) >= 0.0
    assert "delta_0" in record["delta_0"]["statement"]
    assert written["joint"]["probability"] > 0.01
    assert steps_told[-1].done == steps_told[-1].total


def test_the_model_predicts_what_was_not_fitted(linear: Identification, linear_folder: Path) -> None:
    predicted = run_simulate(linear_folder.parent / "out", linear_folder / "check.csv")
    measured = np.genfromtxt(linear_folder / "check.csv", delimiter=",", names=True)
    assert np.std(predicted["psi"] - measured["psi"]) < 1.1 * NOISE
    assert np.std(predicted["y"] - measured["y"]) < 1.1 * NOISE


@pytest.fixture(scope="module")
def hardening(tmp_path_factory: pytest.TempPathFactory) -> Identification:
    runs = [sweep("low", 0.1), sweep("high", 1.0), jump("step", 0.6)]
    values = {**CONSTANTS, **TRUTH, "k_3": 4e5}
    return run_identify(
        write_campaign(tmp_path_factory.mktemp("hard"), runs, values=values, effect="cubic_stiffness")
    )


@pytest.mark.slow
def test_a_hardening_spring_is_seen_in_the_amplitudes(hardening: Identification) -> None:
    assert "k_c" in hardening.changing
    assert "k_c rises" in hardening.amplitude_statement
    assert "rigsight diagnose" in hardening.amplitude_statement
    assert not {"l_0", "c_y"} & set(hardening.changing)


@pytest.mark.slow
def test_no_set_serves_a_hardening_spring_and_its_lateral_part_stays_clean(hardening: Identification) -> None:
    joint = hardening.joint
    assert joint.statement.startswith("No single parameter set fits all 3")
    assert "The difference is largest for" in joint.statement
    # The lateral equation is linear all the same; a wrong yaw angle must not spoil its numbers.
    assert joint.pooled is not None
    for name in ("l_0", "c_y"):
        error = joint.pooled.standard_errors[name]
        assert abs(joint.pooled.values[name] - TRUTH[name]) < 4.0 * error
        assert hardening.model["parameters"][name] == joint.pooled.values[name]


@pytest.mark.slow
@pytest.mark.parametrize("method", slow_but("thesis", of=["local_polynomial", "h1", "thesis"]))
def test_every_method_comes_near_the_truth(method: str, linear_folder: Path) -> None:
    found = run_identify(linear_folder, method=method)
    record = found.records[1]
    assert record.motion.measured is not None
    expected = "thesis" if method == "thesis" else "H1" if method == "h1" else "local polynomial"
    assert record.motion.measured.method.startswith(expected)
    for name in ("J_z", "k_c"):
        assert record.estimates[name][0] == pytest.approx(TRUTH[name], rel=0.1), name


def test_an_unknown_method_and_a_senseless_resolution_are_refused(linear_folder: Path) -> None:
    with pytest.raises(InputError, match="Did you mean 'thesis'"):
        run_identify(linear_folder, method="thesi")
    with pytest.raises(InputError, match="positive number"):
        run_identify(linear_folder, resolution=-1.0)


@pytest.mark.slow
def test_nothing_half_written_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise OSError(28, "No space left on device")

    campaign = write_campaign(tmp_path / "c", [sweep("one", 0.5, seconds=12.0)])
    monkeypatch.setattr(Path, "write_bytes", broken)
    with pytest.raises(InputError, match="disk is full"):
        run_identify(campaign, tmp_path / "new" / "out")
    assert not (tmp_path / "new").exists()


@pytest.mark.slow
def test_records_of_like_names_get_figures_of_their_own(tmp_path: Path) -> None:
    campaign = write_campaign(
        tmp_path / "c", [sweep("one", 0.5, seconds=20.0), sweep("two", 0.4, seconds=20.0)]
    )
    toml = (campaign / "campaign.toml").read_text()
    toml = toml.replace('file = "one.csv"', 'file = "one.csv"\nname = "a b"')
    (campaign / "campaign.toml").write_text(
        toml.replace('file = "two.csv"', 'file = "two.csv"\nname = "A/B"')
    )
    run_identify(campaign, tmp_path / "out")
    assert (tmp_path / "out" / "bode_a_b.svg").is_file()
    assert (tmp_path / "out" / "bode_A_B_2.svg").is_file()

from __future__ import annotations

import json
import os
import shlex
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from rigsight.diagnose.result import Diagnosis
from rigsight.effects import effect_named
from rigsight.errors import InputError
from rigsight.identify.transfer.conicity import creep_factor
from rigsight.rigs import RUNNING_GEAR
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.compare import run_compare
from rigsight.workflow.diagnose import run_diagnose
from rigsight.workflow.run.kernels import structures_to_try
from rigsight.workflow.run.progress import Step
from rigsight.workflow.simulate import run_simulate

FEW = tuple(effect_named(name) for name in ("cubic_stiffness", "quadratic_damping"))
CONTRACT_KEYS = {
    "schema_version", "verdict", "effects", "where", "ambiguous_with", "candidates", "gap",
    "gap_by_record", "gap_by_band", "gap_by_amplitude", "gap_by_state",
}  # fmt: skip


@pytest.mark.slow
def test_a_missing_cubic_spring_is_found_and_written_as_the_contract_says(
    axis_campaign: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    steps: list[Step] = []
    diagnosis = run_diagnose(axis_campaign, out, effects=FEW, n_jobs=1, listener=steps.append)
    written = json.loads((out / "diagnosis.json").read_text())
    assert written == diagnosis.to_json()
    assert written.keys() >= CONTRACT_KEYS
    assert written["schema_version"] == 2
    assert (written["verdict"], written["effects"]) == ("effect", ["cubic_stiffness"])
    assert written["where"] == ["dynamics"]
    for later in ("gap_by_record", "gap_by_band", "gap_by_amplitude", "gap_by_state"):
        assert isinstance(written[later], list)
    assert set(written["gap"]) == {"x"}
    gap = written["gap"]["x"]
    assert set(gap) == {"before", "reidentified", "after", "noise_floor", "closed", "interval"}
    assert gap["after"] < 1.1 * gap["noise_floor"] < gap["reidentified"] < gap["before"]
    assert gap["closed"] == pytest.approx(
        (gap["before"] - gap["after"]) / (gap["before"] - gap["noise_floor"])
    )
    assert sum(candidate["probability"] for candidate in written["candidates"]) <= 1.0 + 1e-12
    for candidate in written["candidates"]:
        assert {"effects", "probability", "validation_nrmse", "parameters"} <= candidate.keys()
        for parameter in candidate["parameters"].values():
            assert set(parameter) == {"value", "std", "unit"}
    found = written["candidates"][0]["parameters"]["k_3"]
    assert found["unit"] == "N/m^3"
    assert found["value"] == pytest.approx(5e6, abs=4 * found["std"])
    assert "<html" in (out / "report.html").read_text("utf-8").lower()
    assert steps[-1].done == steps[-1].total


def test_a_given_simulation_that_cannot_be_run_is_told_with_its_records(axis_campaign: Path) -> None:
    file = axis_campaign / "campaign.toml"
    file.write_text(file.read_text("utf-8").replace("m = 2.0", "m = 2e-9"), "utf-8")
    with pytest.raises(InputError, match=r"motion in 'fit' \(sample time 0.005 s\).*Check the units"):
        run_diagnose(axis_campaign, effects=FEW[:1], n_jobs=1)


@pytest.mark.slow
def test_the_written_model_alone_predicts_what_the_diagnosis_did(axis_campaign: Path, tmp_path: Path) -> None:
    diagnosis = run_diagnose(axis_campaign, tmp_path, effects=FEW[:1], n_jobs=1)
    predicted = run_simulate(tmp_path / "model.json", axis_campaign / "score.csv")
    (trace,) = [trace for trace in diagnosis.traces if trace.record == "score"]
    # The diagnosis estimates initial states and integrates as accurately as the noise asks for, not as it can.
    assert np.std(predicted["x"] - trace.after["x"]) < 1e-2 * np.std(trace.measured["x"])
    gap = diagnosis.gap["x"]
    left = np.std(predicted["x"] - trace.measured["x"]) / np.std(trace.measured["x"])
    assert left == pytest.approx(gap.after, rel=0.1)


@pytest.mark.slow
def test_without_a_folder_nothing_is_written(
    axis_campaign: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    run_diagnose(axis_campaign, effects=FEW[:1], n_jobs=1)
    assert sorted(tmp_path.rglob("*")) == before


def test_conicity_becomes_the_creep_factor(tmp_path: Path, write_csv: Callable[..., Path]) -> None:
    write_csv()
    (tmp_path / "campaign.toml").write_text(
        '[rig]\nmodel = "running_gear"\n[rig.constants]\nv = 1.0\nr_0 = 0.1\nb = 0.3\nk_tau = 0.27\n'
        '[rig.parameters]\ndelta_0 = 0.024\n[[records]]\nfile = "sweep.csv"\n'
    )
    campaign = read_campaign(tmp_path)
    assert campaign.given == {"c_y": pytest.approx(creep_factor(0.024, 0.1, 0.3))}


def test_every_effect_that_the_rig_offers_is_compiled_by_itself_beforehand() -> None:
    as_modelled, pushed, *alone = structures_to_try(RUNNING_GEAR, FEW)
    assert as_modelled.effect_names == pushed.effect_names == ()
    assert len(pushed.rig.inputs) > len(as_modelled.rig.inputs)
    assert len(alone) == len(FEW)


DAMPER = ("bouc_wen_hysteresis", "coulomb_friction", "stribeck_friction")
NAMED = {
    "silverbox/campaign.toml": (
        {"cubic_stiffness"},
        ("asymmetric_stiffness", "coulomb_friction", "end_stop", "quadratic_damping"),
    ),
    "mr_damper/campaign_on.toml": (set(DAMPER), ("cubic_stiffness", "quadratic_damping")),
    "mr_damper/campaign_off.toml": (set(DAMPER), ("cubic_stiffness", "quadratic_damping")),
}
"""What may be named, and rivals; benchmarks/measured_gaps.py lets the whole catalogue compete."""


@pytest.fixture(scope="module")
def measured_gap(
    shared_data: Path, tmp_path_factory: pytest.TempPathFactory
) -> Callable[[str], tuple[Diagnosis, Path]]:
    """Return the diagnosis of a campaign and the folder of its results, made once for the tests that look at it."""

    @cache
    def diagnosed(campaign: str) -> tuple[Diagnosis, Path]:
        names, rivals = NAMED[campaign]
        out = tmp_path_factory.mktemp("measured")
        effects = [effect_named(name) for name in sorted({*names, *rivals})]
        return run_diagnose(shared_data / campaign, out, effects=effects), out

    return diagnosed


@pytest.mark.slow
@pytest.mark.parametrize("campaign", NAMED)
def test_measured_gaps_are_named(
    campaign: str, measured_gap: Callable[[str], tuple[Diagnosis, Path]]
) -> None:
    names, _ = NAMED[campaign]
    diagnosis, _ = measured_gap(campaign)
    assert diagnosis.verdict == "effect"
    assert names.intersection(diagnosis.effects)
    (gap,) = diagnosis.gap.values()
    assert gap.after <= 0.5 * gap.reidentified


@pytest.mark.slow
def test_the_silverbox_is_predicted_in_free_run(
    shared_data: Path, measured_gap: Callable[[str], tuple[Diagnosis, Path]]
) -> None:
    _, results = measured_gap("silverbox/campaign.toml")
    file = shared_data / "silverbox" / "multisine_validation.csv"
    predicted = run_simulate(results, file, initial_state="estimated")
    measured = np.genfromtxt(file, delimiter=",", names=True)["x"]
    assert np.sqrt(np.mean((predicted["x"] - measured) ** 2)) <= 0.40e-3
    # From rest, the record's own first transient is missing; it has died out after 500 samples.
    from_rest = run_simulate(results, file)
    assert np.sqrt(np.mean((from_rest["x"] - measured)[500:] ** 2)) <= 0.40e-3


@pytest.mark.slow
def test_the_hysteresis_benchmark_reaches_its_noise(shared_data: Path) -> None:
    rivals = ("bouc_wen_hysteresis", "coulomb_friction", "cubic_stiffness", "iwan_hysteresis")
    diagnosis = run_diagnose(shared_data / "boucwen", effects=[effect_named(name) for name in rivals])
    assert diagnosis.effects == ("bouc_wen_hysteresis",)
    (trace,) = [trace for trace in diagnosis.traces if trace.role == "validation"]
    assert np.std(trace.measured["x"] - trace.after["x"]) <= 1.05 * 7.4e-6
    values = diagnosis.model["parameters"] | diagnosis.model["effect_parameters"]
    # The generator writes k y + z with z' = alpha y' - beta (gamma |y'| z + delta y' |z|): ours is z / alpha.
    assert values["k"] == pytest.approx(5e4 + 5e4, rel=0.02)
    assert (1.0 - values["a"]) * values["k"] == pytest.approx(5e4, rel=0.02)
    assert values["beta"] == pytest.approx(1e3 * 0.8, rel=0.02)
    assert values["gamma"] == pytest.approx(1e3 * -1.1, rel=0.02)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="names of files are text elsewhere")
def test_a_folder_whose_name_is_no_text_is_diagnosed_and_compared(
    axis_campaign: Path, write_model: Callable[..., Path], tmp_path: Path
) -> None:
    odd = axis_campaign.rename(tmp_path / os.fsdecode(b"M\xe4rz"))
    toml = odd / "campaign.toml"
    toml.write_text(
        "".join(line for line in toml.read_text().splitlines(True) if not line.startswith("title"))
    )
    out = tmp_path / "out"
    command = shlex.join(["rigsight", "diagnose", str(odd)])
    diagnosis = run_diagnose(odd, out, effects=FEW[:1], n_jobs=1, command=command)
    assert diagnosis.title == "M\ufffdrz"
    assert json.loads((out / "diagnosis.json").read_text())["title"] == "M\ufffdrz"
    assert "M\ufffdrz" in (out / "report.html").read_text()
    comparison = run_compare(odd, [write_model()], out, n_jobs=1, command=command)
    assert comparison.title == "M\ufffdrz"

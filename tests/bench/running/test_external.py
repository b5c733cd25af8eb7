"""A lab hides its own effect: its key says little, is checked before any work, and stays unseen."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from rigsight.errors import InputError
from rigsight_bench import benches
from rigsight_bench.benches import run_blind, run_external
from rigsight_bench.running.external import ExternalBench
from rigsight_bench.running.files import RUN_FILE, read_json
from rigsight_bench.running.scoring import score_trial
from rigsight_bench.running.trial import diagnose_trial
from rigsight_bench.trial_process import START

NAME = "hardening spring no. 3"
"""A label that tells the effect, in a folder's name that is no number."""
KEY: dict[str, Any] = {"kind": "single", "effects": ["cubic_stiffness"]}
TELLS_ALL = """
import json, os, sys
os.makedirs("results")
files = [os.path.join(folder, file) for folder, _, names in os.walk(".") for file in names]
json.dump([dict(os.environ), sys.argv, os.getcwd(), sorted(files)], open("results/seen.json", "w"))
"""
DIAGNOSIS: dict[str, Any] = {
    "verdict": "effect", "effects": ["cubic_stiffness"], "where": ["dynamics"], "ambiguous_with": [],
    "candidates": [
        {"effects": ["cubic_stiffness"], "probability": 0.97, "parameters": {"k_3": {"value": 5.1e6, "std": 5e4}}}
    ],
    "gap": {"x": {"reidentified": 0.2, "noise_floor": 0.02}},
    "noise_floor": {"x": {"std": 2e-5}},
}  # fmt: skip
"""What `diagnosis.json` says, as far as a score reads it."""


@pytest.fixture
def lab(tmp_path: Path, axis_campaign: Path) -> ExternalBench:
    """A bench of one campaign, whose sweep of the smaller amplitude is the withheld record as well."""
    bench = ExternalBench(tmp_path / "out", tmp_path / "campaigns", tmp_path / "sealed")
    bench.campaigns.mkdir()
    bench.sealed.mkdir()
    shutil.copy(axis_campaign / "score.csv", bench.sealed / "withheld.csv")
    axis_campaign.rename(bench.campaign(NAME))
    write_key(bench)
    return bench


def write_key(bench: ExternalBench, **changes: Any) -> None:
    bench.key(NAME).write_text(json.dumps(KEY | changes), encoding="utf-8")


@pytest.fixture
def diagnosed(lab: ExternalBench, write_model: Callable[..., Path]) -> ExternalBench:
    """The bench after a diagnosis that named the true effect."""
    result = lab.result(NAME)
    result.mkdir(parents=True)
    shutil.copy(write_model(), result / "model.json")
    (result / "diagnosis.json").write_text(json.dumps(DIAGNOSIS))
    about = {"seconds": 7.0, "message": "", "fingerprint": lab.fingerprint(NAME)}
    (result / RUN_FILE).write_text(json.dumps(about))
    return lab


def test_a_key_of_two_words_is_enough(diagnosed: ExternalBench) -> None:
    found = score_trial(diagnosed, NAME)
    assert (found.trial, found.kind, found.right, found.place_right) == (NAME, "single", True, True)
    # The gap is the diagnosis' own; nothing is known of withheld records and true numbers.
    assert (found.gap, found.tier, found.noise) == (pytest.approx(10.0), "clear", "not stated")
    assert (found.held_out, found.withheld, found.parameters) == (None, (), ())


def test_a_true_model_leaves_the_noise_of_a_withheld_record(diagnosed: ExternalBench) -> None:
    write_key(
        diagnosed,
        withheld=[{"file": "withheld.csv", "kind": "sweep", "amplitude": 3.0}],
        parameters={"k_3": 5e6},
        gap=33.0,
    )
    found = score_trial(diagnosed, NAME)
    # The RMS of 2,000 samples of white noise scatters by 1.6 %.
    assert found.held_out == pytest.approx(1.0, abs=0.06)
    assert [(w.name, w.kind, w.amplitude, w.n_samples) for w in found.withheld] == [
        ("withheld", "sweep", 3.0, 2000)
    ]
    assert [(e.name, e.error) for e in found.parameters] == [("k_3", pytest.approx(2.0))]
    assert (found.gap, found.tier) == (33.0, "strong")


def test_a_floor_in_the_key_goes_before_that_of_the_diagnosis(diagnosed: ExternalBench) -> None:
    write_key(diagnosed, withheld=[{"file": "withheld.csv"}], noise_floor={"x": 4e-5})
    assert score_trial(diagnosed, NAME).held_out == pytest.approx(0.5, abs=0.03)


def test_an_amplitude_that_is_not_stated_is_the_peak_of_the_input(diagnosed: ExternalBench) -> None:
    write_key(diagnosed, withheld=[{"file": "withheld.csv"}])
    (found,) = score_trial(diagnosed, NAME).withheld
    assert found.amplitude == pytest.approx(3.0, rel=1e-3)


def test_a_diagnosis_that_failed_is_scored_as_wrong(diagnosed: ExternalBench) -> None:
    (diagnosed.result(NAME) / RUN_FILE).write_text(json.dumps({"seconds": 1.0, "message": "no good"}))
    write_key(diagnosed, withheld=[{"file": "withheld.csv"}])
    found = score_trial(diagnosed, NAME)
    assert (found.verdict, found.right, found.gap, found.tier) == ("failed", False, None, "not measured")
    assert (found.held_out, found.withheld[0].error) == (None, None)


def test_the_process_that_diagnoses_is_not_told_the_campaigns_name(lab: ExternalBench) -> None:
    diagnose_trial(lab, NAME, start=("-c", TELLS_ALL))
    text = (lab.result(NAME) / "seen.json").read_text()
    for secret in (NAME, "hardening", "sealed", "campaigns", "withheld"):
        assert secret not in text


@pytest.mark.parametrize("change", ["key", "campaign", "withheld"])
def test_what_has_changed_is_another_trial(diagnosed: ExternalBench, change: str) -> None:
    write_key(diagnosed, withheld=[{"file": "withheld.csv"}])
    before = diagnosed.fingerprint(NAME)
    assert diagnosed.fingerprint(NAME) == before
    file = {
        "key": diagnosed.key(NAME),
        "campaign": diagnosed.campaign(NAME) / "fit.csv",
        "withheld": diagnosed.sealed / "withheld.csv",
    }[change]
    file.write_text(file.read_text() + "\n")
    assert diagnosed.fingerprint(NAME) != before
    assert not diagnosed.diagnosed(NAME)


def run(bench: ExternalBench, **more: Any) -> dict[str, Any]:
    return run_external(bench.campaigns, bench.sealed, bench.path, start=START, n_jobs=1, **more)


def test_a_campaign_is_done_once_and_again_when_it_has_changed(
    lab: ExternalBench, diagnosed: ExternalBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[str] = []

    def diagnose(folder: ExternalBench, name: str, start: Sequence[str]) -> None:
        done.append(name)
        file = folder.result(name) / RUN_FILE
        file.write_text(json.dumps({**read_json(file), "fingerprint": folder.fingerprint(name)}))

    monkeypatch.setattr(benches, "diagnose_trial", diagnose)
    content = run(lab)
    assert [t["trial"] for t in content["trials"]] == [NAME]
    assert run(lab)["n_trials"] == 1
    assert done == [NAME]
    write_key(lab, kind="single", effects=["quadratic_damping"])
    content = run(lab)
    assert done == [NAME, NAME]
    assert [t["right"] for t in content["trials"]] == [False]
    again = content["wrong"][0]["again"]
    assert f"--trial '{NAME}'" in again
    assert f"--campaigns {lab.campaigns}" in again


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"kind": "singel"}, ["kind", "'singel'", "Did you mean 'single'", "'outside'"]),
        ({"effects": ["cubic_stifness"]}, ["effects", "Did you mean 'cubic_stiffness'", "outside"]),
        ({"effects": []}, ["effects", "an empty list", "exactly one effect"]),
        ({"kind": "pair"}, ["effects", "cubic_stiffness", "exactly two"]),
        ({"kind": "pair", "effects": ["backlash", "backlash"]}, ["exactly two"]),
        ({"kind": "triple", "effects": ["backlash", "input_delay"]}, ["exactly three"]),
        ({"kind": "none"}, ["effects", "an empty list"]),
        ({"kind": "outside"}, ["effects", "not in the catalogue"]),
        ({"effects": ["conicity_variation"]}, ["conicity_variation", "axis"]),
        ({"parameter": {}}, ["parameter", "unknown key", "Did you mean 'parameters'"]),
        ({"parameters": {"k_33": 1.0}}, ["parameters.k_33", "Did you mean 'k_3'"]),
        ({"parameters": {"k_3": "5e6"}}, ["parameters.k_3", "must be a number", "'5e6'"]),
        ({"noise_floor": {"y": 1.0}}, ["noise_floor.y", "Known: x"]),
        ({"noise_floor": {"x": 0.0}}, ["noise_floor.x", "greater than 0", "0"]),
        ({"where": ["dynamic"]}, ["where", "Did you mean 'dynamics'"]),
        ({"gap": -1.0}, ["gap", "-1.0"]),
        ({"withheld": [{"file": "gone.csv"}]}, ["record 1", "gone.csv", "does not exist"]),
        ({"withheld": [{"file": "../campaigns/x.csv"}]}, ["record 1", "lies outside"]),
        ({"withheld": [{"file": "withheld.csv", "kind": "wobble"}]}, ["record 1 (withheld.csv)", "kind", "'wobble'"]),
        ({"withheld": [{"name": "a"}]}, ["record 1", "file", "is missing"]),
    ],
)  # fmt: skip
def test_a_key_that_cannot_be_used_is_told_before_any_work(
    lab: ExternalBench, changes: dict[str, Any], words: list[str]
) -> None:
    write_key(lab, **changes)
    with pytest.raises(InputError) as told:
        run(lab)
    for word in [f"{NAME}.json", *words]:
        assert word in str(told.value)
    assert not lab.path.exists()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('{"kind": "single",\n "effects": [backlash]}', [", line 2, column 14", "The smallest key"]),
        ('["backlash"]', ["must contain one object", '"kind": "single"']),
        ('{"effects": []}', ["kind", "is missing"]),
        ('{"kind": "none", "kind": "single", "effects": []}', ["'kind' occurs twice"]),
    ],
)
def test_a_key_that_is_no_key_is_told(lab: ExternalBench, text: str, words: list[str]) -> None:
    lab.key(NAME).write_text(text)
    with pytest.raises(InputError) as told:
        lab.names()
    for word in [f"{NAME}.json", *words]:
        assert word in str(told.value)


TRAIN = """
[rig]
model = "drive_train"
[[records]]
file = "score.csv"
"""


def test_on_a_rig_with_several_places_a_key_says_that_of_each_effect(lab: ExternalBench) -> None:
    (lab.campaign(NAME) / "campaign.toml").write_text(TRAIN, encoding="utf-8")
    twice = ["coulomb_friction", "coulomb_friction"]
    there = ["load_bearing", "motor_bearing"]
    write_key(
        lab, kind="pair", effects=twice, where=there, parameters={"coulomb_friction@load_bearing.T_c": 1e-3}
    )
    key = lab.read_key(NAME)
    assert (key["effects"], key["where"], key["schema_version"]) == (twice, there, 2)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({}, ["where", "several places", "1 of", "shaft"]),
        ({"where": ["motor"]}, ["where", "'motor'", "shaft"]),
        ({"where": ["shaft", "motor_bearing"]}, ["where", "several places"]),
        (
            {"effects": ["backlash"], "where": ["motor_bearing"]},
            ["backlash@motor_bearing", "does not apply"],
        ),
        ({"kind": "pair", "effects": ["backlash"] * 2, "where": ["shaft"] * 2}, ["exactly two"]),
    ],
)
def test_a_place_at_which_an_effect_cannot_be_is_told(
    lab: ExternalBench, changes: dict[str, Any], words: list[str]
) -> None:
    (lab.campaign(NAME) / "campaign.toml").write_text(TRAIN, encoding="utf-8")
    write_key(lab, **changes)
    with pytest.raises(InputError) as told:
        lab.read_key(NAME)
    assert all(word in str(told.value) for word in words)


def test_folders_that_cannot_be_a_bench_are_told(lab: ExternalBench) -> None:
    with pytest.raises(InputError, match=r"not a folder.*--campaigns"):
        replace(lab, campaigns=lab.path / "gone").names()
    with pytest.raises(InputError, match=r"No folder in .* contains a campaign\.toml"):
        replace(lab, campaigns=lab.sealed).names()
    with pytest.raises(InputError, match="no campaign 'spring'"):
        run(lab, only=["spring"])
    lab.key(NAME).unlink()
    with pytest.raises(InputError, match=rf"Keys of 1 of 1 campaigns are missing in .*: {NAME}\.json"):
        lab.names()


def test_keys_inside_a_campaign_are_refused(lab: ExternalBench) -> None:
    inside = lab.campaign(NAME) / "keys"
    shutil.copytree(lab.sealed, inside)
    with pytest.raises(InputError, match="could read them"):
        replace(lab, sealed=inside).names()


def test_a_drawn_bench_and_one_of_a_lab_do_not_share_a_folder(lab: ExternalBench) -> None:
    lab.settle_here()
    lab.settle_here()
    with pytest.raises(InputError, match="existing campaigns"):
        run_blind(lab.path, start=START, design="standard", trials=1)
    other = replace(lab, path=lab.path.parent / "drawn")
    (other.path / "keys").mkdir(parents=True)
    other.settings.write_text(json.dumps({"design": "standard", "seed": 3}))
    with pytest.raises(InputError, match="seed 3"):
        other.settle_here()


@pytest.mark.slow
def test_a_lab_hides_its_effect_and_finds_it_named(lab: ExternalBench) -> None:
    # The first half of each sweep passes the resonance, and the whole catalogue is tried on it.
    for file in (*lab.campaign(NAME).glob("*.csv"), lab.sealed / "withheld.csv"):
        lines = file.read_text().splitlines(keepends=True)
        file.write_text("".join(lines[:1100]))
    write_key(lab, withheld=[{"file": "withheld.csv", "kind": "sweep"}], parameters={"k_3": 5e6, "m": 2.0})
    content = run(lab)
    (found,) = content["trials"]
    assert found["verdict"] == "effect"
    assert found["right"]
    assert found["held_out"] == pytest.approx(1.0, abs=0.1)
    assert {e["name"] for e in found["parameters"]} == {"k_3", "m"}
    assert (lab.path / "blind.html").is_file()
    assert sorted(p.name for p in lab.sealed.iterdir()) == sorted([f"{NAME}.json", "withheld.csv"])

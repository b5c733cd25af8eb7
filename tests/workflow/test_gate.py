"""The gate is open for true records and closed for changed ones, and says where; its exit code is that of its result."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from rigsight.excitation import linear_sweep
from rigsight.records import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate
from rigsight.simulate.model import Model
from rigsight.workflow.campaign.model_file import read_model
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.gate import run_gate
from rigsight.workflow.gating import of_records

Run = Callable[..., tuple[int, str, str]]
VALUES = {"gain": 1.0, "m": 2.0, "d": 5.0, "k": 800.0, "x_off": 0.0, "force_off": 0.0}


def write_record(file: Path, seed: int, header: str = "t,u,x", scale: float = 1.0, **changed: float) -> Path:
    """Write a sweep of a stage with noise, whose last column may be in another unit."""
    rng, t = np.random.default_rng(seed), 0.01 * np.arange(1000)
    u = linear_sweep(t, 2.0 + 0.5 * rng.random(), 3.0, 50.0)
    moved = simulate(compose(AXIS), {**VALUES, **changed}, Record("r", 0.01, {"u": u}, {}))
    x = scale * (moved["x"] + rng.normal(0.0, 3e-4, t.size))
    np.savetxt(file, np.column_stack([t, u, x]), delimiter=",", header=header, comments="")
    return file


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model, the campaign for which it holds, and further records."""
    place = tmp_path_factory.mktemp("gate")
    (place / "known").mkdir()
    text = '[rig]\nmodel = "axis"\nparameters = { m = 2.0, d = 5.0, k = 800.0 }\n'
    for i in range(5):
        write_record(place / f"known/{i}.csv", i)
        text += f'[[records]]\nfile = "{i}.csv"\nrole = "{"validation" if i > 2 else "estimation"}"\n'
    (place / "known/campaign.toml").write_text(text)
    model = Model.of(compose(AXIS), VALUES, "foh")
    (place / "model.json").write_text(json.dumps(model.to_json()))
    write_record(place / "true.csv", 10)
    write_record(place / "soft.csv", 11, k=760.0)
    return place


def of_gate(folder: Path, records: Sequence[str], out: Path, **options: Any) -> dict[str, Any]:
    run_gate(folder / "model.json", [folder / name for name in records], out, **options)
    return dict(json.loads((out / "gate.json").read_text()))


def test_a_true_record_passes_and_a_changed_one_is_refused_with_its_place(
    folder: Path, tmp_path: Path, run: Run
) -> None:
    base = ["gate", folder / "model.json", folder / "true.csv"]
    options = ["--campaign", folder / "known", "--out", tmp_path, "--junit", tmp_path / "deep/gate.xml"]
    code, out, _ = run(*base, *options)
    assert (code, "open" in out) == (0, True)
    code, out, _ = run(*base, folder / "soft.csv", *options)
    assert (code, "closed" in out) == (1, True)
    found = json.loads((tmp_path / "gate.json").read_text())
    assert found["schema_version"] == 1
    assert [check["closed"] for check in found["checks"]] == [False, True]
    assert (found["examined"], found["place"]) == ("soft", "dynamics")
    assert found["first_suspect"]["what"] == "k"
    assert found["first_suspect"]["after"] == pytest.approx(760.0, rel=0.01)
    suite = ET.parse(tmp_path / "deep/gate.xml").getroot()
    refused = {own.attrib["name"]: own.find("failure") is not None for own in suite.iter("testcase")}
    assert refused == {"true: x": False, "soft: x": True, "true: numbers": False, "soft: numbers": True}
    assert suite.attrib["failures"] == "2"


def test_the_xml_does_not_replace_the_results(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"gate\.json is a file that this run reads or writes"):
        of_gate(folder, ["true.csv"], tmp_path, floors=3.0, junit=tmp_path / "gate.json")


def test_a_change_below_the_usual_gap_shows_in_the_numbers(folder: Path, tmp_path: Path) -> None:
    write_record(folder / "softer.csv", 12, k=797.0)
    found = of_gate(folder, ["softer.csv"], tmp_path, campaign=folder / "known")
    assert found["closed"]
    assert not any(check["closed"] for check in found["checks"])
    assert "k" in {own["name"] for own in found["numbers"] if own["closed"]}


def test_a_record_at_rest_passes_without_a_number(folder: Path, tmp_path: Path) -> None:
    x = np.random.default_rng(20).normal(0.0, 3e-4, 1000)
    rows = np.column_stack([0.01 * np.arange(1000), np.zeros(1000), x])
    np.savetxt(tmp_path / "rest.csv", rows, delimiter=",", header="t,u,x", comments="")
    found = of_gate(folder, [str(tmp_path / "rest.csv")], tmp_path, campaign=folder / "known")
    assert (found["closed"], found["numbers"], found["suspects"]) == (False, [], [])
    assert any("nothing moves more than its noise" in note for note in found["notes"])


def test_what_reading_noted_of_a_record_is_told(folder: Path, tmp_path: Path, run: Run) -> None:
    rows = np.loadtxt(folder / "true.csv", delimiter=",", skiprows=1)[:, [0, 2]]
    np.savetxt(tmp_path / "undriven.csv", rows, delimiter=",", header="t,x", comments="")
    base = ["gate", folder / "model.json", tmp_path / "undriven.csv", "--campaign", folder / "known"]
    code, out, _ = run(*base, "--out", tmp_path)
    told = "undriven.csv: has no column for u; taken as 0 throughout, because nothing drives the rig."
    assert json.loads((tmp_path / "gate.json").read_text())["notes"][0] == told
    assert (code, told in " ".join(out.split())) == (1, True)


def test_limits_that_are_asked_for_replace_the_usual_one(folder: Path, tmp_path: Path) -> None:
    gap = of_gate(folder, ["soft.csv"], tmp_path, floors=1e4)["checks"][0]
    assert not gap["closed"]
    assert gap["gap_in_floors"] == pytest.approx(gap["gap"] / gap["noise_floor"])
    micrometers = 1e6 * gap["gap"]
    for factor, blank, closed in ((1.01, " ", False), (0.99, "", True)):
        asked = [f"x = {factor * micrometers:e}{blank}um"]
        found = of_gate(folder, ["soft.csv"], tmp_path, limits=asked, campaign=folder / "known")
        assert found["closed"] is closed
        assert found["checks"][0]["p_value"] is None
        assert found["numbers"] == []


def test_what_a_diagnosis_wrote_is_as_good_as_its_records(folder: Path, tmp_path: Path) -> None:
    model = read_model(folder / "model.json")
    records = read_campaign(folder / "known").records
    known = of_records(model, records, are_known=True)
    twin = tmp_path / "twin"
    twin.mkdir()
    (twin / "model.json").write_text((folder / "model.json").read_text())
    content = {
        "rig": "axis",
        "noise_floor": {name: {"std": std} for name, std in known.floors.items()},
        "gap_by_record": [{**vars(gap), "measured_rms": gap.moved} for gap in known.known],
        "numbers_by_record": [
            {"record": record.name, **vars(own)}
            for record, numbers in zip(records, known.numbers, strict=True)
            for own in numbers
        ],
        "window": known.window,
    }
    (twin / "diagnosis.json").write_text(json.dumps(content))
    run_gate(twin, [folder / "true.csv"], tmp_path / "by_diagnosis")
    by_records = of_gate(folder, ["true.csv"], tmp_path / "by_records", campaign=folder / "known")
    assert json.loads((tmp_path / "by_diagnosis/gate.json").read_text()) == by_records
    del content["numbers_by_record"]
    (twin / "diagnosis.json").write_text(json.dumps(content))
    with pytest.raises(ValueError, match=r"numbers_by_record: field required.*Run 'rigsight diagnose' again"):
        run_gate(twin, [folder / "true.csv"])


def test_files_are_read_as_the_campaign_reads_its_own(folder: Path, tmp_path: Path) -> None:
    campaign = tmp_path / "known"
    campaign.mkdir()
    text = '[rig]\nmodel = "axis"\nparameters = { m = 2.0, d = 5.0, k = 800.0 }\n'
    for i in range(3):
        write_record(campaign / f"{i}.csv", i, "time,force,way", 1e3)
        text += f'[[records]]\nfile = "{i}.csv"\nname = "known {i}"\nend = 8.0\n'
        text += '[records.columns]\nt = "time"\nu = "force"\nx = { name = "way", unit = "mm" }\n'
    (campaign / "campaign.toml").write_text(text)
    new = write_record(tmp_path / "new.csv", 10, "time,force,way", 1e3)
    found = of_gate(folder, [str(new)], tmp_path, campaign=campaign)
    same = of_gate(folder, ["true.csv"], tmp_path, floors=3.0)
    assert not found["closed"]
    assert [check["record"] for check in found["checks"]] == ["new"]
    assert found["checks"][0]["gap"] == pytest.approx(same["checks"][0]["gap"], rel=1e-6)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["gone.csv", "--floors", "3"], "gone.csv does not exist"),
        (["true.csv"], "Nothing is known of the gaps"),
        (["true.csv", "--floors", "0"], "positive"),
        (["true.csv", "--limit", "y=1 mm"], "no sensor 'y'"),
        (["true.csv", "--limit", "x=1 kg"], "Write it in m"),
        (["true.csv", "--limit", "x"], "SENSOR=VALUE UNIT"),
        (["true.csv", "--limit", "x=wide"], "not a number"),
        (
            ["true.csv", "--limit", "x=1 m", "--limit", "x=1 um"],
            "--limit 'x=1 um': 'x' is limited twice; give one value.",
        ),
        (["true.csv", "--limit", "x=1,5 mm"], "'1,5' is not a number"),
        (["true.csv", "--floors", "3", "--junit", "true.csv"], "another name"),
        (["true.csv", "--campaign", "gone"], "gone does not exist"),
        (["model.json", "--floors", "3"], "model.json"),
    ],
)
def test_what_cannot_be_used_is_told_and_nothing_written(
    arguments: list[str], told: str, folder: Path, tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    before = sorted(folder.rglob("*"))
    code, out, err = run("gate", "model.json", *arguments, "--out", tmp_path / "out")
    assert (code, out, told in err) == (2, "", True), err
    assert not (tmp_path / "out").exists()
    assert sorted(folder.rglob("*")) == before

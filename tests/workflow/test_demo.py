from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from rigsight.effects import CATALOGUE, effect_named
from rigsight.rigs.published import published_sets
from rigsight.workflow import demo
from rigsight.workflow.campaign.read_campaign import read_campaign

# What comes nearest to the hidden effect, of all that the demo tries: the others leave as much as the given simulation.
RIVALS = (
    "bouc_wen_hysteresis",
    "maxwell_branch",
    "power_law_stiffness",
    "presliding_friction",
)


@pytest.fixture
def campaign_only(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """The campaign of the demo, without its diagnosis."""
    monkeypatch.setattr(demo, "diagnose_campaign", lambda *arguments: arguments[-1](None))
    monkeypatch.setattr(demo, "result_files", lambda *_, **__: {})
    monkeypatch.setattr(demo, "prepare_kernels", lambda *_, **__: None)
    demo.run_demo(tmp_path / "demo", seed=1)
    return tmp_path / "demo" / "campaign"


def test_the_campaign_is_one_that_a_measurement_would_leave(campaign_only: Path) -> None:
    read = read_campaign(campaign_only)
    assert {(r.kind, r.amplitude, r.role) for r in read.records} == {
        ("sweep", 0.25, "estimation"),
        ("sweep", 0.5, "estimation"),
        ("sweep", 0.75, "validation"),
        ("sweep", 1.0, "estimation"),
        ("step", 0.6, "validation"),
    }
    assert [note for record in read.records for note in record.notes] == []
    given = published_sets()["identified"]
    assert read.parameters["k_c"] == given.parameters["k_c"]
    assert read.parameters["delta_0"] == given.given["delta_0"]
    (step,) = [record for record in read.records if record.kind == "step"]
    quiet = step["psi"][step["u"] == 0.0]
    assert np.std(quiet) == pytest.approx(2e-5, rel=0.1)


def test_the_demo_tries_the_whole_catalogue(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    tried: list[object] = []
    monkeypatch.setattr(demo, "diagnose_campaign", lambda *arguments: tried.append(arguments[1]))
    monkeypatch.setattr(demo, "prepare_kernels", lambda *_, **__: None)
    demo.run_demo(tmp_path / "demo")
    assert tried == [CATALOGUE]


def test_the_campaign_does_not_tell_what_is_hidden(campaign_only: Path) -> None:
    for file in campaign_only.iterdir():
        text = file.read_text()
        for secret in ("iwan", "hysteresis", "x_s", "2318", "0.0184"):
            if file.suffix == ".toml":
                assert secret not in text.lower()
    table = tomllib.loads((campaign_only / "campaign.toml").read_text())
    assert set(table["rig"]) == {"model", "effects", "constants", "parameters"}
    assert demo.HIDDEN_EFFECT not in table["rig"]["effects"]


def test_a_failed_diagnosis_leaves_no_campaign_behind_and_an_earlier_one_alone(
    campaign_only: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(demo, "diagnose_campaign", interrupted)
    earlier = {path: path.read_bytes() for path in campaign_only.iterdir()}
    for name in ("demo", "new"):
        with pytest.raises(KeyboardInterrupt):
            demo.run_demo(tmp_path / name, seed=2)
    assert [path.name for path in tmp_path.iterdir()] == ["demo"]
    assert {path: path.read_bytes() for path in campaign_only.iterdir()} == earlier


@pytest.mark.slow
def test_the_demo_finds_the_hidden_hysteresis_down_to_the_noise(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(demo, "CATALOGUE", (effect_named(demo.HIDDEN_EFFECT), *map(effect_named, RIVALS)))
    diagnosis = demo.run_demo(tmp_path / "demo")
    assert (diagnosis.verdict, diagnosis.effects) == ("effect", (demo.HIDDEN_EFFECT,))
    # In motion the torque disturbance adds to the noise that was seen at rest.
    assert len(diagnosis.candidates) > len(RIVALS)
    for gap in diagnosis.gap.values():
        assert gap.after <= 1.25 * gap.noise_floor
    written = {path.name for path in (tmp_path / "demo").iterdir()}
    assert written == {"campaign", "diagnosis.json", "model.json", "report.html"}

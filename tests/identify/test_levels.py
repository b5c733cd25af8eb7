"""A rig without inertia: levels, temperatures and pressures are states, and nothing else moves."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.records.record import Floats
from rigsight.rigs.reading.rig_file import rig_of_text

Run = Callable[..., tuple[int, str, str]]
TANK = """
name = "tank"
[inputs.u]
unit = "V"
[constants.full]
unit = "m"
default = 2.0
[constants.floor]
unit = "m"
default = 1e-3
[parameters.k_u]
unit = "m/(V s)"
lower = 1e-4
log = true
[parameters.k_h]
unit = "m/s"
lower = 1e-4
log = true
[states.level]
rate = "k_u*u - k_h*sqrt(max(level, floor)/full)"
unit = "m"
[sensors.y]
reads = "level"
unit = "m"
"""
TRUTH = {"k_u": 0.02, "k_h": 0.08}
DT, NOISE, STEPS = 0.5, 1e-3, 50


def levels(u: Floats, start: float) -> Floats:
    """Return the level of a tank under a held voltage, by small steps of Euler's method."""
    found, level = [], start
    for voltage in u:
        found.append(level)
        for _ in range(STEPS):
            outflow = TRUTH["k_h"] * np.sqrt(max(level, 0.0) / 2.0)
            level += DT / STEPS * (TRUTH["k_u"] * voltage - outflow)
    return np.array(found)


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    rng = np.random.default_rng(0)
    text = '[rig]\nfile = "tank.toml"\n[rig.parameters]\nk_u = 0.05\nk_h = 0.05\n'
    for name, role in (("fit", "estimation"), ("score", "validation")):
        u = np.repeat(rng.uniform(1.0, 4.0, 20), 20)
        t, y = DT * np.arange(u.size), levels(u, 0.7) + rng.normal(scale=NOISE, size=u.size)
        np.savetxt(tmp_path / f"{name}.csv", np.c_[t, u, y], delimiter=",", header="t,u,y", comments="")
        text += f'[[records]]\nfile = "{name}.csv"\nrole = "{role}"\nhold = "zoh"\n'
    (tmp_path / "tank.toml").write_text(TANK)
    (tmp_path / "campaign.toml").write_text(text)
    return tmp_path


@pytest.mark.parametrize("objective", ["windows", "free-run"])
def test_the_numbers_of_a_tank_are_identified(
    objective: str, campaign: Path, tmp_path: Path, run: Run
) -> None:
    out = tmp_path / "out"
    code, _, stderr = run("identify", campaign, "-o", out, "-j", "1", "--objective", objective)
    assert code == 0, stderr
    found = json.loads((out / "identification.json").read_text())
    for name, value in TRUTH.items():
        number = found["joint"]["parameters"][name]
        assert abs(number["value"] - value) < max(4.0 * number["std"], 0.01 * value), name
    assert found["validation"][0]["nrmse"]["y"] < 0.02


@pytest.mark.slow
def test_a_diagnosis_compares_the_tank_with_its_records(campaign: Path, tmp_path: Path, run: Run) -> None:
    code, _, stderr = run("diagnose", campaign, "-o", tmp_path / "out", "-j", "1")
    assert code == 0, stderr
    assert json.loads((tmp_path / "out" / "diagnosis.json").read_text())["verdict"] == "parameters"


def test_a_rig_needs_something_that_moves() -> None:
    without, rest = TANK.split("[states.level]")
    with pytest.raises(InputError, match=r"\[coordinates\.NAME\]"):
        rig_of_text(without + rest[rest.index("[sensors") :])

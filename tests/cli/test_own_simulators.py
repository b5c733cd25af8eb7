"""``--simulator FILE.py:FUNCTION``: a function of Python moves a rig, named on the command line alone."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rigsight.rigs.reading.rig_file import rig_of_text
from rigsight.simulate import compose
from rigsight.simulate.model import Model
from rigsight.workflow.own.own_rigs import own_simulators

Run = Callable[..., tuple[int, str, str]]

RIG = """
name = "stage"
[inputs.u]
unit = "N"
[parameters.m]
unit = "kg"
default = 2.0
lower = 0.1
[parameters.d]
unit = "N s/m"
default = 5.0
[parameters.k]
unit = "N/m"
default = 800.0
[coordinates.x]
unit = "m"
[joints.spring]
motion = "x"
stiffness = "k"
damping = "d"
[drives.motor]
signal = "u"
force = "motor"
along = "x"
[sensors.position]
reads = "x"
unit = "m"
[simulator]
kind = "python"
file = "accelerations"
[simulator.parameters]
m = "mass"
"""
FUNCTION = """
def accelerations(q, v, forces, parameters):
    return forces / parameters["mass"]
"""
NATIVE = RIG[: RIG.index("[simulator]")] + '[energy]\nkinetic = "m*d(x)^2/2"\n'


@pytest.fixture
def stage(tmp_path: Path) -> Path:
    (tmp_path / "stage.toml").write_text(RIG)
    (tmp_path / "stage.py").write_text(FUNCTION)
    t = 0.005 * np.arange(100)
    rng = np.random.default_rng(0)
    for i, role in enumerate(("estimation", "validation")):
        u = 20.0 * np.sin(2 * np.pi * (1.0 + 2.0 * t) * t + i)
        x = u / 900.0 + rng.normal(scale=1e-5, size=t.size)
        np.savetxt(
            tmp_path / f"{role}.csv",
            np.column_stack([t, u, x]),
            delimiter=",",
            header="t,u,position",
            comments="",
        )
    (tmp_path / "campaign.toml").write_text(
        '[rig]\nfile = "stage.toml"\nsimulator = "python"\n[rig.parameters]\nm = 2.0\nd = 5.0\nk = 800.0\n'
        '[[records]]\nfile = "estimation.csv"\n[[records]]\nfile = "validation.csv"\nrole = "validation"\n'
    )
    return tmp_path


def test_a_function_moves_a_rig(stage: Path, run: Run) -> None:
    record, function = stage / "validation.csv", f"{stage / 'stage.py'}:accelerations"
    values = {"m": 2.1, "d": 4.0, "k": 810.0}
    found = []
    for name, text in (("own", RIG), ("native", NATIVE)):
        own_simulators([function])
        model = Model(compose(rig_of_text(text)), values, "foh")
        file = stage / f"{name}.json"
        file.write_text(json.dumps(model.to_json()), encoding="utf-8")
        named = ("--simulator", function) if name == "own" else ()
        code, _, stderr = run("simulate", file, record, *named, "--out", stage / f"{name}.csv", "--quiet")
        assert (code, stderr) == (0, "")
        found.append(np.loadtxt(stage / f"{name}.csv", delimiter=",", skiprows=1)[:, -1])
    assert np.ptp(found[0]) > 0.01
    np.testing.assert_allclose(found[0], found[1], rtol=0.0, atol=1e-5 * np.ptp(found[1]))


@pytest.mark.parametrize(
    ("named", "message"),
    [
        ("stage.py", "--simulator: got 'stage.py'. --simulator expects a Python file and a function in it"),
        ("stage.txt:f", "--simulator expects a Python file"),
        ("none.py:accelerations", "does not exist"),
        ("stage.py:acceleration", "has no function 'acceleration'. Did you mean 'accelerations'?"),
    ],
)
def test_what_is_no_function_is_told(named: str, message: str, stage: Path, run: Run, monkeypatch) -> None:
    monkeypatch.chdir(stage)
    code, stdout, stderr = run("diagnose", stage, "--simulator", named, "--out", stage / "results")
    assert (code, stdout) == (2, "")
    assert message in stderr
    assert not (stage / "results").exists()


def test_a_campaign_alone_runs_no_function(stage: Path, run: Run, monkeypatch) -> None:
    monkeypatch.setattr("rigsight.simulators.python_program._given", {})
    (stage / "stage.toml").write_text(RIG.replace('name = "stage"', 'name = "unknown_to_this_process"'))
    code, stdout, stderr = run("diagnose", stage, "--out", stage / "results")
    assert (code, stdout) == (2, "")
    assert "is a Python function, but rig files must not run code" in stderr

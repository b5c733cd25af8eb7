"""The rig and the campaign of docs/rigs.md are what rigsight reads."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from rigsight.records import Record
from rigsight.rigs.reading.declaration import RigTable
from rigsight.rigs.reading.rig_file import rig_of_text
from rigsight.simulate import compose
from rigsight.simulate.model import Model
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.simulate import simulate_model

PAGE = (Path(__file__).parents[2] / "docs/rigs.md").read_text(encoding="utf-8")
RIG, DRIVEN_STATE, LEVEL, CAMPAIGN = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)


def test_the_campaign_of_the_page_is_read_and_its_simulation_runs(tmp_path: Path) -> None:
    rig = rig_of_text(RIG, "docs/rigs.md")
    t = 1e-3 * np.arange(300)
    rows = np.column_stack([t, np.sin(40.0 * t), np.sin(40.0 * t + 1.0), 0.02 * np.sin(40.0 * t + 2.0)])
    for name, columns in (("empty", "t,u,angle,position"), ("loaded", "t,u,angle")):
        table = rows[:, : columns.count(",") + 1]
        np.savetxt(tmp_path / f"{name}.csv", table, delimiter=",", header=columns, comments="")
    (tmp_path / "belt_stage.toml").write_text(RIG, encoding="utf-8")
    (tmp_path / "campaign.toml").write_text(CAMPAIGN, encoding="utf-8")
    campaign = read_campaign(tmp_path)
    assert campaign.rig is rig
    assert dict(campaign.validation[0].constants) == {"m_load": 1.168}
    structure = compose(campaign.rig, campaign.modelled)
    model = Model(structure, {**campaign.constants, **campaign.parameters}, "foh")
    push = Record("push", 1e-3, {"u": np.ones(200)}, {"u": "A"})
    moved = simulate_model(model, push)
    # With a belt that does not give way: force, mass and damping as the slide has them.
    force, mass, damping = 0.08 / 0.02, 1.5 + 2e-4 / 0.02**2, 8.0 + 1e-3 / 0.02**2
    expected = force / damping * (0.199 - mass / damping * -np.expm1(-damping * 0.199 / mass))
    assert moved["position"][-1] == pytest.approx(expected, rel=0.01)


def test_a_drive_that_acts_through_a_state_is_read() -> None:
    units = {
        "beta": "Pa",
        "V": "m^3",
        "k_v": "m^3/(s V)",
        "A": "m^2",
        "c_l": "m^3/(s Pa)",
        "m": "kg",
        "d": "N s/m",
    }
    numbers = "".join(f'[parameters.{name}]\nunit = "{unit}"\n' for name, unit in units.items())
    text = f"""name = "cylinder"
summary = "s"
[inputs.u]
unit = "V"
{numbers}[coordinates.x]
unit = "m"
[energy]
kinetic = "m*d(x)^2/2"
[joints.piston]
motion = "x"
damping = "d"
{DRIVEN_STATE}[sensors.position]
reads = "x"
unit = "m"
"""
    assert compose(rig_of_text(text, "docs/rigs.md")).state_names[-1] == "p"


def test_the_page_names_every_table_of_a_rig_file() -> None:
    reported = set(re.findall(r"^\| `\[(\w+)", PAGE, re.MULTILINE))
    assert reported == set(RigTable.model_fields) - {"name", "summary", "alternatives"}


def test_a_rig_without_inertia_is_read() -> None:
    numbers = {"k_u": ("parameters", "m/(V s)"), "k_h": ("parameters", "m/s"), "full": ("constants", "m")}
    numbers["floor"] = ("constants", "m")
    declared = "".join(f'[{kind}.{name}]\nunit = "{unit}"\n' for name, (kind, unit) in numbers.items())
    rig = rig_of_text(f'name = "tank"\n[inputs.u]\nunit = "V"\n{declared}{LEVEL}')
    assert [state.name for state in rig.mechanism.states] == ["level"]
    assert not rig.mechanism.coordinates

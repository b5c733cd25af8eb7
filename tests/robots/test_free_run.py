"""A rig file from a robot's model moves as MuJoCo does; one that does not is told apart."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from rigsight.robots import free_run, load_model, load_spec, with_gears
from rigsight.robots.draft import draft_rig
from rigsight.robots.runs import ALLOWED

from ..tiers import slow_but

MODELS = Path(__file__).parent / "models"


@pytest.mark.parametrize(
    "name",
    slow_but(
        "two_link_arm.xml",
        "pendulum.urdf",
        of=["two_link_arm.xml", "cart_pole.xml", "spatial_arm.xml", "pendulum.urdf"],
    ),
)
def test_it_moves_as_mujoco_does(name: str) -> None:
    path = MODELS / name
    model = load_model(path)
    run = free_run(model, draft_rig(model, path.stem, with_drives=path.suffix == ".urdf"))
    # What differs are two integrators of the same equations.
    assert run.worst < 1e-3 * ALLOWED


def test_another_damping_is_seen() -> None:
    model = load_model(MODELS / "two_link_arm.xml")
    draft = draft_rig(model, "arm")
    other = replace(draft, values={**draft.values, "elbow_damping": 1.01 * draft.values["elbow_damping"]})
    run = free_run(model, other)
    assert not run.agrees
    assert run.worst == run.differences["elbow"]


def test_a_gear_gives_way_as_the_second_joint_of_mujoco_does() -> None:
    spec = load_spec(MODELS / "two_link_arm.xml")
    draft = draft_rig(spec.compile(), "arm", gears={"shoulder": 400.0})
    run = free_run(with_gears(spec, draft), draft)
    assert set(run.differences) == {"shoulder", "shoulder_play", "elbow"}
    assert run.worst < 1e-2 * ALLOWED

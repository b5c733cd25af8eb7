"""A joint that is held: the rig moves as MuJoCo does with that joint too heavy to move, wherever a record holds it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rigsight.records import Record
from rigsight.robots import free_run, load_model, write_back
from rigsight.robots.draft import draft_rig
from rigsight.robots.runs import ALLOWED, gap_of_written
from rigsight.simulate import compose, simulate
from rigsight.simulate.model import Model

ARM = Path(__file__).parent / "models" / "spatial_arm.xml"
STEP = 0.001


def test_it_moves_as_mujoco_does() -> None:
    model = load_model(ARM)
    draft = draft_rig(model, ARM.stem, locked={"lift": 0.7, "reach": -0.04})
    assert [c.name for c in draft.rig.mechanism.coordinates] == ["turn", "wrist"]
    assert free_run(model, draft).worst < 1e-3 * ALLOWED


def test_where_it_is_held_matters() -> None:
    model = load_model(ARM)
    draft = draft_rig(model, ARM.stem, locked={"lift": 0.7})
    elsewhere = replace(draft, locked={"lift_held": replace(draft.locked["lift_held"], position=0.9)})
    assert not free_run(model, elsewhere).agrees


def test_a_record_may_hold_it_elsewhere(tmp_path: Path) -> None:
    arm = tmp_path / ARM.name
    arm.write_text(
        ARM.read_text("utf-8").replace("<option ", f'<option timestep="{STEP}" integrator="RK4" '), "utf-8"
    )
    draft = draft_rig(load_model(arm), ARM.stem, locked={"lift": 0.0, "wrist": 0.1})
    structure = compose(draft.rig)
    values = {p.name: float(p.default) for p in structure.parameters if p.default is not None}
    t = STEP * np.arange(2000)
    (name,) = (signal.name for signal in draft.rig.inputs)
    goal = {name: np.sin(2 * np.pi * (0.5 + 0.5 * t) * t)}
    record = Record("run", STEP, goal, {}, hold="zoh", constants={"lift_held": 0.8})
    start = np.zeros(len(structure.states))
    shown = simulate(structure, {**values, **record.constants}, record, start)
    measured = record.with_signals(**{s.name: shown[s.name] for s in draft.rig.outputs})
    for constants, low, high in ((record.constants, 0.0, 1e-3), ({}, 1e-2, np.inf)):
        run = replace(measured, constants=constants)
        for gap in gap_of_written(Model(structure, values, "zoh"), arm, [run], [start]):
            assert low <= gap.in_mujoco < high


def test_it_is_known_again_whatever_its_name(tmp_path: Path) -> None:
    """Names of a rig are cut to 40 letters, so that a long one leaves no room for what is added to it."""
    called = "the_second_joint_of_the_arm_which_lifts_the_hand"
    arm = tmp_path / ARM.name
    arm.write_text(ARM.read_text("utf-8").replace('"lift"', f'"{called}"'), encoding="utf-8")
    draft = draft_rig(load_model(arm), ARM.stem, locked={called: 0.7})
    structure = compose(draft.rig)
    values = {p.name: float(p.default) for p in structure.parameters if p.default is not None}
    written = write_back(Model(structure, values, "zoh"), arm)
    assert list(written.draft.locked.values()) == list(draft.locked.values())
    assert written.without_field == ()


def test_what_belongs_to_it_is_named() -> None:
    draft = draft_rig(load_model(ARM), ARM.stem, locked={"turn": 0.0})
    assert "actuator 'turn': its joint is locked" in draft.left_out
    assert "constants = { turn_held = ... }" in draft.notes[0]


@pytest.mark.parametrize("position", [0.0, 0.3])
def test_its_constant_is_there_at_zero_too(position: float) -> None:
    draft = draft_rig(load_model(ARM), ARM.stem, locked={"lift": position})
    assert draft.tables["constants"]["lift_held"]["default"] == position

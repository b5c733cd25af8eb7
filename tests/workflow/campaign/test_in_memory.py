"""Does a campaign of records in memory hold what the same campaign on disk holds, and what is told of a wrong one?"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rigsight.effects import effect_named
from rigsight.errors import InputError
from rigsight.records import Record, Role
from rigsight.workflow.campaign.in_memory import make_campaign, make_model
from rigsight.workflow.campaign.model_file import model_of, of_this_rig, read_model
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.compare import compare_campaign, named_competitors
from rigsight.workflow.diagnose import diagnose_campaign, run_diagnose

CUBIC = effect_named("cubic_stiffness")


def record(name: str = "sweep", **changes: Any) -> Record:
    u = np.sin(np.linspace(0.0, 60.0, 500) ** 1.5)
    content: dict[str, Any] = {"dt": 0.01, "signals": {"u": u, "x": 0.01 * u}, "units": {}}
    return Record(name, **(content | changes))


def test_memory_and_disk_hold_the_same_campaign(axis_campaign: Path) -> None:
    read = read_campaign(axis_campaign)
    made = make_campaign("axis", read.records, parameters=read.parameters, title=read.title)
    assert (made.rig, made.constants, made.parameters, made.modelled) == (
        read.rig, read.constants, read.parameters, read.modelled,
    )  # fmt: skip
    assert (made.title, made.notes) == (read.title, read.notes)
    assert (made.path, made.folder) == (None, None)
    assert [r.name for r in made.estimation] == [r.name for r in read.estimation]
    for mine, theirs in zip(made.records, read.records, strict=True):
        assert mine.units == theirs.units
        np.testing.assert_array_equal(mine["x"], theirs["x"])


@pytest.mark.slow
def test_memory_and_disk_give_the_same_diagnosis(axis_campaign: Path) -> None:
    read = read_campaign(axis_campaign)
    made = make_campaign("axis", read.records, parameters=read.parameters, title=read.title)
    assert (
        diagnose_campaign(made, [CUBIC]).to_json()
        == run_diagnose(axis_campaign, effects=[CUBIC], n_jobs=1).to_json()
    )


def test_units_are_those_of_the_rig_unless_the_record_has_its_own() -> None:
    (made,) = make_campaign("axis", [record(units={"u": "N"})]).records
    assert made.units == {"u": "N", "x": "m"}


def test_another_unit_of_a_record_is_converted_with_a_note() -> None:
    given = record(units={"u": "N", "x": "mm"})
    (made,) = make_campaign("axis", [given]).records
    np.testing.assert_allclose(made["x"], 1e-3 * given["x"], rtol=1e-15)
    assert made.units == {"u": "N", "x": "m"}
    assert made.notes == ("Record 'sweep': x was converted from mm, the unit of the record, to m.",)
    assert make_campaign("axis", [made]).records[0].notes == made.notes


def test_an_amplitude_is_converted_with_the_input() -> None:
    u = np.sin(np.linspace(0.0, 60.0, 500) ** 1.5)
    given = record(
        signals={"u": 250.0 * u, "psi": 0.01 * u}, units={"u": "mA"}, kind="sweep", amplitude=250.0
    )
    constants = {"v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27}
    (made,) = make_campaign("running_gear", [given], constants=constants).records
    assert (made.amplitude, np.max(made["u"])) == (0.25, pytest.approx(0.25, rel=1e-3))


def test_a_unit_of_another_quantity_is_refused() -> None:
    with pytest.raises(
        InputError, match=r"Record 'sweep': the unit 'V' of x does not measure the same as m; x is in m"
    ):
        make_campaign("axis", [record(units={"x": "V"})])


def test_a_record_of_angles_turns_the_axis() -> None:
    given = record(units={"u": "N m", "x": "deg"})
    made = make_campaign("axis", [given])
    assert made.rig.signal_units == {"u": "input", "x": "rad"}
    assert [p.unit for p in made.rig.parameters] == ["kg m^2", "N m s/rad", "N m/rad", "rad", "N m"]
    np.testing.assert_allclose(made.records[0]["x"], np.radians(given["x"]), rtol=1e-14)


def test_effects_are_named_or_declared() -> None:
    named = make_campaign("axis", [record()], parameters={"k_3": 2.0}, effects=["cubic_stiffness"])
    own = replace(CUBIC, name="my_spring")
    declared = make_campaign("axis", [record()], parameters={"k_3": 2.0}, effects=[own])
    lone = make_campaign("axis", [record()], parameters={"k_3": 2.0}, effects="cubic_stiffness")
    assert named.modelled == lone.modelled == (CUBIC,)
    assert declared.modelled == (own,)


def test_without_validation_records_that_is_noted() -> None:
    made = make_campaign("axis", [record()], title="my stage")
    assert len(made.notes) == 1
    assert "my stage" in made.notes[0]
    assert "validation" in made.notes[0]
    other = record("other", role="validation")
    (same,) = make_campaign("axis", [record(), other]).notes
    assert "exactly the samples" in same
    assert make_campaign("axis", [record(), other.with_signals(x=2.0 * other["x"])]).notes == ()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"rig": "axle"}, r"'axle'.*Did you mean 'axis'"),
        ({"parameters": {"kk": 1.0}}, r"stage: rig\.parameters\.kk: unknown.*Did you mean 'k'"),
        ({"constants": {"gian": 1.0}}, r"Did you mean 'gain'"),
        ({"parameters": {"m": -1.0}}, r"stage: rig\.parameters\.m: .*must lie in"),
        ({"effects": ["cubic"]}, r"Effect is 'cubic'\. Did you mean 'cubic_stiffness'"),
        ({"effects": ["cubic_stiffness"]}, r"k_3: is missing"),
        (
            {"effects": ["stribeck_friction"], "parameters": {"T_c": 0.5, "T_s": 0.3, "w_s": 0.1}},
            r"parameters\.T_s: must be at least T_c = 0\.5 in stribeck_friction, got 0\.3",
        ),
        ({"records": []}, r'none has role = "estimation"'),
        ({"records": [record(role="validation")]}, r'none has role = "estimation"'),
        ({"records": [record(), record()]}, r"several have the name 'sweep'"),
        ({"records": [record(signals={"v": np.ones(9)})]}, r"has no signal 'u'.*It has: v"),
        (
            {"records": [record(signals={"u": np.ones(9), "x": np.arange(9.0)}, kind="sweep")]},
            r"input u never changes \(1\)",
        ),
        (
            {"records": [record(signals={"u": np.arange(9.0), "x": np.ones(9)})]},
            r"output x never changes \(1\)",
        ),
    ],
)
def test_what_cannot_be_used_is_told(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        make_campaign(**{"rig": "axis", "records": [record()], "title": "stage"} | arguments)


@pytest.mark.parametrize(
    ("rig", "constants", "signals"),
    [
        ("element", {}, ("x", "force")),
        # The lateral displacement need not be measured.
        ("running_gear", {"v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27}, ("u", "psi")),
    ],
)
def test_every_rig_takes_its_own_signals(
    rig: str, constants: dict[str, float], signals: tuple[str, str]
) -> None:
    moving = np.sin(np.arange(50.0))
    own = record(signals=dict.fromkeys(signals, moving))
    made = make_campaign(rig, [own], constants=constants)
    assert set(made.records[0].units) == set(signals)
    with pytest.raises(InputError, match=f"has no signal '{signals[1]}'"):
        make_campaign(rig, [record(signals={signals[0]: moving})], constants=constants)


@pytest.mark.parametrize("role", ["estimation", "validation"])
def test_a_constant_input_is_a_free_motion(role: Role) -> None:
    still = record("still", signals={"u": np.ones(9), "x": np.arange(9.0)}, role=role)
    assert len(make_campaign("axis", [record(), still]).records) == 2


def test_a_prescribed_motion_must_move() -> None:
    still = record("still", signals={"x": np.ones(9), "force": np.arange(9.0)})
    with pytest.raises(InputError, match=r"input x never changes \(1\)"):
        make_campaign("element", [still])


def test_a_model_of_numbers_is_the_one_of_a_file(write_model: Callable[..., Path]) -> None:
    read = read_model(write_model())
    made = make_model("axis", {"m": 2.0, "d": 5.0, "k": 800.0, "k_3": 5e6}, ["cubic_stiffness"])
    assert made.to_json() == read.to_json()
    assert model_of(read.to_json()).to_json() == read.to_json()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"rig": "axle"}, r"'axle'.*Did you mean 'axis'"),
        ({"values": {"m": 2.0}}, r"Missing parameters: d, k\."),
        ({"values": {"m": 2.0, "d": 5.0, "k": 8.0, "k_3": 1.0}}, r"Unknown parameters: k_3"),
        ({"values": {"m": 2.0, "d": -5.0, "k": 8.0}}, r"Parameter 'd' must lie in"),
        ({"effects": ["cubic"]}, r"Did you mean 'cubic_stiffness'"),
    ],
)
def test_a_wrong_model_is_told(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        make_model(**{"rig": "axis", "values": {"m": 2.0, "d": 5.0, "k": 8.0}} | arguments)


def test_a_model_of_another_rig_is_told_with_the_campaigns_title(write_model: Callable[..., Path]) -> None:
    campaign = make_campaign("axis", [record()], title="my stage")
    element = make_model("element", {"k": 8.0, "d": 5.0})
    with pytest.raises(InputError, match=r"Model 'damper' is of the rig 'element'.*of my stage are"):
        of_this_rig("damper", element, campaign)


def test_a_comparison_of_nothing_is_told() -> None:
    campaign = make_campaign("axis", [record()])
    with pytest.raises(InputError, match="Name at least one model"):
        compare_campaign(campaign, named_competitors([], campaign))

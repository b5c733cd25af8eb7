"""The identification of a rig of one's own, from its file: names, an absent input, one motion in other words."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rigsight.excitation import linear_sweep
from rigsight.rigs import RIGS, read_rig_file, rig_file_text
from rigsight.rigs.reading.rig_file import rig_of_text
from rigsight.workflow.campaign.in_memory import make_campaign
from rigsight.workflow.identification import rig as identified_rig
from rigsight.workflow.identification.json import identification_json
from rigsight.workflow.identify import checked_options, identify_campaign, run_identify, write_identification

from .any_rig_records import T, identified, multisine, recorded

DECAY = """
name = "swing"
summary = "A weight on a rod swings until it rests."
[constants.g]
unit = "m/s^2"
default = 9.81
[constants.m]
unit = "kg"
default = 1.0
[parameters.l]
unit = "m"
log = true
about = "length of the rod"
[parameters.c]
unit = "1/s"
lower = 0.0
about = "damping by the mass"
[coordinates.phi]
unit = "rad"
[energy]
kinetic = "m*l^2*d(phi)^2/2"
potential = "-m*g*l*cos(phi)"
[joints.pivot]
motion = "phi"
damping = "c*m*l^2"
[sensors.angle]
reads = "phi"
unit = "rad"
"""


@pytest.mark.slow
def test_a_rig_without_inputs_has_poles_and_no_responses(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "swing.toml").write_text(DECAY, "utf-8")
    rig, rng = read_rig_file(tmp_path / "swing.toml"), np.random.default_rng(5)
    truth = {"g": 9.81, "m": 1.0, "l": 0.7, "c": 0.2}
    records = [recorded("decay", rig, truth, {}, rng, start=np.array([0.4, 0.0]))]
    found = identified(rig, [replace(r, kind="operation") for r in records], {}, truth, monkeypatch)
    fit = found.joint.fit.fit
    for name in ("l", "c"):
        assert abs(fit.values[name] - truth[name]) < 4.0 * fit.standard_errors[name] < 0.05 * truth[name]
    (view,) = found.views
    assert view.measured is None
    assert view.modes[0].natural_frequency == pytest.approx(np.sqrt(9.81 / 0.7), rel=1e-3)
    write_identification(found, tmp_path / "out")
    assert "no inputs" in (tmp_path / "out" / "identification.html").read_text("utf-8")


STAGE = """
name = "stage"
summary = "A voice coil moves a carriage against a leaf spring."
[inputs.current]
unit = "A"
[constants.force_constant]
unit = "N/A"
default = 12.0
[parameters.carriage]
unit = "kg"
log = true
[parameters.friction]
unit = "N s/m"
lower = 0.0
[parameters.leaf]
unit = "N/m"
lower = 0.0
[coordinates.position]
unit = "m"
[energy]
kinetic = "carriage*d(position)^2/2"
[joints.guide]
motion = "position"
damping = "friction"
stiffness = "leaf"
[drives.coil]
signal = "current"
force = "force_constant*coil"
along = "position"
[sensors.scale]
reads = "position"
unit = "m"
"""


@pytest.mark.slow
def test_one_mass_with_names_of_its_own_is_identified_from_files(tmp_path: Path) -> None:
    (tmp_path / "stage.toml").write_text(STAGE, "utf-8")
    rig, rng = read_rig_file(tmp_path / "stage.toml"), np.random.default_rng(6)
    truth = {"force_constant": 12.0, "carriage": 0.8, "friction": 3.0, "leaf": 400.0}
    record = recorded("sweep", rig, truth, {"current": linear_sweep(T, 0.5, 2.0, 60.0)}, rng)
    columns = np.column_stack([T, record["current"], record["scale"]])
    np.savetxt(
        tmp_path / "sweep.csv", columns, delimiter=",", header="t,current,scale", comments="", fmt="%.9g"
    )
    (tmp_path / "campaign.toml").write_text(
        '[rig]\nfile = "stage.toml"\n\n[[records]]\nfile = "sweep.csv"\nrole = "estimation"\nkind = "sweep"\n',
        "utf-8",
    )
    found = run_identify(tmp_path, tmp_path / "out", method="local_polynomial", n_jobs=1)
    assert found.identifiability is not None
    assert found.identifiability.determined == ("carriage", "friction", "leaf")
    for name in found.identifiability.determined:
        value, error = found.joint.fit.fit.values[name], found.joint.fit.fit.standard_errors[name]
        assert abs(value - truth[name]) < 4.0 * error < 0.1 * truth[name]
    assert found.views[0].modes[0].natural_frequency == pytest.approx(np.sqrt(400.0 / 0.8), rel=1e-3)
    page = (tmp_path / "out" / "identification.html").read_text("utf-8")
    assert f"rigsight identify {tmp_path} --method local_polynomial --out {tmp_path / 'out'}" in page


@pytest.mark.slow
def test_the_name_of_a_rig_changes_nothing() -> None:
    """The axis copied into a file of one's own, under a name of one's own, is still the axis."""
    rng, axis = np.random.default_rng(1), RIGS["axis"]
    values = {"gain": 1.0, "m": 1.0, "d": 1.6, "k": 100.0, "x_off": 0.0, "force_off": 0.0}
    record = recorded("one", axis, values, {"u": multisine(rng, 1.0, 60.0)}, rng)
    stage = rig_of_text(rig_file_text("axis").replace('name = "axis"', 'name = "stage"'))
    found = {}
    for rig in (axis, stage):
        campaign = make_campaign(rig, [record], title="same")
        found[rig.name] = identify_campaign(campaign, checked_options("local_rational", None))
    own = {name: identification_json(one, {}) for name, one in found.items()}
    assert own["axis"]["records"][0]["paths"][0]["fit"] is not None
    for content in own.values():
        content.pop("rig")
    assert json.dumps(own["axis"]) == json.dumps(own["stage"])


def test_poles_are_those_of_the_place_that_the_records_show(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = DECAY.replace('"-m*g*l*cos(phi)"', '"m*g*l*cos(phi)"')
    (tmp_path / "swing.toml").write_text(text, "utf-8")
    rig, rng = read_rig_file(tmp_path / "swing.toml"), np.random.default_rng(8)
    truth = {"g": 9.81, "m": 1.0, "l": 0.7, "c": 0.2}
    # Counted from above: the start that the file declares, zero, is where no pendulum stays.
    records = [recorded("decay", rig, truth, {}, rng, start=np.array([2.7, 0.0]))]
    (view,) = identified(rig, records, {}, truth, monkeypatch).views
    assert view.linearization.stability == "stable"
    assert view.linearization.at_state[0] == pytest.approx(np.pi)


def test_a_sensor_that_nobody_recorded_is_named_if_it_would_help(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = STAGE.replace(
        "[coordinates.position]", '[parameters.span]\nunit = "1"\nlog = true\n[coordinates.position]'
    )
    text = text.replace('reads = "position"', 'reads = "span*position"')
    for name, sensor in (("laser", "position"), ("tachometer", "span*d(position)")):
        unit = "m" if name == "laser" else "m/s"
        text += f'[sensors.{name}]\nreads = "{sensor}"\nunit = "{unit}"\n'
    (tmp_path / "stage.toml").write_text(text, "utf-8")
    rig, rng = read_rig_file(tmp_path / "stage.toml"), np.random.default_rng(9)
    truth = {"force_constant": 12.0, "carriage": 0.8, "friction": 3.0, "leaf": 400.0, "span": 1.1}
    whole = recorded("sweep", rig, truth, {"current": linear_sweep(T, 0.5, 2.0, 60.0)}, rng)
    kept = {name: whole[name] for name in ("current", "scale")}
    reported = identified(rig, [replace(whole, signals=kept)], {}, truth, monkeypatch).identifiability
    assert reported is not None
    assert reported.determined == ()
    # The tachometer scales as the scale does.
    assert reported.remedies == (
        "If 'laser' were also recorded, these inputs would determine all parameters.",
    )
    assert reported.sentence.endswith(reported.remedies[0])


def _known_mass(also_a_parameter: str = "") -> str:
    """The axis in a file of one's own whose mass was weighed; one of its other constants may be unknown."""
    text = rig_file_text("axis").replace('name = "axis"', 'name = "weighed"')
    text = text.replace(f"[constants.{also_a_parameter}]", f"[parameters.{also_a_parameter}]")
    text = text.replace("[parameters.m]", "[constants.m]")
    return text.replace('log = true\nabout = "moving mass"', 'about = "moving mass"')


def test_a_declared_constant_of_the_axis_in_ones_own_file_stays_as_declared() -> None:
    rng, rig = np.random.default_rng(1), rig_of_text(_known_mass())
    values = {"gain": 1.0, "m": 1.0, "d": 1.6, "k": 100.0, "x_off": 0.0, "force_off": 0.0}
    record = recorded("one", rig, values, {"u": multisine(rng, 1.0, 60.0)}, rng)
    campaign = make_campaign(rig, [record], constants={"gain": 2.0, "m": 2.0})
    found = identify_campaign(campaign, checked_options("local_rational", None))
    assert found.joint.fit.fit.values["m"] == 2.0
    assert found.model["constants"]["m"] == 2.0
    assert found.joint.fit.fit.values["k"] == pytest.approx(200.0, rel=0.01)


def test_an_axis_of_known_mass_and_unknown_gain_is_identified() -> None:
    rng, rig = np.random.default_rng(1), rig_of_text(_known_mass("gain"))
    values = {"gain": 2.0, "m": 2.0, "d": 3.2, "k": 200.0, "x_off": 0.0, "force_off": 0.0}
    record = recorded("one", rig, values, {"u": multisine(rng, 1.0, 60.0)}, rng)
    campaign = make_campaign(rig, [record], constants={"m": 2.0})
    found = identify_campaign(campaign, checked_options("local_rational", None))
    for name in ("gain", "d", "k"):
        assert found.joint.fit.fit.values[name] == pytest.approx(values[name], rel=0.01), name


@pytest.mark.slow
def test_a_record_may_have_the_word_window_in_its_name() -> None:
    rng, axis = np.random.default_rng(2), RIGS["axis"]
    values = {"gain": 1.0, "m": 1.0, "d": 1.6, "k": 100.0, "x_off": 0.0, "force_off": 0.0}
    names = ("lab window 1", "lab window 2", "lab")
    records = [recorded(name, axis, values, {"u": multisine(rng, 1.0, 60.0)}, rng) for name in names]
    campaign = make_campaign(axis, records, constants={"gain": 1.0})
    found = identify_campaign(campaign, checked_options("local_rational", None))
    assert [score.record for score in found.joint.scores] == list(names)
    assert found.joint.statement.startswith("One parameter set fits all 3 estimation records")


@pytest.mark.slow
def test_given_values_that_diverge_within_a_sample_are_no_start(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = rig_of_text(
        STAGE.replace('[parameters.leaf]\nunit = "N/m"\nlower = 0.0', '[parameters.leaf]\nunit = "N/m"')
    )
    rng = np.random.default_rng(6)
    truth = {"force_constant": 12.0, "carriage": 0.8, "friction": 3.0, "leaf": 400.0}
    record = recorded("sweep", rig, truth, {"current": linear_sweep(T, 0.5, 2.0, 60.0)}, rng)
    diverging = {"carriage": 0.8, "friction": 3.0, "leaf": -4e8}
    campaign = make_campaign(rig, [record], constants={"force_constant": 12.0}, parameters=diverging)
    options = checked_options("local_rational", None)
    found = identify_campaign(campaign, options).joint.fit.fit
    assert found.values["leaf"] == pytest.approx(400.0, rel=0.01)
    # Without another start they are all there is: nothing is found, but nothing breaks.
    monkeypatch.setattr(identified_rig, "linear_start", lambda *_: diverging)
    assert identify_campaign(campaign, options).joint.statement


def test_a_length_that_was_measured_leaves_the_response_of_what_follows_without_a_form() -> None:
    text = rig_file_text("running_gear").replace("[parameters.l_0]", "[constants.l_0]")
    text = text.replace('log = true\nabout = "distance', 'about = "distance')
    rng, rig = (
        np.random.default_rng(1),
        rig_of_text(text.replace('name = "running_gear"', 'name = "measured"')),
    )
    values = {
        "v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27, "l_0": 0.25,
        "J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "psi_off": 0.0, "c_y": 0.98, "y_off": 0.0,
    }  # fmt: skip
    record = recorded("one", rig, values, {"u": multisine(rng, 1.0, 60.0)}, rng)
    constants = {name: values[name] for name in ("v", "r_0", "b", "k_tau", "l_0")}
    found = identify_campaign(
        make_campaign(rig, [record], constants=constants), checked_options("local_rational", None)
    )
    yaw, lateral = found.records[0].paths
    assert yaw.fit is not None
    assert lateral.fit is None
    assert lateral.measured is not None
    assert found.joint.fit.fit.values["c_y"] == pytest.approx(0.98, rel=0.01)

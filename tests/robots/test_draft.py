"""What of a robot's model becomes a rig file, under which names, and what is said to be left out."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from rigsight.errors import InputError
from rigsight.robots import RigDraft, load_model, rig_text
from rigsight.robots.draft import draft_rig

MODELS = Path(__file__).parent / "models"


def drafted(tmp_path: Path, text: str) -> RigDraft:
    path = tmp_path / "robot.xml"
    path.write_text(text, encoding="utf-8")
    return draft_rig(load_model(path), "robot")


def one_link(inside: str = "", beside: str = "", joint: str = "") -> str:
    return f"""<mujoco><worldbody><body name="rod"><joint name="swing" axis="0 1 0" {joint}/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="1"/>{inside}</body></worldbody>{beside}</mujoco>"""


def test_numbers_of_joints_are_parameters_and_those_of_bodies_and_drives_constants() -> None:
    draft = draft_rig(load_model(MODELS / "two_link_arm.xml"), "arm")
    parameters, constants = draft.tables["parameters"], draft.tables["constants"]
    assert parameters["shoulder_damping"] == {
        "unit": "N m s/rad", "default": 0.3, "about": "damping of shoulder", "lower": 0.0
    }  # fmt: skip
    assert set(parameters) == {
        "shoulder_damping", "elbow_damping", "elbow_damping_2", "elbow_stiffness", "shoulder_armature", "elbow_armature",
    }  # fmt: skip
    assert constants["forearm_mass"]["default"] == pytest.approx(0.4)
    assert constants["elbow_springref"]["default"] == pytest.approx(0.3490658504)
    assert {"shoulder_motor_kp", "elbow_drive_gear", "elbow_drive_highest", "gravity_z"} <= set(constants)
    assert draft.left_out == draft.notes == ()


@pytest.mark.slow
def test_the_text_declares_the_same_rig() -> None:
    draft = draft_rig(load_model(MODELS / "spatial_arm.xml"), "spatial arm")
    text = rig_text(draft, "spatial_arm.xml", Path())
    assert tomllib.loads(text) == draft.tables
    assert draft.rig.name == "spatial_arm"
    assert {"link_2_mass", "plate_mass", "hand_inertia_xx"} <= set(draft.tables["constants"])


def test_dry_friction_sticks_in_the_rig() -> None:
    draft = draft_rig(load_model(MODELS / "cart_pole.xml"), "cart")
    assert draft.tables["joints"]["slider"]["force"] == "slider_frictionloss*sign(d(slider))"
    assert draft.values["slider_frictionloss"] == 0.2


@pytest.mark.parametrize(
    ("model", "said"),
    [
        (one_link(joint='range="-1 1" limited="true"'), "range of joints: swing"),
        (one_link('<body name="tip" pos="0 0 -0.3"><joint name="wag"/><geom size="0.02"/></body>'), None),
        (
            one_link('<body name="mid" pos="0 0 -1"><joint/><geom size="0.1"/><body name="tip" pos="0 0 -1"><joint/>'
                     '<geom size="0.1"/></body></body>'),
            "contacts between bodies: rod and tip",
        ),
        (one_link(beside='<equality><joint joint1="swing" polycoef="0 1 0 0 0"/></equality>'), "1 equality constraint"),
        (one_link(beside='<tendon><fixed><joint joint="swing" coef="1"/></fixed></tendon>'), "1 tendon"),
        (one_link(beside='<actuator><muscle joint="swing" lengthrange="0 1"/></actuator>'), "actuator number 0: a muscle"),
        (one_link('<site name="s"/>', '<sensor><gyro name="turns" site="s"/></sensor>'), "sensor 'turns' (gyro)"),
        (
            one_link(beside='<actuator><motor name="push" joint="swing" delay="0.01" nsample="8"/></actuator>'),
            "actuator 'push': its delay of 0.01 s",
        ),
    ],
)  # fmt: skip
def test_what_a_rig_file_cannot_say_is_named(tmp_path: Path, model: str, said: str | None) -> None:
    draft = drafted(tmp_path, model)
    assert draft.rig
    if said is None:
        assert draft.left_out == ()
    else:
        assert any(said in one for one in draft.left_out)


def test_an_actuator_with_several_controls_is_named_and_the_next_one_keeps_its_own(tmp_path: Path) -> None:
    drives = '<actuator><pid name="both" joint="swing" kp="5" input="pos vel"/><motor name="push" joint="swing"/></actuator>'
    path = tmp_path / "robot.xml"
    path.write_text(one_link(beside=drives), encoding="utf-8")
    model = load_model(path)
    draft = draft_rig(model, "robot")
    assert any(one.startswith("actuator 'both'") for one in draft.left_out)
    assert (draft.drives, draft.controls) == ({"push": 1}, {"push_ctrl": 2})


def test_gravity_that_an_option_switches_off_is_none(tmp_path: Path) -> None:
    draft = drafted(tmp_path, one_link(beside='<option><flag gravity="disable"/></option>'))
    assert "potential" not in draft.tables["energy"] or draft.tables["energy"]["potential"] == "0"


def test_names_that_repeat_or_are_none_become_free_ones(tmp_path: Path) -> None:
    twice = one_link(
        '<body name="swing_damping" pos="0 0 -0.1"><joint name="1st-joint"/><geom size="0.02"/></body>',
        '<actuator><motor name="swing" joint="swing"/></actuator>',
    )
    draft = drafted(tmp_path, twice)
    assert list(draft.joints) == ["swing", "joint_1st_joint"]
    assert list(draft.drives) == ["swing_motor"]
    assert "swing_damping_2_mass" in draft.tables["constants"]
    assert draft.rig


@pytest.mark.parametrize(
    ("model", "said"),
    [
        ("<body name='ball'><freejoint/><geom size='1'/></body>", "'ball' has a free joint"),
        ("<geom size='1'/>", "no joint"),
    ],
)  # fmt: skip
def test_what_cannot_be_a_rig_is_refused(tmp_path: Path, model: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        drafted(tmp_path, f"<mujoco><worldbody>{model}</worldbody></mujoco>")


@pytest.mark.parametrize(
    "content",
    [
        "<mujoco><worldbody>",
        "no model at all",
        "<mujoco><worldbody><body><joint/></body></worldbody></mujoco>",
    ],
)
def test_a_file_that_is_no_model_is_told(tmp_path: Path, content: str) -> None:
    with pytest.raises(InputError, match=r"robot\.xml: MuJoCo cannot"):
        drafted(tmp_path, content)

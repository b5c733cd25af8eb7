"""What each target refuses, and how names, holds and steps are checked."""

from __future__ import annotations

from dataclasses import replace

import pytest

from rigsight.effects import CATALOGUE
from rigsight.errors import InputError
from rigsight.export import TARGETS, export_model

STICKS = {"coulomb_friction", "stribeck_friction", "directional_friction", "load_dependent_friction"}
LATE = {"input_delay", "sensor_delay", "time_shift"}
REFUSED = {"control": STICKS | LATE, "modelica": STICKS}
WITHOUT = "forces that go with the acceleration of a prescribed motion"


@pytest.mark.parametrize("target", [name for name in TARGETS if not name.startswith("fmu")])
@pytest.mark.parametrize("name", [effect.name for effect in CATALOGUE])
def test_every_effect_is_written_or_refused_by_name(name: str, target: str, case_named):
    model = case_named(name).model
    if name == "inertia" and target != "latex":
        with pytest.raises(
            InputError, match=f"'{name}' cannot be exported to {target}, .*{WITHOUT}.* it: latex."
        ):
            export_model(model, target, source="model.json", name="rig")
    elif name in REFUSED.get(target, ()):
        with pytest.raises(
            InputError, match=f"'{name}' cannot be exported to {target}.*Targets with it: python, c"
        ):
            export_model(model, target, source="model.json", name="rig")
    else:
        assert export_model(model, target, source="model.json", name="rig")


@pytest.mark.parametrize("target", ["python", "matlab", "control", "modelica"])
def test_friction_that_sticks_at_several_joints_is_refused_where_the_file_integrates_by_itself(
    target: str, case_named
):
    with pytest.raises(
        InputError, match=r"'coulomb_friction@.*cannot be exported to .*Targets with it: .*c, fmu"
    ):
        export_model(case_named("friction at two joints").model, target, source="model.json", name="rig")


def test_an_effect_that_has_vanished_is_left_out(case_named):
    model = case_named("coulomb_friction").model
    without = replace(model, values={**model.values, "T_c": 0.0})
    assert "T_c" not in str(export_model(without, "control", source="model.json"))


@pytest.mark.parametrize("target", [name for name in TARGETS if name != "latex"])
def test_a_shifted_record_is_of_a_rig_that_moves_freely_and_late(target: str, case_named):
    with pytest.raises(InputError, match=f"'time_shift' cannot be exported to {target}, .*{WITHOUT}"):
        export_model(case_named("element with a late force").model, target, source="model.json", name="rig")
    late = case_named("time_shift").model
    early = replace(late, values={**late.values, "T_x": -0.02})
    with pytest.raises(
        InputError, match=r"'time_shift' shows a signal 0\.02 s before it happens.*set T_x = 0"
    ):
        export_model(early, target, source="model.json", name="rig")


@pytest.mark.parametrize("target", ["python", "c", "fmu", "fmu3", "matlab"])
def test_a_sampled_analog_input_asks_for_a_hold(target: str, case_named):
    model = replace(case_named("linear axis").model, hold="band_limited")
    with pytest.raises(InputError, match=r"'band_limited'.*--hold foh.*--hold zoh"):
        export_model(model, target, source="model.json")
    if not target.startswith("fmu"):
        assert export_model(model, target, source="model.json", hold="zoh")


@pytest.mark.parametrize("target", ["control", "latex", "modelica"])
def test_equations_alone_need_no_hold(target: str, case_named):
    model = replace(case_named("linear axis").model, hold="band_limited")
    assert export_model(model, target, source="model.json", name="rig")


@pytest.mark.parametrize(
    ("target", "options", "message"),
    [
        ("pyton", {}, "Target is 'pyton'. Did you mean 'python'"),
        ("c", {"name": "two words"}, "'two words' cannot be the name of a c model"),
        ("modelica", {"name": "model"}, "'model' is a word of the language"),
        ("c", {"hold": "linear"}, "--hold is 'linear'"),
        ("python", {"step": 0.0}, "--step must lie in"),
        ("matlab", {"step": float("nan")}, "--step must lie in"),
        ("c", {"step": 0.001}, "--step is of python, matlab.*c finds its steps by itself.*-DNAME_ACCURACY"),
        ("fmu", {"step": 0.001}, "--step is of python, matlab"),
        ("fmu3", {"step": 0.001}, "--step is of python, matlab"),
        ("latex", {"step": 0.001}, "--step is of python, matlab.*latex leaves the steps to others"),
        ("c", {"source_only": True}, "--source-only is of an FMU"),
    ],
)
def test_what_cannot_be_used_is_told(target, options, message, case_named):
    with pytest.raises(InputError, match=message):
        export_model(case_named("linear axis").model, target, source="model.json", **options)


@pytest.mark.parametrize("target", [name for name in TARGETS if not name.startswith("fmu")])
def test_the_same_model_gives_the_same_text(target: str, case_named):
    model = case_named("offsets").model
    first, second = (export_model(model, target, source="model.json", name="rig") for _ in range(2))
    assert first == second

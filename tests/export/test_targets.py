"""What each target refuses, and how names, holds and steps are checked."""

from __future__ import annotations

from dataclasses import replace

import pytest
import sympy as sp

from rigsight.effects import CATALOGUE, Effect, Energy, GainTrend, Place, Signature, effect_named, symbols
from rigsight.errors import InputError
from rigsight.export import TARGETS
from rigsight.export.targets import (
    DELAY,
    FELT_ACCELERATION,
    SENSOR_DELAY,
    STICKING,
    STICKING_TOGETHER,
    export_model,
)
from rigsight.parameters import Parameter
from rigsight.rigs import AXIS
from rigsight.simulate import compose
from rigsight.simulate.equations.kinks import freeze
from rigsight.simulate.model import Model

TEXTS = [name for name, target in TARGETS.items() if target.suffix != ".fmu"]
"""What is written without a compiler."""
WITHOUT_SEVERAL = [name for name in TARGETS if {STICKING, STICKING_TOGETHER} & TARGETS[name].lacks]
WITHOUT_FELT = [name for name in TARGETS if FELT_ACCELERATION in TARGETS[name].lacks]
STEPPING = [name for name, target in TARGETS.items() if target.steps]
EXPONENTIAL = Effect(
    name="exponential_damping",
    place=Place.DYNAMICS,
    summary="Damping that grows exponentially with the speed.",
    parameters=(
        Parameter("T_e", "force", "force", null=0.0),
        Parameter("w_e", "speed", "x time^-1", lower=1e-6),
    ),
    energy=Energy.DISSIPATIVE,
    signature=Signature(GainTrend.FALLS),
    torque=sp.Symbol("T_e", real=True)
    * (sp.exp(sp.Abs(symbols.v) / sp.Symbol("w_e", real=True)) - 1)
    * sp.sign(symbols.v),
)
"""Its sign has no jump at v = 0: nothing sticks."""


def needed(model: Model) -> set[str]:
    """Return what a target needs words for, by what the effects declare and the simulation does."""
    structure, effects = model.structure, model.structure.effects
    feeling = any(e.reads(symbols.acceleration) or e.shifts_the_record for e in effects)
    found = {
        STICKING: bool(freeze(structure).frictions),
        DELAY: any(e.delay is not None or e.command_delay is not None for e in effects),
        SENSOR_DELAY: any(e.reading_delay is not None for e in effects),
        FELT_ACCELERATION: feeling and bool(structure.rig.mechanism.prescribed),
    }
    return {what for what, is_needed in found.items() if is_needed}


@pytest.mark.parametrize("target", TEXTS)
@pytest.mark.parametrize("name", [effect.name for effect in CATALOGUE])
def test_every_effect_is_written_or_refused_by_name(name: str, target: str, case_named):
    model = case_named(name).model
    lacked = needed(model) & TARGETS[target].lacks
    if not lacked:
        assert export_model(model, target, source="model.json", name="rig")
        return
    with pytest.raises(InputError, match=f"'{name}' cannot be exported to {target}, ") as refusal:
        export_model(model, target, source="model.json", name="rig")
    assert any(
        f"without {what}. Targets with it: {', '.join(t for t in TARGETS if what not in TARGETS[t].lacks)}."
        in str(refusal.value)
        for what in lacked
    )


@pytest.mark.parametrize(
    ("name", "target", "able"),
    [
        ("coulomb_friction", "control", "python, c"),
        ("coulomb_friction", "modelica", "python, c"),
        ("input_delay", "control", "python, c"),
        ("sensor_delay", "control", "python, c"),
        ("inertia", "c", "latex"),
    ],
)
def test_some_are_refused(name: str, target: str, able: str, case_named):
    with pytest.raises(InputError, match=f"'{name}' cannot be exported to {target}.*Targets with it: {able}"):
        export_model(case_named(name).model, target, source="model.json", name="rig")


@pytest.mark.parametrize("target", TEXTS)
def test_a_sign_without_a_jump_is_damping_and_written_by_all(target: str, case_named):
    values = {**case_named("linear axis").model.values, "T_e": 0.1, "w_e": 0.02}
    alone = Model(compose(AXIS, [EXPONENTIAL]), values, "foh")
    assert export_model(alone, target, source="model.json", name="rig")
    both = Model(
        compose(AXIS, [EXPONENTIAL, effect_named("coulomb_friction")]), {**values, "T_c": 0.1}, "foh"
    )
    if STICKING in TARGETS[target].lacks:
        with pytest.raises(InputError, match="'coulomb_friction' cannot be exported"):
            export_model(both, target, source="model.json", name="rig")


@pytest.mark.parametrize("target", WITHOUT_SEVERAL)
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


@pytest.mark.parametrize("target", WITHOUT_FELT)
def test_a_shifted_record_is_of_a_rig_that_moves_freely_and_late(target: str, case_named):
    with pytest.raises(
        InputError, match=f"'time_shift' cannot be exported to {target}, .*{FELT_ACCELERATION}"
    ):
        export_model(case_named("element with a late force").model, target, source="model.json", name="rig")
    late = case_named("time_shift").model
    early = replace(late, values={**late.values, "T_x": -0.02})
    with pytest.raises(
        InputError, match=r"'time_shift' shows a signal 0\.02 s before it happens.*set T_x = 0"
    ):
        export_model(early, target, source="model.json", name="rig")


@pytest.mark.parametrize("target", STEPPING)
def test_a_sampled_analog_input_asks_for_a_hold(target: str, case_named):
    model = replace(case_named("linear axis").model, hold="band_limited")
    with pytest.raises(InputError, match=r"'band_limited'.*--hold foh.*--hold zoh"):
        export_model(model, target, source="model.json")
    if target in TEXTS:
        assert export_model(model, target, source="model.json", hold="zoh")


@pytest.mark.parametrize("target", [name for name in TARGETS if name not in STEPPING])
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
        (
            "modelica",
            {"hold": "zoh", "name": "Rig"},
            "--hold is of python, c, fmu, fmu3, matlab; .*modelica leaves the input",
        ),
        (
            "control",
            {"hold": "zoh"},
            "--hold is of python, c.*control leaves the input between samples to others",
        ),
        ("latex", {"hold": "foh"}, "--hold is of python, c"),
    ],
)
def test_what_cannot_be_used_is_told(target, options, message, case_named):
    with pytest.raises(InputError, match=message):
        export_model(case_named("linear axis").model, target, source="model.json", **options)


@pytest.mark.parametrize("target", TEXTS)
def test_the_same_model_gives_the_same_text(target: str, case_named):
    model = case_named("offsets").model
    first, second = (export_model(model, target, source="model.json", name="rig") for _ in range(2))
    assert first == second

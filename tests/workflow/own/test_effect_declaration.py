"""A declaration that a simulation or a fit would trip over is refused with the reason."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
import sympy as sp

from rigsight.discover.terms import MONOMIALS
from rigsight.effects import Effect, Energy, GainTrend, Place, Signature, Start, State, SumAndDifference
from rigsight.effects.symbols import u, v, x
from rigsight.parameters import Parameter
from rigsight.workflow.own.effect_declaration import declaration_faults

c = sp.Symbol("c", real=True)
z = sp.Symbol("z", real=True)
PARAMETER = Parameter("c", "strength", "force x^-1", null=0.0, starts=(0.3,), search=(0.0, 10.0))
SOUND = Effect(
    name="extra_spring",
    place=Place.DYNAMICS,
    summary="A second spring.",
    parameters=(PARAMETER,),
    energy=Energy.CONSERVATIVE,
    signature=Signature(GainTrend.STEADY),
    torque=c * x,
)
STATE = State(z, -z, "x")
START = Start({"c": c})
PAIR = SumAndDifference("c", "d", (0.0, 1.0), (0.0, 1.0))


def changed_parameter(**changes: Any) -> dict[str, Any]:
    return {"parameters": (replace(PARAMETER, **changes),)}


def test_sound_declarations_have_no_fault():
    for effect in (SOUND, *MONOMIALS):
        assert declaration_faults(effect) == ()


@pytest.mark.parametrize("number", [0, np.int64(0), np.float32(0.0), np.float64(0.0)], ids=type)
def test_numbers_of_python_and_numpy_are_numbers(number):
    assert declaration_faults(replace(SOUND, **changed_parameter(null=number))) == ()


@pytest.mark.parametrize("value", [False, np.False_, 10**400, np.zeros(1), sp.Float(0), "0"], ids=type)
def test_what_only_turns_into_a_number_is_none(value):
    (fault,) = declaration_faults(replace(SOUND, **changed_parameter(null=value)))
    assert fault.startswith("parameters: null is ")
    assert fault.endswith("; give a number, or None.")


@pytest.mark.parametrize(
    "declared", [SOUND, PARAMETER, Signature(GainTrend.FALLS), STATE, START, PAIR], ids=type
)
def test_every_field_is_checked(declared):
    holders = {Parameter: "parameters", State: "states", Start: "starts", SumAndDifference: "searched_as"}
    for field in fields(declared):
        changed = replace(declared, **{field.name: object()})
        if isinstance(changed, Effect):
            effect, where = changed, ""
        elif isinstance(changed, Signature):
            effect, where = replace(SOUND, signature=changed), "signature: "
        else:
            holder = holders[type(changed)]
            effect, where = replace(SOUND, **{holder: (changed,)}), f"{holder}: "
        (fault,) = declaration_faults(effect)
        assert fault.startswith(f"{where}{field.name} is <object object")


@pytest.mark.parametrize(
    ("changes", "reported"),
    [
        ({"name": "Extra spring"}, "lower-case"),
        ({"summary": " "}, "summary is empty"),
        ({"place": "dynamics"}, "Place.DYNAMICS"),
        ({"torque": "c*x"}, "give an expression of sympy symbols"),
        ({"parameters": PARAMETER}, "give a tuple"),
        (
            {"parameters": ("c",)},
            "parameters contains 'c'; give a tuple of Parameter objects (a single one needs a comma after it",
        ),
        ({"energy": "active"}, "energy is 'active'; give one of Energy.CONSERVATIVE"),
        ({"signature": Signature("falls")}, "signature: gain_trend is 'falls'; give one of GainTrend.RISES"),
        ({"at": 1}, "at is 1; give a text, or None"),
        ({"needs_inertia": 1}, "needs_inertia is 1; give True or False"),
        ({"ordered": (("c",),)}, "ordered contains ('c',); give a tuple of pairs of parameter names"),
        (
            {"special_cases": {"c": "one"}},
            "special_cases contains 'one'; give a dictionary of parameter names and",
        ),
        ({"states": (State("z", -z, "x"),)}, "states: symbol is 'z'; give a sympy symbol"),
        (changed_parameter(null="0"), "parameters: null is '0'; give a number, or None"),
        (
            changed_parameter(search=(0.0, "ten")),
            "parameters: search contains 'ten'; give two numbers in a tuple",
        ),
        (
            changed_parameter(starts=0.3),
            "parameters: starts is 0.3; give numbers in a tuple (a single one needs a comma",
        ),
        ({"torque": None}, "got none; allowed at dynamics: torque, spring, deflection"),
        ({"spring": c * x}, "exactly one expression, got torque, spring"),
        ({"place": Place.SENSOR}, "torque is not allowed at the place sensor"),
        ({"torque": c * sp.Symbol("x")}, "from rigsight.effects.symbols import x"),
        ({"torque": c * u}, "u is not a parameter, state or signal here"),
        ({"torque": c * sp.Max(x, 0)}, "Max cannot be simulated"),
        ({"torque": c * sp.Piecewise((x, x > 0), (0, True))}, "cannot be simulated"),
        (
            {"torque": None, "place": Place.ACTUATOR, "delay": c, "states": (State(z, -z, "x"),)},
            "delay cannot have states",
        ),
        (
            {"states": (State(z, u - z, "x"),), "torque": c * z},
            "the rate of z: u is not a parameter, state or signal",
        ),
        (
            changed_parameter(name="cc"),
            "parameter cc is declared but occurs in no equation. Did you mean 'c'?",
        ),
        (changed_parameter(description=""), "parameter c has no description"),
        (changed_parameter(null=None), "no parameter has a null value"),
        (changed_parameter(lower=2.0, upper=1.0, null=None), "lower 2 must be below upper 1"),
        (changed_parameter(lower=1.0), "null 0 lies outside"),
        (changed_parameter(search=(-float("inf"), 1.0)), "give two finite numbers"),
        (changed_parameter(starts=()), "starts is empty"),
        (changed_parameter(starts=(20.0,)), "the start 20 lies outside search"),
        (changed_parameter(fitted=False), "give it a default"),
        (changed_parameter(dimension="force x^three"), "cannot be read"),
        (changed_parameter(dimension="force angle^-1"), "unknown quantity angle"),
        ({**changed_parameter(name="v"), "torque": v * x}, "has the name of a signal"),
        ({"special_cases": {"n": 1.0}}, "special_cases names n"),
        ({"yields_over": sp.Symbol("x_y", real=True)}, "yields_over names x_y"),
        ({"mean_yield": sp.Symbol("x_y", real=True)}, "mean_yield names x_y"),
        ({"ordered": (("c", "d"),)}, "ordered names d, which is not a parameter"),
        (
            {
                "parameters": (*SOUND.parameters, replace(SOUND.parameters[0], name="w", dimension="time")),
                "ordered": (("c", "w"),),
            },
            "ordered compares c with w, which has a different dimension",
        ),
    ],
)
def test_each_fault_is_told(changes, reported):
    faults = declaration_faults(replace(SOUND, **changes))
    assert any(reported in fault for fault in faults), faults

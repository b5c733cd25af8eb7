"""How is an effect written as a file that `--effects` takes, and a user can read and change?"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import fields

from rigsight.effects import Effect
from rigsight.libraries.templates import filled, template_parts
from rigsight.parameters import Parameter

_NAME = re.compile(r"(?<![\w.])[A-Za-z_]\w*")


def effect_file(about: str, effects: Mapping[str, Effect]) -> str:
    """Return the text of a Python file that declares forces at joints: as Python text -> the effect that resists with each."""
    parts = template_parts("workflow", "effects.py.txt")
    numbers = list(dict.fromkeys(p.name for effect in effects.values() for p in effect.parameters))
    read = {name for force in effects for name in _NAME.findall(force)} - {*numbers}
    head = {"ABOUT": about, "READ": ", ".join(sorted(read)), "NUMBERS": ", ".join(numbers)}
    head["NAMES"] = " ".join(numbers)
    declared = [filled(parts["EFFECT"], _fragments(force, effect)) for force, effect in effects.items()]
    return "\n".join([filled(parts["HEAD"], head), *declared]) + "\n"


def _fragments(force: str, effect: Effect) -> dict[str, str]:
    return {
        "CONSTANT": effect.name.upper(),
        "NAME": effect.name,
        "SUMMARY": _literal(effect.summary),
        "PARAMETERS": "\n".join(f"        {_declared(p)}," for p in effect.parameters),
        "ENERGY": effect.energy.name,
        "TREND": effect.signature.gain_trend.name,
        "EVEN": str(effect.signature.even_harmonics),
        "TORQUE": force,
    }


def _declared(parameter: Parameter) -> str:
    """Return the call that makes a parameter; what is as usual is left out."""
    usual = Parameter(parameter.name, parameter.description)
    given = {field.name: getattr(parameter, field.name) for field in fields(parameter)}
    said = [f"{name}={_literal(value)}" for name, value in given.items() if value != getattr(usual, name)]
    return f"Parameter({', '.join([_literal(parameter.name), _literal(parameter.description), *said])})"


def _literal(value: object) -> str:
    return json.dumps(value) if isinstance(value, str) else repr(value)

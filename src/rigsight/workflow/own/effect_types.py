"""Check that every field of a declared effect has the type of its annotation.

Python itself does not check them, so that a wrong type would only show in the middle of a fit.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from functools import cache
from typing import Annotated, Any, get_type_hints

import numpy as np
from pydantic import BaseModel, ConfigDict, InstanceOf, PlainValidator, ValidationError, create_model

from rigsight.effects import Effect, Energy, GainTrend, Place, Signature, Start, State, SumAndDifference
from rigsight.errors import shown
from rigsight.parameters import Parameter

_PARTS = (Parameter, Signature, Start, State, SumAndDifference)
_BEHIND = "(a single one needs a comma after it)"
_WANTED = {
    "str": "a text",
    "float": "a number",
    "bool": "True or False",
    "sp.Symbol": "a sympy symbol",
    "sp.Expr": "an expression of sympy symbols",
    "dict[str, sp.Expr]": "a dictionary of names and expressions of sympy symbols",
    "dict[str, float]": "a dictionary of parameter names and numbers",
    "tuple[float, float]": "two numbers in a tuple",
    "tuple[float, ...]": f"numbers in a tuple {_BEHIND}",
    "tuple[tuple[str, str], ...]": 'a tuple of pairs of parameter names, such as (("T_s", "T_c"),)',
    "Signature": "a Signature, for instance Signature(GainTrend.FALLS)",
    **{f"tuple[{part.__name__}, ...]": f"a tuple of {part.__name__} objects {_BEHIND}" for part in _PARTS},
    **{
        kind.__name__: f"one of {', '.join(f'{kind.__name__}.{one.name}' for one in kind)}"
        for kind in (Energy, GainTrend, Place)
    },
}
"""Annotation of a field -> what to give."""


def _number(value: object) -> float:
    # Pydantic accepts whatever can be converted to a float, such as an array of one value.
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        raise ValueError("no number")
    try:
        return float(value)
    except OverflowError:
        raise ValueError("too large") from None


@cache
def _models() -> dict[type, type[BaseModel]]:
    """Return a model for an effect and for each of its parts, whose fields accept only values of the annotated type."""
    instance: Any = InstanceOf
    # A part is checked field by field on its own, so that a sentence names its field.
    own = {part.__name__: instance[part] for part in _PARTS}
    own["float"] = Annotated[float, PlainValidator(_number)]
    config = ConfigDict(strict=True, arbitrary_types_allowed=True)
    found: dict[type, type[BaseModel]] = {}
    for declared in (Effect, *_PARTS):
        hints = get_type_hints(declared, localns=own, include_extras=True)
        types: dict[str, Any] = {name: (hint, ...) for name, hint in hints.items()}
        found[declared] = create_model(declared.__name__, __config__=config, **types)
    return found


def type_faults(effect: Effect) -> Iterator[str]:
    """Yield a sentence for each field of an effect, and of its parts, with a value of the wrong type."""
    yield from _faults("", Effect, effect)


def _faults(where: str, declared: type, holder: object) -> Iterator[str]:
    values = {field.name: getattr(holder, field.name) for field in fields(declared)}
    wrong: dict[str, object] = {}
    try:
        _models()[declared].model_validate(values)
    except ValidationError as error:
        for one in error.errors():
            wrong.setdefault(str(one["loc"][0]), one["input"])
    for field in fields(declared):
        value = values[field.name]
        if field.name in wrong:
            got = wrong[field.name]
            yield f"{where}{field.name} {'is' if got is value else 'contains'} {shown(got)}; give {_wanted(str(field.type))}."
        for part in value if isinstance(value, tuple) else (value,):
            for kind in _PARTS:
                if isinstance(part, kind):
                    yield from _faults(f"{field.name}: ", kind, part)


def _wanted(annotation: str) -> str:
    kind = annotation.removesuffix(" | None")
    return _WANTED[kind] if kind == annotation else f"{_WANTED[kind]}, or None"

"""Does every field of a declared effect hold what it should, so that the rest of it can be looked at?

Python does not check what a user's file puts into a field; what is wrong there would only show in the middle of a fit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import sympy as sp

from rigsight.effects import Effect, Energy, Place, Signature, Start, State, SumAndDifference
from rigsight.errors import shown
from rigsight.parameters import Parameter

EXPRESSIONS = ("torque", "spring", "deflection", "drive", "delay", "lateral", "measured", "reading_delay")
"""Fields of an effect that change a part of the rig."""
Check = tuple[Callable[[Any], bool], str]
"""Whether a value is right, and what to give instead."""


def _is_number(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        return False
    try:
        float(value)
    except OverflowError:
        return False
    return True


def _is_pair(value: object) -> bool:
    return isinstance(value, tuple) and len(value) == 2 and all(map(_is_number, value))


def _is_text(value: object) -> bool:
    return isinstance(value, str)


def _is_formula(value: object) -> bool:
    return isinstance(value, sp.Expr)


def _or_none(check: Check) -> Check:
    return (lambda value: value is None or check[0](value)), f"{check[1]}, or None"


_TEXT: Check = (_is_text, "a text")
_NUMBER: Check = (_is_number, "a number")
_YES_OR_NO: Check = (lambda value: isinstance(value, bool), "True or False")
_PAIR: Check = (_is_pair, "two numbers in a tuple")
_FORMULA: Check = (_is_formula, "an expression of sympy symbols")
_MEMBERS: dict[type, dict[str, Check]] = {
    Parameter: {
        "name": _TEXT,
        "description": _TEXT,
        "dimension": _TEXT,
        "unit": _TEXT,
        "lower": _NUMBER,
        "upper": _NUMBER,
        "null": _or_none(_NUMBER),
        "default": _or_none(_NUMBER),
        "starts": (
            lambda value: isinstance(value, tuple) and all(map(_is_number, value)),
            "numbers in a tuple (with a comma behind a single one)",
        ),
        "search": _PAIR,
        "logarithmic": _YES_OR_NO,
        "fitted": _YES_OR_NO,
    },
    State: {
        "symbol": (lambda value: isinstance(value, sp.Symbol), "a sympy symbol"),
        "rate": _FORMULA,
        "dimension": _TEXT,
        "limit": _or_none(_FORMULA),
    },
    Start: {
        "values": (
            lambda value: (
                isinstance(value, dict) and all(_is_text(k) and _is_formula(v) for k, v in value.items())
            ),
            "a dictionary of names and expressions of sympy symbols",
        ),
        "parent": _or_none(_TEXT),
    },
    SumAndDifference: {
        "first": _TEXT,
        "second": _TEXT,
        "sum_range": _PAIR,
        "difference_range": _PAIR,
        "exponent": _or_none(_TEXT),
    },
}
_LISTS: dict[str, type] = {
    "parameters": Parameter,
    "states": State,
    "starts": Start,
    "searched_as": SumAndDifference,
}
_OTHERS: dict[str, Check] = {
    "special_cases": (
        lambda value: (
            isinstance(value, dict) and all(_is_text(k) and _is_number(v) for k, v in value.items())
        ),
        "a dictionary of parameter names and numbers",
    ),
    "ordered": (
        lambda value: (
            isinstance(value, tuple)
            and all(isinstance(pair, tuple) and len(pair) == 2 and all(map(_is_text, pair)) for pair in value)
        ),
        'a tuple of pairs of parameter names, such as (("T_s", "T_c"),)',
    ),
    "post_yield_stiffness_ratio": _or_none(_TEXT),
    "pulsation": _or_none(_TEXT),
    "wave_number": _or_none(_TEXT),
    "needs_inertia": _YES_OR_NO,
}


def type_faults(effect: Effect) -> Iterator[str]:
    """Yield a sentence for each field that holds something else than it should."""
    for field, wanted in (("name", str), ("summary", str), ("place", Place), ("energy", Energy)):
        if not isinstance(getattr(effect, field), wanted):
            yield f"{field} is {shown(getattr(effect, field))}; give a {wanted.__name__}{_options(wanted)}."
    signature: object = effect.signature
    if not isinstance(signature, Signature):
        yield f"signature is {shown(signature)}; give a Signature, for instance Signature(GainTrend.FALLS)."
    for field, member_type in _LISTS.items():
        members = getattr(effect, field)
        if not isinstance(members, tuple):
            yield f"{field} is a {type(members).__name__}; give a tuple (with a comma behind a single one)."
            continue
        for member in members:
            if isinstance(member, member_type):
                yield from _faults(f"{field}: ", member, _MEMBERS[member_type])
            else:
                yield f"{field} holds {shown(member)}; give a {member_type.__name__}."
    yield from _faults("", effect, _OTHERS)
    for field in EXPRESSIONS:
        expression = getattr(effect, field)
        if expression is not None and not _is_formula(expression):
            yield f"{field} is {shown(expression)}; give an expression of sympy symbols."


def _faults(where: str, holder: object, checks: dict[str, Check]) -> Iterator[str]:
    for field, (is_right, wanted) in checks.items():
        value = getattr(holder, field)
        if not is_right(value):
            yield f"{where}{field} is {shown(value)}; give {wanted}."


def _options(wanted: type) -> str:
    return (
        f" ({', '.join(f'{wanted.__name__}.{o.name}' for o in wanted)})" if wanted in (Place, Energy) else ""
    )

"""Check that the declaration of an effect is complete and consistent.

These checks need no simulation; the others are in `rigsight.workflow.own.effect_checks`.
"""

from __future__ import annotations

import keyword
import math
from collections.abc import Iterable, Iterator
from dataclasses import fields
from functools import cache
from typing import Annotated, Any, get_type_hints

import numpy as np
import sympy as sp
from pydantic import BaseModel, ConfigDict, InstanceOf, PlainValidator, ValidationError, create_model
from sympy.core.function import Application

from rigsight.effects import (
    Effect,
    Energy,
    Family,
    GainTrend,
    Place,
    Signature,
    Start,
    State,
    SumAndDifference,
)
from rigsight.effects import symbols as canonical
from rigsight.effects.effect import PARTS
from rigsight.errors import nearest, shown
from rigsight.parameters import Parameter
from rigsight.rigs import RIGS, Rig
from rigsight.simulate import compose
from rigsight.units import parse_dimension

_COMPONENTS = (Parameter, Signature, Start, State, SumAndDifference)
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
    **{
        f"tuple[{part.__name__}, ...]": f"a tuple of {part.__name__} objects {_BEHIND}"
        for part in _COMPONENTS
    },
    **{
        kind.__name__: f"one of {', '.join(f'{kind.__name__}.{one.name}' for one in kind)}"
        for kind in (Energy, Family, GainTrend, Place)
    },
}
"""Annotation of a field -> what to give."""
_NAME_ONE = ("post_yield_stiffness_ratio", "pulsation", "wave_number")
"""Fields that may hold the name of a parameter."""
_KINKS = (sp.Abs, sp.sign, canonical.positive_part)
_SMOOTH = (
    sp.exp, sp.log, sp.sin, sp.cos, sp.tan, sp.asin, sp.acos, sp.atan, sp.sinh, sp.cosh, sp.tanh, sp.asinh,
)  # fmt: skip


def declaration_faults(effect: Effect) -> tuple[str, ...]:
    """Return the errors of a declaration, one sentence each; empty if there are none."""
    wrong_types = tuple(type_faults(effect))
    if wrong_types:
        # Nothing else can be checked if a field has the wrong type.
        return wrong_types
    found = tuple(
        dict.fromkeys([*_name_faults(effect), *_parameter_faults(effect), *_equation_faults(effect)])
    )
    return found or tuple(_composition_faults(effect))


def _name_faults(effect: Effect) -> Iterator[str]:
    if not effect.name.isidentifier() or not effect.name.isascii() or effect.name != effect.name.lower():
        yield f"the name '{effect.name}' must consist of lower-case letters, digits and underscores."
    for symbol in (*(p.name for p in effect.parameters), *(state.symbol.name for state in effect.states)):
        if not symbol.isidentifier() or not symbol.isascii() or keyword.iskeyword(symbol):
            yield f"the symbol '{symbol}' must consist of letters, digits and underscores, and must not be a keyword of Python."
    if not effect.summary.strip():
        yield "the summary is empty; describe in one sentence what the effect does."


def _parameter_faults(effect: Effect) -> Iterator[str]:
    expressions = [*effect.equations.values(), *(s.rate for s in effect.states)]
    expressions += [state.limit for state in effect.states if state.limit is not None]
    used = {symbol.name for expression in expressions for symbol in expression.free_symbols}
    names = [p.name for p in effect.parameters]
    signals = {name for part in PARTS.values() for name in part.states_read or ()}
    if not effect.null_values():
        yield "no parameter has a null value; give null=..., the value at which the effect vanishes, for at least one."
    for p in effect.parameters:
        if names.count(p.name) > 1:
            yield f"parameter {p.name} is declared {names.count(p.name)} times."
        if p.name in signals:
            yield f"parameter {p.name} has the name of a signal of the rig; choose another name."
        if p.name not in used:
            yield f"parameter {p.name} is declared but occurs in no equation.{nearest(p.name, used - set(names))}"
        if not p.description.strip():
            yield f"parameter {p.name} has no description; give one."
        yield from _range_faults(p)
        yield from _dimension_faults(p)
    named = [("special_cases", name) for name in effect.special_cases]
    named += [("searched_as", name) for pair in effect.searched_as for name in (pair.first, pair.second)]
    named += [("ordered", name) for pair in effect.ordered for name in pair]
    named += [(field, getattr(effect, field)) for field in _NAME_ONE if getattr(effect, field) is not None]
    for field, over in (("yields_over", effect.yields_over), ("mean_yield", effect.mean_yield)):
        named += [(field, symbol.name) for symbol in (over.free_symbols if over is not None else ())]
    for field, name in named:
        if name not in names:
            yield f"{field} names {name}, which is not a parameter.{nearest(name, names)}"
    dimensions = {p.name: p.dimension for p in effect.parameters}
    for first, second in effect.ordered:
        if {first, second} <= set(names) and dimensions[first] != dimensions[second]:
            yield f"ordered compares {first} with {second}, which has a different dimension."
    for start in effect.starts:
        for name in start.values.keys() - {*names, "k"}:
            yield f"a start gives a value to {name}, which is not a parameter.{nearest(name, names)}"


def _range_faults(p: Parameter) -> Iterator[str]:
    if not p.lower < p.upper:
        yield f"parameter {p.name}: lower {p.lower:g} must be below upper {p.upper:g}."
    for label, value in (("null", p.null), ("default", p.default)):
        if value is not None and not p.lower <= value <= p.upper:
            yield f"parameter {p.name}: {label} {value:g} lies outside [{p.lower:g}, {p.upper:g}]."
    if not p.fitted:
        if p.default is None:
            yield f"parameter {p.name} is not fitted; give it a default."
        return
    if not (all(map(math.isfinite, p.search)) and p.search[0] < p.search[1]):
        yield f"parameter {p.name}: search is {p.search}; give two finite numbers in increasing order (characteristic units)."
    if not p.starts:
        yield f"parameter {p.name}: starts is empty; give a start value inside search."
    for start in p.starts:
        if not p.search[0] <= start <= p.search[1]:
            yield f"parameter {p.name}: the start {start:g} lies outside search [{p.search[0]:g}, {p.search[1]:g}]."
    if p.logarithmic and not p.search[0] > 0.0:
        yield f"parameter {p.name} is searched logarithmically; the lower end of search must be above 0."


def _dimension_faults(p: Parameter) -> Iterator[str]:
    bases = {base for rig in _rigs() for base in rig.units} | {"drive"}
    try:
        unknown = [base for base in parse_dimension(p.dimension) if base not in bases]
    except ValueError:
        yield f"parameter {p.name}: the dimension '{p.dimension}' cannot be read; write for instance 'force x^-3'."
        return
    for base in unknown:
        yield f"parameter {p.name}: dimension '{p.dimension}' has the unknown quantity {base}. Known: {', '.join(sorted(bases))}."


def _equation_faults(effect: Effect) -> Iterator[str]:
    changed = effect.equations
    fitting = [name for name, part in PARTS.items() if effect.place in part.places]
    if len(changed) != 1:
        got = ", ".join(changed) or "none"
        yield f"it must define exactly one expression, got {got}; allowed at {effect.place.value}: {', '.join(fitting)}."
        return
    ((field, expression),) = changed.items()
    if field not in fitting:
        yield f"{field} is not allowed at the place {effect.place.value}; allowed: {', '.join(fitting)}."
    part = PARTS[field]
    if effect.states and part.states_read is None:
        others = [name for name, other in PARTS.items() if other.states_read is not None]
        yield f"{field} cannot have states; only {', '.join(others)} can."
    yield from _expression_faults(effect, field, expression, part.reads)
    for state in effect.states:
        yield from _expression_faults(
            effect, f"the rate of {state.symbol}", state.rate, part.states_read or ()
        )
        if state.limit is not None:
            yield from _expression_faults(effect, f"the limit of {state.symbol}", state.limit, ())


def _expression_faults(
    effect: Effect, what: str, expression: sp.Expr, readable: Iterable[str]
) -> Iterator[str]:
    readable = tuple(readable)
    signals = {getattr(canonical, name) for name in readable}
    own = [p.name for p in effect.parameters]
    states = {state.symbol for state in effect.states}
    for symbol in sorted(expression.free_symbols, key=str):
        if symbol in signals or symbol in states or symbol.name in own:
            continue
        if symbol.name in readable:
            yield (
                f"{what}: {symbol} is a different symbol from that of the rig; write "
                f"'from rigsight.effects.symbols import {symbol}'."
            )
            continue
        known = [*own, *map(str, states), *readable]
        hint = nearest(symbol.name, known)
        yield f"{what}: {symbol} is not a parameter, state or signal here.{hint} Known: {', '.join(known)}."
    for function in sorted(expression.atoms(Application), key=str):
        if not isinstance(function, (*_KINKS, *_SMOOTH)):
            yield (
                f"{what}: {type(function).__name__} cannot be simulated; write kinks with Abs, sign or positive_part "
                f"(rigsight.effects.symbols), and otherwise use {', '.join(f.__name__ for f in _SMOOTH)}."
            )


def _composition_faults(effect: Effect) -> Iterator[str]:
    for rig in (rig for rig in _rigs() if rig.offers(effect)):
        try:
            compose(rig, [effect])
        except Exception as error:
            # Some errors of an expression show only when it is used; any exception here is an error of the declaration.
            yield f"it cannot be combined with the rig {rig.name}: {type(error).__name__}: {error}"


def _rigs() -> list[Rig]:
    """Return the built-in rigs of one joint; an effect acts in the same way at each joint of larger rigs."""
    return [rig for rig in RIGS.values() if rig.has_one_motion]


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
    own = {part.__name__: instance[part] for part in _COMPONENTS}
    own["float"] = Annotated[float, PlainValidator(_number)]
    config = ConfigDict(strict=True, arbitrary_types_allowed=True)
    found: dict[type, type[BaseModel]] = {}
    for declared in (Effect, *_COMPONENTS):
        hints = get_type_hints(declared, localns=own, include_extras=True)
        types: dict[str, Any] = {name: (hint, ...) for name, hint in hints.items()}
        found[declared] = create_model(declared.__name__, __config__=config, **types)
    return found


def type_faults(holder: object, declared: type = Effect, where: str = "") -> Iterator[str]:
    """Yield a sentence for each field of an effect, and of its parts, with a value of the wrong type."""
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
            got, annotation = wrong[field.name], str(field.type)
            kind = annotation.removesuffix(" | None")
            wanted = _WANTED[kind] if kind == annotation else f"{_WANTED[kind]}, or None"
            yield f"{where}{field.name} {'is' if got is value else 'contains'} {shown(got)}; give {wanted}."
        for part in value if isinstance(value, tuple) else (value,):
            for component in _COMPONENTS:
                if isinstance(part, component):
                    yield from type_faults(part, component, f"{field.name}: ")

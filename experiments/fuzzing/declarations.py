"""Make an `Effect`, as a user's file might declare it, from a tree of plain values, without executing any text."""

from __future__ import annotations

from typing import Any

import sympy as sp

from rigsight.effects import Effect, Energy, GainTrend, Place, Signature, Start, State, SumAndDifference
from rigsight.effects import symbols as canonical
from rigsight.parameters import Parameter

DECLARATIONS: tuple[dict[str, Any], ...] = (
    {
        "name": "quintic_stiffness", "place": "dynamics", "summary": "The spring stiffens with the fourth power.",
        "energy": "conservative", "signature": "rises", "torque": ["*", "k_5", ["**", "x", 5]],
        "parameters": [{
            "name": "k_5", "description": "quintic stiffness", "dimension": "force x^-5", "null": 0.0,
            "starts": [0.1], "search": [-1.0, 1.0],
        }],
        "starts": [{"values": {"k_5": ["*", 0.1, "k"]}, "parent": "cubic_stiffness"}],
    },
    {
        "name": "slow_spring", "place": "dynamics", "summary": "A spring with memory.", "energy": "dissipative",
        "signature": "falls", "spring": ["+", "spring_torque", ["*", "k_z", "z"]],
        "parameters": [
            {"name": "k_z", "description": "share", "dimension": "force x^-1", "lower": 0.0, "null": 0.0, "starts": [0.1, 0.5],
             "search": [0.0, 2.0]},
            {"name": "T_z", "description": "time", "dimension": "time", "lower": 1e-6, "starts": [0.1], "search": [0.001, 10.0],
             "logarithmic": True},
        ],
        "states": [{"symbol": "z", "rate": ["-", "v", ["/", "z", "T_z"]], "dimension": "x", "limit": "T_z"}],
        "searched_as": [{"first": "k_z", "second": "T_z", "sum_range": [0.0, 1.0], "difference_range": [-1.0, 1.0]}],
        "special_cases": {"k_z": 0.5}, "post_yield_stiffness_ratio": "k_z",
    },
    {
        "name": "my_delay", "place": "actuator", "summary": "The input is late.", "energy": "active", "signature": "steady",
        "delay": "T_d",
        "parameters": [{"name": "T_d", "description": "delay", "dimension": "time", "lower": 0.0, "upper": 1.0, "null": 0.0,
                        "starts": [0.01], "search": [0.0, 1.0]}],
    },
)  # fmt: skip
"""Sound ones."""
_EXPRESSIONS = ("torque", "spring", "deflection", "drive", "delay", "lateral", "measured", "reading_delay")
_FUNCTIONS = {
    "Abs": sp.Abs, "sign": sp.sign, "exp": sp.exp, "log": sp.log, "tanh": sp.tanh, "gamma": sp.gamma, "Max": sp.Max,
    "f": sp.Function("f"), "floor": sp.floor,
}  # fmt: skip


def effect_of(tree: dict[str, Any]) -> Effect:
    """Return the effect; what has the wrong type stays as it is, as it would in a user's file."""
    fields = dict(tree)
    for field, wanted in (("place", Place), ("energy", Energy)):
        fields[field] = _member(wanted, fields.get(field))
    trend = fields.get("signature")
    fields["signature"] = Signature(GainTrend(trend)) if trend in ("rises", "falls", "steady") else trend
    for field in _EXPRESSIONS:
        if field in fields:
            fields[field] = _expression(fields[field], 0)
    fields["parameters"] = _tuple(fields.get("parameters"), _parameter)
    fields["states"] = _tuple(fields.get("states", []), _state)
    fields["starts"] = _tuple(fields.get("starts", []), _start)
    fields["searched_as"] = _tuple(fields.get("searched_as", []), _pair)
    return Effect(**fields)


def _member(kind: Any, value: Any) -> Any:
    return kind(value) if isinstance(value, str) and value in list(kind) else value


def _tuple(value: Any, of: Any) -> Any:
    return (
        tuple(of(one) if isinstance(one, dict) else one for one in value)
        if isinstance(value, list)
        else value
    )


def _parameter(tree: dict[str, Any]) -> Parameter:
    lists = {key: tuple(value) if isinstance(value, list) else value for key, value in tree.items()}
    return Parameter(**lists)


def _state(tree: dict[str, Any]) -> State:
    return State(
        **{key: value if key == "dimension" else _expression(value, 0) for key, value in tree.items()}
    )


def _start(tree: dict[str, Any]) -> Start:
    values = tree.get("values")
    made = {name: _expression(one, 0) for name, one in values.items()} if isinstance(values, dict) else values
    return Start(**{**tree, "values": made})


def _pair(tree: dict[str, Any]) -> SumAndDifference:
    return SumAndDifference(**tree)


def _expression(tree: Any, depth: int) -> Any:
    if depth > 8:
        return sp.Integer(1)
    if isinstance(tree, str) and tree:
        found = getattr(canonical, tree, None)
        return found if isinstance(found, sp.Expr) else sp.Symbol(tree, real=True)
    if isinstance(tree, bool) or not isinstance(tree, int | float | list):
        return tree
    if isinstance(tree, int | float):
        return sp.Float(tree) if abs(tree) < 1e6 else tree
    if not tree:
        return tree
    sign, *parts = tree
    made = [_expression(one, depth + 1) for one in parts]
    # Of a mapping, sympy would run the texts.
    return _applied(sign, made) if not any(isinstance(one, dict) for one in made) else tree


def _applied(sign: Any, parts: list[Any]) -> Any:
    if sign in ("*", "+"):
        # Strict: a text would be run.
        return (sp.Mul if sign == "*" else sp.Add)(*(sp.sympify(part, strict=True) for part in parts))
    if sign in ("-", "/", "**") and len(parts) == 2:
        first, second = parts
        return first - second if sign == "-" else first / second if sign == "/" else first**second
    if isinstance(sign, str) and sign in _FUNCTIONS and len(parts) == 1:
        return _FUNCTIONS[sign](parts[0])
    return parts[0] if parts else sign

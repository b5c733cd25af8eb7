"""Derivatives of the equations by states and constants, for integrating sensitivities along with the motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy as sp

from rigsight.effects.symbols import positive_part
from rigsight.simulate.compiled.kernel_equations import KernelEquations
from rigsight.simulate.equations.derivatives import LinearForms, linear_forms, slope, slopes_of
from rigsight.simulate.equations.elimination import Elimination
from rigsight.simulate.equations.kinks import absolute
from rigsight.simulate.equations.straight_line import needed_steps, of_parts, straight_line
from rigsight.simulate.equations.structure import INPUT, INPUT_RATE
from rigsight.simulate.printing.language import C, elements, function_body, lane_body, limited, real, symbols

_EARLIER = sp.Symbol("earlier input", real=True)


def carries_tangents(equations: KernelEquations) -> bool:
    """Return True if derivatives are integrated with the motion, False if they are differences of sets side by side."""
    # Integrated derivatives cost two thirds more if the equations are sums and products, because differences need no derivatives
    # by the constants, and half as much if functions are costly, because these are computed once. With dry friction both cost the
    # same, but differences would need a long step, because reversals are located to a tolerance. Differences are used in these
    # cases: for states with a limited range, because an exact derivative is valid only in a small neighborhood; for several
    # joints that stick and slip, because the release of one changes the instant at which the next is released; for a force that
    # jumps at a position, such as that of a damper behind a play, because integrated derivatives do not account for a changed
    # motion reaching the position sooner; for delayed sensors, whose readings are computed after the simulation.
    structure = equations.structure
    if (
        structure.jumps_at_a_place
        or equations.limits
        or structure.is_shifted
        or equations.has_several_frictions
    ):
        return False
    expressions = (*equations.lane_rates, *equations.outputs, *equations.lane_steps.values())
    return bool(equations.frozen.frictions) or any(
        _is_costly(part) for expression in expressions for part in expression.atoms(sp.Function, sp.Pow)
    )


def tangent_fragments(equations: KernelEquations) -> dict[str, str]:
    """Return the changes of the equations with states and constants, by key in the template."""
    # Each group of equations has factors, which are the same for all directions, and changes: sums of products with them.
    structure, n = equations.structure, len(equations.structure.states)
    of_states = dict(zip(structure.states, symbols("z", n), strict=True))
    of_constants = dict(zip(equations.constants, symbols("dq", len(equations.constants)), strict=True))
    arriving = {INPUT: INPUT + _EARLIER * INPUT_RATE} if structure.delay is not None else {}
    rates, outputs = [rate.xreplace(arriving) for rate in equations.lane_rates], equations.outputs
    steps = {symbol: step.xreplace(arriving) for symbol, step in equations.lane_steps.items()}
    groups: dict[str, tuple[Sequence[str], Sequence[sp.Expr], Mapping[sp.Symbol, sp.Symbol]]] = {
        "RATE": (elements("r", n), rates, {**of_states, _EARLIER: real("(earlier)")}),
        "OUTPUT": (elements("r", len(outputs)), outputs, of_states),
        "DELAY": (["const lanes delay"], equations.delay, {}),
    }
    fragments = {"PREPARE_CHANGES": _prepare_changes(equations)}
    for key, (targets, expressions, own) in groups.items():
        changes = {**own, **of_constants}
        forms = _forms(equations, expressions, changes, steps)
        now = {_EARLIER: sp.Integer(0)}
        numbered = {symbol: f"d[{i}]" for i, symbol in enumerate(forms.factors)}
        names = {**equations.lane_names, **numbered, **{change: change.name for change in changes.values()}}
        factors = tuple(factor.xreplace(now) for factor in forms.factors.values())
        places = elements("d", len(factors))
        fragments[f"N_{key}_FACTORS"] = str(max(1, len(factors)))
        if forms.parts:
            parts = {symbol: part.xreplace(now) for symbol, part in forms.parts.items()}
            fragments[f"{key}_FACTORS"] = lane_body(places, of_parts(parts, factors), names)
            fragments[f"{key}_CHANGES"] = lane_body(targets, of_parts(forms.steps, forms.sums), names)
        else:
            fragments[f"{key}_FACTORS"] = function_body((), places, factors, names, lanes=True)
            fragments[f"{key}_CHANGES"] = function_body((), targets, forms.sums, names, lanes=True)
    return fragments


def _forms(
    equations: KernelEquations,
    expressions: Sequence[sp.Expr],
    changes: Mapping[sp.Symbol, sp.Symbol],
    steps: Mapping[sp.Symbol, sp.Expr],
) -> LinearForms:
    elimination, constants = equations.structure.elimination, set(equations.constants)
    if elimination is None or not needed_steps(expressions, steps):
        return linear_forms(expressions, changes, constants)
    return eliminated_forms(expressions, changes, constants, elimination, steps)


def _prepare_changes(equations: KernelEquations) -> str:
    """Return the changes of constants with parameters: each common part, followed by its change."""
    parts = (sp.Symbol(f"part{i}", real=True) for i in range(10_000))
    shared, reduced = sp.cse(list(equations.constants.values()), symbols=parts, optimizations=None)
    names = {symbol: f"p[{i}]" for i, symbol in enumerate(equations.structure.parameter_symbols)}
    changes = {symbol: real(f"d{name}") for symbol, name in names.items()}
    lines: list[str] = []

    def change(expression: sp.Expr) -> str:
        present = [symbol for symbol in changes if symbol in expression.free_symbols]
        total = sp.Add(*(slope(expression, symbol) * changes[symbol] for symbol in present))
        return C.expression(total, {**names, **{own: own.name for own in changes.values()}})

    for part, expression in shared:
        lines += [
            f"const double {part} = {C.expression(expression, names)};",
            f"const double d{part} = {change(expression)};",
        ]
        names[part], changes[part] = part.name, real(f"d{part}")
    lines += [f"dq[{i}] = {change(expression)};" for i, expression in enumerate(reduced)]
    return "\n".join(f"    {line}" for line in lines)


def _is_costly(part: sp.Expr) -> bool:
    """Return True for a function or power that takes many times as long as a product."""
    if isinstance(part, sp.Pow):
        return not part.exp.is_Integer
    return not isinstance(part, (sp.Abs, sp.sign, positive_part, limited, absolute))


def eliminated_forms(
    expressions: Sequence[sp.Expr],
    changes: Mapping[sp.Symbol, sp.Expr],
    constants: set[sp.Symbol],
    elimination: Elimination,
    steps: Mapping[sp.Symbol, sp.Expr],
) -> LinearForms:
    """Return the changes of expressions with accelerations due to changes of symbols, with all signs held constant."""
    n, begun = elimination.size, elimination.begun(steps)
    by = [*changes, *elimination.accelerations]
    whole = straight_line([*elimination.left, *expressions], begun)
    line = slopes_of(whole, by)
    rows = [line.results[i * len(by) : (i + 1) * len(by)] for i in range(n + len(expressions))]
    factors: dict[sp.Expr, sp.Symbol] = {}

    def factor(value: sp.Expr) -> sp.Expr:
        if value.is_number or value in constants:
            return value
        return factors.setdefault(value, sp.Symbol(f"factor {len(factors)}", real=True))

    def total(slopes: Sequence[sp.Expr], of: Sequence[sp.Expr]) -> sp.Expr:
        return sp.Add(
            *(factor(slope) * change for slope, change in zip(slopes, of, strict=True) if slope != 0)
        )

    own = list(changes.values())
    solved = elimination.solved([total(row[: len(own)], own) for row in rows[:n]], "change")
    sums = tuple(total(row, [*own, *elimination.solution("change")]) for row in rows[n:])
    known = {s for step in solved.values() for s in step.free_symbols if s in elimination.steps}
    kept = {s: factor(s) for s in sorted(known, key=str)}
    return LinearForms(
        {symbol: value for value, symbol in factors.items()},
        sums,
        {**whole.parts, **line.parts, **elimination.steps},
        {symbol: step.xreplace(kept) for symbol, step in solved.items()},
    )

"""Where a structure's equations are not smooth: every Abs, sign and positive part, as a mode frozen between events."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import sympy as sp

from rigsight.effects.symbols import derivative, positive_part, rate_along
from rigsight.errors import InputError
from rigsight.simulate.equations.elimination import Elimination
from rigsight.simulate.equations.straight_line import straight_line
from rigsight.simulate.equations.structure import Structure

_KINKS = (sp.Abs, sp.sign, positive_part)
MOST_FRICTIONS = 8
"""Largest number of joints with dry friction. Each sticks or slides in either direction; trying all 3^8 combinations at an event
takes a millisecond."""
_DIGITS = 40
"""Digits of the numbers at which an expression is evaluated."""
_ROUNDED = 1e-25
"""Size below which a value is rounding error."""


class absolute(sp.Function):  # type: ignore[misc]  # noqa: N801
    """Absolute value that is not replaced by a mode: the base of a power with a real exponent, smooth enough to need no event."""

    is_real = True
    is_nonnegative = True

    def fdiff(self, argindex: int = 1) -> sp.Expr:  # noqa: ARG002
        """Return the slope."""
        return sp.sign(self.args[0])


@dataclass(frozen=True)
class Friction:
    """Dry friction at a joint."""

    mode: int  # index of its sign among the modes
    # Index of the state that it holds at zero while it sticks; None if the joint's velocity is a sum of
    # several states.
    velocity: int | None
    alone: bool  # whether it affects no other velocity, so that the holding force need not be computed


@dataclass(frozen=True)
class FrozenStructure:
    """A structure with each kink's sign as a symbol."""

    # Expressions in states, parameters, `modes` and the symbols of `steps`; smooth between events.
    rates: tuple[sp.Expr, ...]
    outputs: tuple[sp.Expr, ...]
    modes: tuple[sp.Symbol, ...]  # symbols that take the values -1 and +1
    # Expression whose sign each mode is; it may contain modes of earlier switches.
    switches: tuple[sp.Expr, ...]
    # The modes of dry friction: signs of a velocity whose change makes its own acceleration jump, so that it
    # can stay at zero.
    frictions: tuple[Friction, ...]
    # The replacements of kinks, in the order in which they were made.
    replacements: tuple[Mapping[sp.Expr, sp.Expr], ...] = ()
    # Intermediate values computed before rates and outputs, as `Structure.remembering_steps`.
    steps: Mapping[sp.Symbol, sp.Expr] = field(default_factory=dict)

    @staticmethod
    def friction_sign(index: int) -> sp.Symbol:
        """Return the symbol of the sign of one of the frictions, which is its multiplier while it sticks."""
        return sp.Symbol(f"friction sign {index}", real=True)

    def friction_signs(self, structure: Structure) -> dict[sp.Expr, sp.Expr]:
        """Return the signs in the equations of velocities that dry friction can hold, each with its symbol."""
        found: dict[sp.Expr, sp.Expr] = {}
        expressions = [*(e.rate for e in structure.remembering_equations), *structure.computed_outputs]
        expressions += structure.remembering_steps.values()
        for atom in set().union(*(expression.atoms(sp.sign) for expression in expressions)):
            argument = atom.args[0]
            for replacement in self.replacements:
                argument = argument.xreplace(replacement)
            for index, own in enumerate(self.frictions):
                switch = self.switches[own.mode]
                if argument in (switch, -switch):
                    found[atom] = self.friction_sign(index) * (1 if argument == switch else -1)
        return found

    def speeds(self, structure: Structure) -> list[sp.Expr]:
        """Return the velocities that dry friction can hold, with their kinks not replaced."""
        of_signs = {sign: atom.args[0] for atom, sign in self.friction_signs(structure).items()}
        signs = [self.friction_sign(index) for index in range(len(self.frictions))]
        return [of_signs[sign] if sign in of_signs else -of_signs[-sign] for sign in signs]

    @property
    def single_friction(self) -> Friction | None:
        """The only dry friction, if there is exactly one, and it holds one velocity and affects no other."""
        found = self.frictions[0] if len(self.frictions) == 1 else None
        return found if found is not None and found.velocity is not None and found.alone else None

    @property
    def dependent_modes(self) -> tuple[int, ...]:
        """Indices of the modes whose switch contains another mode; they must be evaluated again when that mode changes."""
        return tuple(i for i, switch in enumerate(self.switches) if switch.free_symbols & set(self.modes))


@lru_cache(maxsize=256)
def freeze(structure: Structure) -> FrozenStructure:
    """Replace every Abs, sign and positive part in a structure's equations by a mode symbol."""
    constant = set(structure.parameter_symbols)
    expressions = [state.limited_rate for state in structure.remembering_equations]
    expressions += structure.computed_outputs
    # A kink of a delayed signal is an event when it occurs, because its history then has a corner at that instant.
    expressions += [history.signal for history in structure.histories]
    expressions += structure.remembering_steps.values()
    modes: dict[sp.Expr, sp.Symbol] = {}
    replacements = []
    while True:
        kink = _innermost_kink(expressions, constant)
        if kink is None:
            break
        argument = kink.args[0]
        flipped = argument.could_extract_minus_sign()
        switch = -argument if flipped else argument
        mode = modes.setdefault(switch, sp.Symbol(f"mode {len(modes)}", real=True))
        powers = {
            power: absolute(switch) ** power.exp
            for expression in expressions
            for power in expression.atoms(sp.Pow)
            if power.base == sp.Abs(argument) and not power.exp.is_Integer
        }
        signed = -mode if flipped else mode
        smooth = {
            sp.Abs: mode * switch,
            sp.sign: signed,
            positive_part: sp.Mul(argument, 1 + signed, sp.Rational(1, 2)),
        }
        # The kink itself is named too: sympy may write the function of the same argument anew in another form.
        replacement = powers | {kind(argument): by for kind, by in smooth.items()} | {kink: smooth[kink.func]}
        replacements.append(replacement)
        expressions = [expression.xreplace(replacement) for expression in expressions]
    n_states, n_rates = len(structure.states), len(structure.states) + len(structure.computed_outputs)
    n_steps = len(structure.remembering_steps)
    steps = expressions[len(expressions) - n_steps :]
    return FrozenStructure(
        rates=tuple(expressions[:n_states]),
        outputs=tuple(expressions[n_states:n_rates]),
        modes=tuple(modes.values()),
        switches=tuple(modes),
        frictions=_frictions(structure, modes, expressions, steps),
        replacements=tuple(replacements),
        steps=dict(zip(structure.remembering_steps, steps, strict=True)),
    )


def _innermost_kink(expressions: list[sp.Expr], constant: set[sp.Symbol]) -> sp.Expr | None:
    candidates = {
        atom
        for expression in expressions
        for atom in expression.atoms(*_KINKS)
        if not atom.args[0].atoms(*_KINKS) and not atom.free_symbols <= constant
    }
    return min(candidates, key=sp.default_sort_key) if candidates else None


def _frictions(
    structure: Structure, modes: dict[sp.Expr, sp.Symbol], expressions: list[sp.Expr], steps: list[sp.Expr]
) -> tuple[Friction, ...]:
    """Return the modes that are signs of velocities whose own accelerations jump with them."""
    velocities = structure.tree.motion.velocities
    rates = dict(zip(structure.states, expressions, strict=False))
    named = dict(zip(structure.remembering_steps, map(_of_sympy, steps), strict=True))
    found = []
    for index, (switch, mode) in enumerate(modes.items()):
        moved = [v for v in velocities if v in switch.free_symbols]
        if not moved or any(derivative(derivative(switch, a), b) != 0 for a in moved for b in moved):
            continue
        # At rest, one velocity follows from the others.
        standstill = {moved[0]: moved[0] - switch / derivative(switch, moved[0])}
        if structure.elimination is None:
            jump = rate_along(switch, {v: derivative(rates[v], mode) for v in moved})
            if is_zero(jump.subs(standstill)):
                continue
            alone = not any(mode in rates[v].free_symbols for v in velocities if v != moved[0])
        else:
            jumps = Jumps(structure.elimination, named, standstill)
            own = dict(zip(velocities, jumps.by(mode), strict=True))
            slopes = jumps.numbers([_of_sympy(derivative(switch, v)) for v in moved])
            if abs(sp.Add(*(slope * own[v] for slope, v in zip(slopes, moved, strict=True)))) < _ROUNDED:
                continue
            alone = not any(abs(own[v]) > _ROUNDED for v in velocities if v != moved[0])
        held = structure.states.index(moved[0]) if switch == moved[0] else None
        found.append(Friction(index, held, alone))
    if len(found) > MOST_FRICTIONS:
        raise InputError(
            f"{structure.rig.name} has dry friction at {len(found)} joints; at most {MOST_FRICTIONS} can stick and slip "
            f"together. Leave some out, or replace them by viscous damping."
        )
    return tuple(found)


def is_zero(expression: sp.Expr) -> bool:
    """Return True for an expression that is zero at an arbitrary point, because simplification by sympy would take seconds."""
    # Numbers are put in first: `evalf` with `subs` refines each nested sum that cancels, and takes minutes.
    expression = _of_sympy(expression)
    value = _number(expression, _arbitrary_place(expression.free_symbols))
    return bool(abs(value) < _ROUNDED) if value.is_number else False


def _of_sympy(expression: sp.Expr) -> sp.Expr:
    """Return an expression in functions that sympy can evaluate."""
    return expression.replace(absolute, sp.Abs).replace(positive_part, lambda part: sp.Max(part, 0))


class Jumps:
    """Derivatives of accelerations that are computed by elimination, with respect to symbols in the equations.

    While a joint rests, `still` has velocities in terms of the others, without symbols of `steps`, which sympy must be able to
    evaluate.
    """

    def __init__(
        self, elimination: Elimination, steps: Mapping[sp.Symbol, sp.Expr], still: Mapping[sp.Symbol, sp.Expr]
    ) -> None:
        self._elimination, self._steps = elimination, steps
        known = set().union(*(e.free_symbols for e in (*steps.values(), *still.values(), *still))) - set(
            steps
        )
        self._place = _arbitrary_place(known)
        self._place |= {velocity: _number(value, self._place) for velocity, value in still.items()}

    def by(self, mode: sp.Symbol) -> list[sp.Expr]:
        """Return the derivative of each acceleration with respect to a symbol in masses and loads."""
        steps, elimination = self._steps, self._elimination
        pushes = [
            _slope_by(steps[load], mode)
            - sp.Add(*(_slope_by(steps[mass], mode) * a for mass, a in elimination.moved(i)))
            for i, load in enumerate(elimination.loads)
        ]
        solved = elimination.solved(pushes, "jump")
        return self.numbers(elimination.solution("jump"), solved)

    def numbers(
        self, expressions: Sequence[sp.Expr], further: Mapping[sp.Symbol, sp.Expr] | None = None
    ) -> list[sp.Expr]:
        """Return the values of expressions at the point."""
        line = straight_line(expressions, {**self._steps, **(further or {})})
        numbers = dict(self._place)
        for symbol, part in line.parts.items():
            numbers[symbol] = _number(part, numbers)
        return [_number(result, numbers) for result in line.results]


def _arbitrary_place(symbols: Iterable[sp.Symbol]) -> dict[sp.Symbol, sp.Expr]:
    ordered = enumerate(sorted(symbols, key=str))
    return {s: (sp.sqrt(sp.prime(5 + i)) / (3 + i % 7)).evalf(_DIGITS) for i, s in ordered}


def _number(expression: sp.Expr, numbers: Mapping[sp.Symbol, sp.Expr]) -> sp.Expr:
    return expression.xreplace(numbers).evalf(_DIGITS)


def _slope_by(expression: sp.Expr, symbol: sp.Symbol) -> sp.Expr:
    # Term by term, because few terms of a long sum contain the symbol.
    terms = [term for term in sp.Add.make_args(expression) if symbol in term.free_symbols]
    return sp.Add(*(derivative(term, symbol) for term in terms))

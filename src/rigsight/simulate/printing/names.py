"""What is each symbol of a structure called where people read it: which letter, with which words below and dots above?"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

import sympy as sp

from rigsight.simulate.equation_tree import Kind
from rigsight.simulate.structure import INPUT, INPUT_RATE, TIME, Structure

GREEK = frozenset({
    "alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "kappa", "lambda", "mu", "nu", "xi", "rho", "sigma",
    "tau", "phi", "chi", "psi", "omega",
})  # fmt: skip
"""Names that are letters; a language writes them as such."""
_LETTERS = {
    Kind.SPRING: ("T", "spring"),
    Kind.TORQUE: ("T",),
    Kind.DEFLECTION: ("x", "spring"),
    Kind.LATERAL: ("c",),
}


@dataclass(frozen=True)
class ShownName:
    """A name as people read it.

    Attributes
    ----------
    letter
        What stands on the line: a letter, the name of a Greek one, or a word.
    below
        Marks and words below it.
    dots
        Number of derivatives with respect to time.
    """

    letter: str
    below: tuple[str, ...] = ()
    dots: int = 0

    @property
    def plain(self) -> str:
        """The name on one line; no two names share it, and it sorts like the declared one."""
        return "_".join((self.letter, *self.below)) + "'" * self.dots

    def dotted(self) -> ShownName:
        """Return the name of the rate."""
        return replace(self, dots=self.dots + 1)

    def beside(self, word: str) -> ShownName:
        """Return the name with one more word below."""
        return replace(self, below=(*self.below, word))


def named(expression: sp.Expr, names: Mapping[sp.Symbol, ShownName]) -> sp.Expr:
    """Return an expression whose symbols are called as people read them, so that a printer puts them in that order."""
    return expression.xreplace({s: sp.Symbol(name.plain, real=True) for s, name in names.items()})


def in_words(name: str) -> str:
    """Return an effect's name as words."""
    return name.replace("_", " ")


def declared_name(name: str) -> ShownName:
    """Return a declared name as people read it: ``k_c`` is k with c below, ``z0`` is z with 0 below."""
    letter, _, below = name.partition("_")
    if match := re.fullmatch(r"([A-Za-z])(\d+)", letter):
        return ShownName(match[1], tuple(filter(None, (match[2], below.replace("_", " ")))))
    return ShownName(letter, (below.replace("_", " "),) if below else ())


def rate_symbol(symbol: sp.Symbol) -> sp.Symbol:
    """Return the symbol that stands for the rate of a state."""
    return sp.Symbol(f"d({symbol.name})", real=True)


def shown_names(structure: Structure, label: Callable[[str], str] = in_words) -> dict[sp.Symbol, ShownName]:
    """Return the name of every symbol in a structure's tree, of the rates of its states and of its outputs.

    Parameters
    ----------
    structure
        Rig and effects.
    label
        An effect's name for people.

    Notes
    -----
    Where two effects, or an effect and the rig, call something the same, those of effects carry their effect's name below.
    """
    rig, tree = structure.rig, structure.tree
    source = declared_name(rig.inputs[0].name)
    moving = declared_name((rig.outputs if rig.is_driven else rig.inputs)[0].name)
    names = {TIME: ShownName("t"), INPUT: source}
    if not rig.is_driven:
        names[INPUT_RATE] = moving.dotted()
    for coordinate, velocity in zip(tree.motion.coordinates, tree.motion.velocities, strict=True):
        names |= {
            coordinate: moving,
            velocity: moving.dotted(),
            rate_symbol(velocity): moving.dotted().dotted(),
        }
    parameters = zip(structure.parameter_symbols, structure.names, strict=True)
    states = ((state.symbol, state.symbol.name) for state in tree.states)
    names |= _told_apart([*parameters, *states], names.values(), label)
    for state, rate in kinematic_states(structure).items():
        names[rate] = names[state].dotted()
    for state in tree.states:
        names[rate_symbol(state.symbol)] = names[state.symbol].dotted()
    for definition in tree.definitions:
        owner = () if definition.owner is None else (label(definition.owner),)
        if definition.rate_of is not None:
            names[definition.symbol] = names[definition.rate_of].dotted()
        elif definition.kind in _LETTERS:
            letter, *words = _LETTERS[definition.kind]
            names[definition.symbol] = ShownName(letter, (*words, *owner))
        else:
            before = source if definition.kind is Kind.DRIVE else moving
            names[definition.symbol] = ShownName(before.letter, (*before.below, *owner))
    for output in tree.outputs:
        name = declared_name(output.name)
        names[output_symbol(output.name)] = name.beside("measured") if name in names.values() else name
    return names


def output_symbol(name: str) -> sp.Symbol:
    """Return the symbol that stands for an output where it is more than a state."""
    return sp.Symbol(f"output {name}", real=True)


def kinematic_states(structure: Structure) -> dict[sp.Symbol, sp.Symbol]:
    """Return the states whose rate is another state of the same effect, with that state: a dot says it all."""
    found: dict[sp.Symbol, sp.Symbol] = {}
    states = {state.symbol: state for state in structure.tree.states}
    for symbol, state in states.items():
        other = states.get(state.rate)
        if (
            other is not None
            and other.owner == state.owner
            and other.symbol not in {*found, *found.values(), symbol}
            and state.limit is None
        ):
            found[symbol] = other.symbol
    return found


def _told_apart(
    sources: list[tuple[sp.Symbol, str]], taken: Iterable[ShownName], label: Callable[[str], str]
) -> dict[sp.Symbol, ShownName]:
    own = {symbol: declared_name(source.rpartition(".")[2]) for symbol, source in sources}
    every = [*taken, *own.values()]
    return {
        symbol: own[symbol].beside(label(source.rpartition(".")[0]))
        if "." in source and every.count(own[symbol]) > 1
        else own[symbol]
        for symbol, source in sources
    }

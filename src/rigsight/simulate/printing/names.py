"""Displayed name of each symbol of a structure: letter, subscript and dots."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

import sympy as sp

from rigsight.effects import kind_of
from rigsight.rigs import Rig
from rigsight.simulate.equations.structure import TIME, Structure, input_symbols
from rigsight.simulate.equations.tree import Kind

GREEK = frozenset({
    "alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "kappa", "lambda", "mu", "nu", "xi", "rho", "sigma",
    "tau", "phi", "chi", "psi", "omega",
})  # fmt: skip
"""Names of Greek letters, which are printed as letters."""
_LETTERS = {
    Kind.SPRING: ("T", "spring"),
    Kind.TORQUE: ("T",),
    Kind.LOAD: ("L",),
    Kind.DEFLECTION: ("x", "spring"),
    Kind.LATERAL: ("c",),
}


@dataclass(frozen=True)
class ShownName:
    """A displayed name."""

    letter: str  # the name without subscript: a letter, the name of a Greek letter, or a word
    below: tuple[str, ...] = ()  # words of the subscript
    dots: int = 0  # number of derivatives with respect to time

    @property
    def plain(self) -> str:
        """The name on one line; it is unique and sorts like the declared name."""
        return "_".join((self.letter, *self.below)) + "'" * self.dots

    def dotted(self) -> ShownName:
        """Return the name of the rate."""
        return replace(self, dots=self.dots + 1)

    def beside(self, word: str) -> ShownName:
        """Return the name with one more word in the subscript."""
        return replace(self, below=(*self.below, word))


def named(expression: sp.Expr, names: Mapping[sp.Symbol, ShownName]) -> sp.Expr:
    """Return an expression whose symbols have their displayed names, so that a printer sorts by these names."""
    return expression.xreplace({s: sp.Symbol(name.plain, real=True) for s, name in names.items()})


def in_words(name: str) -> str:
    """Return an effect's name as words: ``"coulomb friction at load bearing"``."""
    return name.replace("_", " ").replace("@", " at ")


def declared_name(name: str) -> ShownName:
    """Return the displayed form of a declared name: ``k_c`` is k with subscript c, ``z0`` is z with subscript 0."""
    letter, _, below = name.partition("_")
    if match := re.fullmatch(r"([A-Za-z])(\d+)", letter):
        return ShownName(match[1], tuple(filter(None, (match[2], below.replace("_", " ")))))
    return ShownName(letter, (below.replace("_", " "),) if below else ())


def declared_names(names: Iterable[str]) -> dict[str, ShownName]:
    """Return the displayed forms of declared names; of ``r0`` beside ``r_0``, the first one stays undivided."""
    shown = {name: declared_name(name) for name in names}
    counts = Counter(shown.values())
    return {
        name: ShownName(name) if counts[form] > 1 and form.plain != name else form
        for name, form in shown.items()
    }


def rate_symbol(symbol: sp.Symbol) -> sp.Symbol:
    """Return the symbol of the rate of a state."""
    return sp.Symbol(f"d({symbol.name})", real=True)


def shown_names(structure: Structure, label: Callable[[str], str] = in_words) -> dict[sp.Symbol, ShownName]:
    """Return the name of every symbol in a structure's tree, of the rates of its states and of its outputs."""
    # If two effects, or an effect and the rig, use the same name, that of an effect gets the effect's name as a subscript. A
    # prescribed motion has the name of the input that it follows.
    rig, tree = structure.rig, structure.tree
    coordinates, owned = tree.motion.coordinates, _owned(structure)
    forms = declared_names(
        [*rig.mechanism.inputs, *(symbol.name for symbol in coordinates), *(name for _, name, _ in owned)]
    )
    names = {TIME: ShownName("t"), **_input_names(rig, forms)}
    for coordinate, velocity in zip(coordinates, tree.motion.velocities, strict=True):
        own = forms[coordinate.name]
        names |= {coordinate: own, velocity: own.dotted(), rate_symbol(velocity): own.dotted().dotted()}
    names |= _distinguished(owned, forms, names.values(), label)
    for state, rate in kinematic_states(structure).items():
        names[rate] = names[state].dotted()
    for state in tree.states:
        names[rate_symbol(state.symbol)] = names[state.symbol].dotted()
    signals = _signal_names(structure)
    for definition in tree.definitions:
        if definition.rate_of is not None:
            names[definition.symbol] = names[definition.rate_of].dotted()
        elif definition.owner is None:
            names[definition.symbol] = _free(declared_name(str(definition.name)), names)
        elif definition.kind in _LETTERS:
            letter, *words = _LETTERS[definition.kind]
            names[definition.symbol] = ShownName(letter, (*words, label(definition.owner)))
        else:
            # The signal's name implies the place, which is added only if two effects change signals of the same name.
            before, kind = signals[definition.owner], label(kind_of(definition.owner))
            short = before.beside(kind)
            names[definition.symbol] = (
                before.beside(label(definition.owner)) if short in names.values() else short
            )
    names |= _of_elimination(structure, names.values())
    names |= _of_bodies(structure)
    for output in tree.outputs:
        names[output_symbol(output.name)] = _free(declared_name(output.name), names)
    return names


def _input_names(rig: Rig, forms: Mapping[str, ShownName]) -> dict[sp.Symbol, ShownName]:
    """Return the names of the inputs, and of the rates of those that prescribe a motion."""
    names = {}
    for index, source in enumerate(rig.mechanism.inputs):
        value, rate, curvature = input_symbols(index)
        names[value] = forms[source]
        if source in rig.mechanism.prescribing:
            names |= {rate: names[value].dotted(), curvature: names[value].dotted().dotted()}
    return names


def _owned(structure: Structure) -> list[tuple[sp.Symbol, str, str | None]]:
    """Return parameters, and states other than the motion: symbol, own name, and the effect to which it belongs."""
    of_effects = {
        structure.parameter_name(effect, parameter.name): (parameter.name, effect.name)
        for effect in structure.effects
        for parameter in effect.parameters
    }
    parameters = zip(structure.parameter_symbols, structure.names, strict=True)
    owned = [(symbol, *of_effects.get(name, (name, None))) for symbol, name in parameters]
    return owned + [(s.symbol, s.symbol.name.rpartition(".")[2], s.owner) for s in structure.tree.states]


def _of_elimination(structure: Structure, taken: Iterable[ShownName]) -> dict[sp.Symbol, ShownName]:
    """Return the names of masses and generalized forces, if the equations of motion are too long without them."""
    if structure.elimination is None:
        return {}
    masses = structure.elimination.mass.items()
    names = {mass: ShownName("M", (str(i + 1), str(j + 1))) for (i, j), mass in masses}
    for i, load in enumerate(structure.elimination.loads):
        names[load] = ShownName("h", (str(i + 1),))
    every = set(taken)
    return {s: name.beside("motion") if name in every else name for s, name in names.items()}


def _of_bodies(structure: Structure) -> dict[sp.Symbol, ShownName]:
    """Return the names of the masses and forces computed by another simulator."""
    bodies, n = structure.rig.mechanism.bodies, len(structure.tree.motion.coordinates)
    if bodies is None:
        return {}
    masses = [(i, j) for i in range(n) for j in range(i + 1)]
    names = {simulated_symbol(at): ShownName("M", (*(str(i + 1) for i in at), bodies.kind)) for at in masses}
    return names | {simulated_symbol((i,)): ShownName("h", (str(i + 1), bodies.kind)) for i in range(n)}


def simulated_symbol(place: tuple[int, ...]) -> sp.Symbol:
    """Return the symbol of a value computed by another simulator, by row and column of a mass, or row of a force."""
    return sp.Symbol(" ".join(("simulated", *map(str, place))), real=True)


def _signal_names(structure: Structure) -> dict[str, ShownName]:
    """Return, by effect, the name of the signal of the drive or sensor that it changes."""
    mechanism = structure.rig.mechanism
    shown = {sensor.name: sensor.name for sensor in mechanism.sensors}
    for drive in mechanism.drives:
        # A drive with a single signal is displayed by the name of that signal, such as u.
        one = drive.signal.is_Symbol and drive.signal.name.isidentifier()
        shown[drive.name] = drive.signal.name if one else drive.name
    places = {effect.name: structure.rig.acts_at(effect) for effect in structure.effects}
    return {effect: declared_name(shown[place]) for effect, place in places.items() if place in shown}


def _free(name: ShownName, names: Mapping[sp.Symbol, ShownName]) -> ShownName:
    """Return a name for a measured quantity, different from that of a coordinate, whose value may differ."""
    return name.beside("measured") if name in names.values() else name


def output_symbol(name: str) -> sp.Symbol:
    """Return the symbol of an output that is not just a state."""
    return sp.Symbol(f"output {name}", real=True)


def kinematic_states(structure: Structure) -> dict[sp.Symbol, sp.Symbol]:
    """Return the states whose rate is another state of the same effect, with that state; a dot replaces the equation."""
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


def _distinguished(
    sources: list[tuple[sp.Symbol, str, str | None]],
    forms: Mapping[str, ShownName],
    taken: Iterable[ShownName],
    label: Callable[[str], str],
) -> dict[sp.Symbol, ShownName]:
    own = {symbol: forms[name] for symbol, name, _ in sources}
    every = [*taken, *own.values()]
    return {
        symbol: own[symbol].beside(label(owner))
        if owner is not None and every.count(own[symbol]) > 1
        else own[symbol]
        for symbol, _, owner in sources
    }

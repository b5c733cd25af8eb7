"""Content of the picture of a rig: bodies and states in rows, and the joints, drives and sensors that connect to them."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations
from typing import Any, Literal

import sympy as sp

from rigsight.effects.symbols import derivative
from rigsight.rigs import Drive, Joint, Rig, Sensor, force_symbol, reading_symbol

_MOST_ORDERED = 7
"""Bodies whose orders are all tried, 5040 of them; more keep the order of the file."""
_LONGEST = 32
"""Characters of a line; what is longer is wrapped."""


@dataclass(frozen=True)
class Body:
    """A row of the picture: a degree of freedom, a prescribed motion, or a state."""

    # Its name, and with its unit.
    name: str
    title: str
    kind: Literal["free", "prescribed", "state"]  # what it is
    lines: tuple[str, ...]  # what else is said of it
    input: str | None = None  # input that prescribes it
    reads: tuple[int, ...] = ()  # indices of the bodies that the rate of a state reads


@dataclass(frozen=True)
class Place:
    """A joint, drive or sensor: its name, its lines of text and the indices of the bodies that it belongs to."""

    name: str
    title: str
    lines: tuple[str, ...]
    bodies: tuple[int, ...]
    # For a joint, what resists in it.
    spring: bool = False
    damper: bool = False
    grounded: bool = False  # for a joint, True if it stands between one body and the ground
    # For a drive, the inputs and the sensors that its signal reads, through other signals and states too.
    inputs: tuple[str, ...] = ()
    sensors: tuple[str, ...] = ()


@dataclass(frozen=True)
class RigContent:
    """Everything that the picture shows."""

    bodies: tuple[Body, ...]  # from top to bottom
    # In the order of the file.
    joints: tuple[Place, ...]
    drives: tuple[Place, ...]
    sensors: tuple[Place, ...]
    # Indices of two bodies next to each other whose motions the energies couple, and what does it.
    couplings: tuple[tuple[int, int, str], ...]


def rig_content(rig: Rig) -> RigContent:
    """Return what the picture of a rig shows."""
    return _Reader(rig).content()


class _Reader:
    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self._mechanism = rig.mechanism
        self._coupled = self._coupled_pairs()
        names = self._ordered([c.name for c in self._mechanism.coordinates])
        self._row = {name: index for index, name in enumerate(names)}
        for state in self._mechanism.states:
            self._row[state.name] = len(self._row)

    def content(self) -> RigContent:
        coordinates = {c.name: c for c in self._mechanism.coordinates}
        bodies = [self._body(coordinates[name]) for name in self._row if name in coordinates]
        bodies += [self._state(state) for state in self._mechanism.states]
        return RigContent(
            tuple(bodies),
            tuple(self._joint(joint) for joint in self._mechanism.joints),
            tuple(self._drive(drive) for drive in self._mechanism.drives),
            tuple(self._sensor(sensor) for sensor in self._mechanism.sensors),
            tuple(
                (min(self._row[a], self._row[b]), max(self._row[a], self._row[b]), what)
                for (a, b), what in self._coupled.items()
                if abs(self._row[a] - self._row[b]) == 1
            ),
        )

    def _coupled_pairs(self) -> dict[tuple[str, str], str]:
        """Return the pairs of coordinates whose motions the energies couple."""
        found = {}
        mechanism = self._mechanism
        for a, b in combinations(mechanism.coordinates, 2):
            if derivative(derivative(mechanism.kinetic, a.rate), b.rate) != 0:
                found[a.name, b.name] = "coupled inertia"
            elif b.symbol in derivative(mechanism.potential, a.symbol).free_symbols:
                found[a.name, b.name] = "coupled potential"
        return found

    def _ordered(self, names: list[str]) -> Sequence[str]:
        """Return the coordinates in the order in which joints between them are shortest."""
        if not 2 < len(names) <= _MOST_ORDERED:
            return names
        pairs = [self._moved(joint.motion) for joint in self._mechanism.joints]
        pairs = [pair for pair in pairs if len(pair) > 1]
        pairs += list(self._coupled)

        def length(order: Sequence[str]) -> tuple[int, int]:
            place = {name: index for index, name in enumerate(order)}
            joined = sum(max(place[n] for n in pair) - min(place[n] for n in pair) for pair in pairs)
            return joined, sum(abs(place[name] - index) for index, name in enumerate(names))

        return min(permutations(names), key=length)

    def _moved(self, expression: sp.Expr) -> tuple[str, ...]:
        return tuple(
            c.name for c in self._mechanism.coordinates if {c.symbol, c.rate} & expression.free_symbols
        )

    def _reached(self, expression: sp.Expr, through_states: bool = False) -> set[sp.Symbol]:
        """Return the symbols that an expression reads, through signals and, for a loop, sensors and states too."""
        mechanism = self._mechanism
        through: dict[sp.Symbol, sp.Expr] = dict(mechanism.signals)
        if through_states:
            through |= {state.symbol: state.rate for state in mechanism.states}
        found: set[sp.Symbol] = set()
        waiting = list(expression.free_symbols)
        while waiting:
            symbol = waiting.pop()
            if symbol not in found:
                found.add(symbol)
                waiting.extend(through[symbol].free_symbols if symbol in through else ())
        return found

    def _rows(self, symbols: Iterable[sp.Symbol]) -> tuple[int, ...]:
        present = set(symbols)
        for joint in self._mechanism.joints:
            if force_symbol(joint.name) in present:
                present |= joint.motion.free_symbols
        own = {c.symbol: c.name for c in self._mechanism.coordinates}
        own |= {c.rate: c.name for c in self._mechanism.coordinates}
        own |= {state.symbol: state.name for state in self._mechanism.states}
        return tuple(sorted({self._row[own[symbol]] for symbol in present if symbol in own}))

    def _written(self, table: str, name: str, key: str, expression: sp.Expr) -> str:
        """Return an expression as its file writes it; as sympy does where there is no file."""
        declared: Any = self._rig.declaration.get(table, {}).get(name, {}).get(key)
        text = str(declared if declared is not None else expression)
        return text.replace("**", "^").replace("reading of ", "")

    def _numbers(self, expression: sp.Expr) -> str:
        known = [p.name for p in (*self._rig.parameters, *self._rig.constants)]
        present = {symbol.name for symbol in expression.free_symbols}
        return _listed([name for name in known if name in present])

    def _body(self, coordinate: Any) -> Body:
        mechanism = self._mechanism
        title = f"{coordinate.name} [{coordinate.unit}]"
        lines = textwrap.wrap(coordinate.about, 24)[:2]
        if coordinate.prescribed_by is not None:
            return Body(
                coordinate.name, title, "prescribed", (*lines, "prescribed motion"), coordinate.prescribed_by
            )
        index = mechanism.free.index(coordinate)
        inertia = self._numbers(mechanism.mass_matrix[index, index])
        potential = self._numbers(derivative(mechanism.potential, coordinate.symbol))
        lines += [f"inertia {inertia}"] if inertia else []
        lines += [f"potential {potential}"] if potential else []
        return Body(coordinate.name, title, "free", tuple(lines))

    def _state(self, state: Any) -> Body:
        rate = self._written("states", state.name, "rate", state.rate)
        lines = (*textwrap.wrap(state.about, 24)[:2], *_wrapped(f"rate {rate}"))
        reads = (row for row in self._rows(self._reached(state.rate)) if row != self._row[state.name])
        return Body(state.name, f"{state.name} [{state.unit}]", "state", lines, reads=tuple(reads))

    def _joint(self, joint: Joint) -> Place:
        parts = [
            f"{what} {self._written('joints', joint.name, what, value)}"
            for what, value in (
                ("stiffness", joint.stiffness),
                ("damping", joint.damping),
                ("force", joint.force),
            )
            if value != 0
        ]
        bodies = self._rows(joint.motion.free_symbols)
        return Place(
            joint.name,
            joint.name,
            tuple(line for part in parts for line in _wrapped(part)),
            bodies,
            spring=joint.stiffness != 0,
            damper=joint.damping != 0,
            grounded=len(bodies) == 1,
        )

    def _drive(self, drive: Drive) -> Place:
        reached = self._reached(drive.signal, through_states=True)
        signal = self._written("drives", drive.name, "signal", drive.signal)
        force = self._written("drives", drive.name, "force", drive.force)
        along = self._written("drives", drive.name, "along", drive.along)
        lines = [f"signal {signal}"]
        lines += [] if force == drive.name else [f"force {force}"]
        lines += [] if drive.along.is_Symbol else [f"along {along}"]
        return Place(
            drive.name,
            drive.name,
            tuple(line for own in lines for line in _wrapped(own)),
            self._rows(drive.along.free_symbols),
            inputs=tuple(s.name for s in self._rig.inputs if sp.Symbol(s.name, real=True) in reached),
            sensors=tuple(s.name for s in self._mechanism.sensors if reading_symbol(s.name) in reached),
        )

    def _sensor(self, sensor: Sensor) -> Place:
        reads = self._written("sensors", sensor.name, "reads", sensor.reads)
        lines = () if reads == sensor.name else _wrapped(f"reads {reads}")
        rows = self._rows(self._reached(sensor.reads))
        return Place(sensor.name, f"{sensor.name} [{sensor.unit}]", lines, rows or (0,))


def _wrapped(text: str) -> tuple[str, ...]:
    """Return a text in at most two lines."""
    lines = textwrap.wrap(text, _LONGEST, break_long_words=False)
    if len(lines) > 2:
        lines = [lines[0], f"{lines[1]} \u2026"]
    return tuple(line if len(line) <= _LONGEST + 2 else f"{line[:_LONGEST]}\u2026" for line in lines)


def _listed(names: Sequence[str]) -> str:
    """Return names as far as they fit in a line, and how many more there are."""
    for count in range(len(names), 1, -1):
        shown = ", ".join(names[:count]) + (f" and {len(names) - count} more" if count < len(names) else "")
        if len(shown) <= _LONGEST - len("potential "):
            return shown
    return names[0] if len(names) == 1 else f"{names[0]} and {len(names) - 1} more" if names else ""

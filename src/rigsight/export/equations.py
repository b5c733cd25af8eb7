"""Which equations, numbers and names does every export write down, whatever its language?"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

import sympy as sp

from rigsight.effects import Place
from rigsight.errors import InputError
from rigsight.export.reserved_words import RESERVED
from rigsight.parameters import Parameter
from rigsight.simulate import parameter_vector
from rigsight.simulate.composition import without_vanished_effects
from rigsight.simulate.input_hold import Hold
from rigsight.simulate.kinks import FrozenStructure, freeze
from rigsight.simulate.model import Model
from rigsight.simulate.structure import INPUT, INPUT_RATE, TIME, Structure
from rigsight.units import unit_text


@dataclass(frozen=True)
class Quantity:
    """A named number or signal: its name in the export, its name in the model, unit and description."""

    name: str
    source: str
    unit: str
    description: str


@dataclass(frozen=True)
class Rest:
    """What the static equilibrium at the first input is found with; expressions of parameters.

    Attributes
    ----------
    displacement, inertia, stiffness
        Rest position, inertia and stiffness of the moving mass.
    damping
        Name of the damping parameter, raised to the critical value on the way to rest.
    silenced
        Names of the parameters of disturbances, zero on the way to rest.
    """

    displacement: sp.Expr
    inertia: sp.Expr
    stiffness: sp.Expr
    damping: str
    silenced: tuple[str, ...]


@dataclass(frozen=True)
class Exported:
    """A model in the form that every target prints.

    Attributes
    ----------
    structure
        Rig and effects, without those that have vanished.
    frozen
        The same with the sign of every kink as a mode that rests between events.
    hold
        How the input behaves between its samples.
    step
        Longest internal step [s] of a fixed-step integrator.
    parameters, values
        The parameters and their numbers.
    states, inputs, outputs
        The signals; a prescribed motion has its rate as second input.
    rest
        How the equilibrium is found; None where the motion is prescribed.
    """

    structure: Structure
    frozen: FrozenStructure
    hold: Hold
    step: float
    parameters: tuple[Quantity, ...]
    values: tuple[float, ...]
    states: tuple[Quantity, ...]
    inputs: tuple[Quantity, ...]
    outputs: tuple[Quantity, ...]
    rest: Rest | None

    @property
    def limits(self) -> dict[int, sp.Expr]:
        """Half-width of the range of each state that has one, by its index."""
        return {i: e.limit for i, e in enumerate(self.structure.equations) if e.limit is not None}

    @property
    def title(self) -> str:
        """Rig and effects in words."""
        effects = ", ".join(self.structure.effect_names)
        return harmless(f"{self.structure.rig.name} with {effects}" if effects else self.structure.rig.name)

    def names(self) -> dict[sp.Symbol, str]:
        """Return the name of every symbol in the equations but the modes."""
        structure = self.structure
        signals = {INPUT: self.inputs[0].name, TIME: "time"}
        if len(self.inputs) > 1:
            signals[INPUT_RATE] = self.inputs[1].name
        parameters = zip(structure.parameter_symbols, self.parameters, strict=True)
        states = zip(structure.states, self.states, strict=True)
        return {**signals, **{symbol: quantity.name for symbol, quantity in (*parameters, *states)}}


def _check_delays(structure: Structure) -> None:
    """Refuse delays but that of the only input and that of the first sensor."""
    remembered = {history.symbol.name.partition(":")[0] for history in structure.histories}
    late = [e.name for e in structure.effects if e.name in remembered]
    late += [
        output.name
        for output, delay in zip(structure.rig.outputs[1:], structure.shown_late[1:], strict=True)
        if delay is not None
    ]
    if late:
        raise InputError(
            f"A delay at {', '.join(late)} cannot be exported: that of the only input and that of the first sensor can. "
            "Simulate the model here, or leave the delay out."
        )


def exported(model: Model, hold: Hold, step: float) -> Exported:
    """Return a model in the form that every target prints.

    Parameters
    ----------
    model
        The model; effects whose parameters have their null values are left out.
    hold
        How the input behaves between its samples.
    step
        Longest internal step [s].

    Raises
    ------
    InputError
        If a parameter has no value, or something is late for which no target has a memory.
    """
    structure, values = without_vanished_effects(model.structure, model.values)
    _check_delays(structure)
    names = _Names()
    inputs = [names.quantity(s.name, s.name, s.unit, s.description) for s in structure.rig.inputs]
    if not structure.rig.is_driven:
        source, time = structure.rig.inputs[0], structure.rig.units["time"]
        rate = f"{source.name}_rate"
        inputs.append(names.quantity(rate, rate, f"{source.unit}/{time}", f"rate of {source.name}"))
    shown = _Names()
    outputs = [shown.quantity(s.name, s.name, s.unit, s.description) for s in structure.rig.outputs]
    units = {**structure.rig.units, "drive": structure.rig.units["force"]}
    parameters = tuple(
        names.quantity(p.name, p.name, p.unit or unit_text(p.dimension, units), p.description)
        for p in structure.parameters
    )
    return Exported(
        structure=structure,
        frozen=freeze(structure),
        hold=hold,
        step=step,
        parameters=parameters,
        values=tuple(float(value) for value in parameter_vector(structure, values)),
        states=tuple(
            names.quantity(e.symbol.name, e.symbol.name, unit_text(e.dimension, units), "state")
            for e in structure.equations
        ),
        inputs=tuple(inputs),
        outputs=tuple(outputs),
        rest=_rest(structure, {p.source: p.name for p in parameters}),
    )


def _rest(structure: Structure, names: dict[str, str]) -> Rest | None:
    motion = structure.rig.motion
    if motion.inertia is None:
        return None
    bound = dict(zip(structure.names, structure.parameter_symbols, strict=True))

    def of_parameters(expression: sp.Expr) -> sp.Expr:
        return expression.xreplace({s: bound[s.name] for s in expression.free_symbols})

    disturbances: Iterable[tuple[str, Parameter]] = (
        (structure.parameter_name(effect, p.name), p)
        for effect in structure.effects
        if effect.place is Place.DISTURBANCE
        for p in effect.parameters
    )
    return Rest(
        displacement=of_parameters(motion.rest),
        inertia=of_parameters(motion.inertia),
        stiffness=of_parameters(motion.stiffness),
        damping=names[motion.damping.name],
        silenced=tuple(names[name] for name, _ in disturbances if name in names),
    )


class _Names:
    """Makes names that are words in every target and that occur once.

    Outputs have their own, as most are the state of the same name.
    """

    def __init__(self) -> None:
        self._used: set[str] = set()

    def quantity(self, wished: str, source: str, unit: str, description: str) -> Quantity:
        """Return a quantity under the wished name, or one like it."""
        name = re.sub(r"[^0-9A-Za-z_]+", "_", wished).strip("_") or "value"
        if name[0].isdigit():
            name = f"n_{name}"
        while name in self._used or name in RESERVED or re.fullmatch(r"(part|constant_)\d+", name):
            name += "_"
        self._used.add(name)
        return Quantity(name, source, harmless(unit), harmless(description))


def harmless(text: str) -> str:
    """Return text that ends no comment and no string of any target, on one line."""
    plain = "".join(c if c.isprintable() else " " for c in text).replace('"', "'").replace("\\", "/")
    return " ".join(plain.replace("*/", "* /").split())

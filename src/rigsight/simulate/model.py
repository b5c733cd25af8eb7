"""A complete simulation as data: rig, effects, all parameter values, the hold of the input."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import sympy as sp

from rigsight.effects import Effect
from rigsight.records.record import Floats
from rigsight.simulate.equations.composition import compose
from rigsight.simulate.equations.structure import Structure
from rigsight.simulate.input_hold import Hold

SCHEMA_VERSION = 1


@dataclass(frozen=True)
class Model:
    """A complete simulation.

    Attributes
    ----------
    structure
        Rig and effects; no parameter is written into the equations as a number.
    values
        Value of every parameter.
    hold
        Hold of the input between samples.
    """

    structure: Structure
    values: dict[str, float]
    hold: Hold

    # The repr of a dataclass would contain every symbol of the rig.
    def __repr__(self) -> str:
        effects = list(self.structure.effect_names)
        return f"Model(rig={self.structure.rig.name!r}, effects={effects!r}, hold={self.hold!r})"

    @classmethod
    def of(cls, structure: Structure, values: Mapping[str, float], hold: Hold) -> Model:
        """Make a model from a fitted structure; values written into its equations as numbers become parameters again.

        Parameters
        ----------
        structure
            Rig and effects.
        values
            Value of each of its parameters, by name [SI].
        hold
            Hold of the input between samples.
        """
        complete = {**values, **dict(structure.fixed)}
        whole = compose(structure.rig, structure.effects)
        return cls(whole, {name: complete[name] for name in whole.names}, hold)

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The effects of the model."""
        return self.structure.effects

    def to_json(self) -> dict[str, Any]:
        """Return the content of ``model.json``."""
        rig = self.structure.rig
        constants = {p.name for p in rig.constants}
        own = {p.name for p in rig.parameters}
        units = {p.name: p.unit for p in self.structure.parameters}
        return {
            "schema_version": SCHEMA_VERSION,
            "rig": rig.name,
            # Included so that neither the user's rig file nor this version of a built-in rig is needed.
            **({"declaration": dict(rig.declaration)} if rig.declaration else {}),
            "hold": self.hold,
            "constants": {n: v for n, v in self.values.items() if n in constants},
            "parameters": {n: v for n, v in self.values.items() if n in own},
            "effects": [effect.name for effect in self.effects],
            "effect_parameters": {
                n: v for n, v in self.values.items() if n not in constants and n not in own
            },
            "units": units,
        }


def at_parameters(structure: Structure, expression: sp.Expr, p: Floats) -> Any:
    """Return the value of an expression."""
    return _function(structure.parameter_symbols, expression)(*p)


@lru_cache(maxsize=1024)
def _function(symbols: tuple[sp.Symbol, ...], expression: sp.Expr) -> Any:
    return sp.lambdify(symbols, expression, "numpy")

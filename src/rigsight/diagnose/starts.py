"""From which values the fit of a candidate is started: its own guesses, and the fits of simpler effects."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping

import sympy as sp

from rigsight.diagnose.workbench import Workbench
from rigsight.effects import Effect
from rigsight.effects import symbols as canonical
from rigsight.units import characteristic_value


def start_values(
    bench: Workbench,
    effect: Effect,
    base: Mapping[str, float],
    parents: Mapping[str, Mapping[str, float]],
) -> Iterator[dict[str, float]]:
    """Yield values of all parameters from which a fit with `effect` is worth trying.

    Parameters
    ----------
    bench
        Gives the characteristic sizes.
    effect
        The effect to add.
    base
        Fitted values without it.
    parents
        Fitted values of simpler effects, by name.
    """
    fitted = [p for p in effect.parameters if p.fitted and p.name not in effect.special_cases]
    rest = {p.name: p.default for p in effect.parameters if p not in fitted and p.default is not None}
    if effect.starts:
        for start in effect.starts:
            origin = base if start.parent is None else parents.get(start.parent)
            if origin is not None:
                yield {**origin, **rest, **_evaluated(bench, start.values, origin)}
        return
    sizes = [characteristic_value(p.dimension, bench.scales) for p in fitted]
    for combination in itertools.product(*(p.starts for p in fitted)):
        own = {p.name: c * size for p, c, size in zip(fitted, combination, sizes, strict=True)}
        yield {**base, **rest, **own}


def _evaluated(
    bench: Workbench, formulas: Mapping[str, sp.Expr], values: Mapping[str, float]
) -> dict[str, float]:
    stiffness = bench.rig.motion.stiffness
    numbers = {
        canonical.k: values[stiffness.name],
        canonical.drive_size: bench.scales["drive"],
        canonical.x_size: bench.scales["x"],
        canonical.v_size: bench.scales["x"] / bench.scales["time"],
    }
    result = {}
    for name, formula in formulas.items():
        own = {s: values[s.name] for s in formula.free_symbols if s not in numbers}
        value = float(formula.subs({**numbers, **own}))
        result[stiffness.name if name == "k" else name] = value
    return result

"""Does an axis that is given without a spring have one?"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rigsight.effects import Effect
from rigsight.errors import InputError, SimulationError
from rigsight.identify.fit.grey_box import GreyBoxFit
from rigsight.identify.fit.windows import cut, window_length
from rigsight.identify.linear_view import longest_free_run
from rigsight.identify.start.linear_start import linear_start
from rigsight.identify.start.scales import characteristic_scales
from rigsight.records.record import Record
from rigsight.rigs import Rig, evaluated
from rigsight.simulate import compose

_CLEARLY = 5.0
"""Standard errors from zero at which the stiffness is significant; large, because the residual is not white."""
_LEAVES = 0.9
"""Largest error with a spring, relative to that without, that contradicts a given stiffness of zero: other missing effects seem
like a weak spring, and lower the error less."""


@dataclass(frozen=True)
class WeighedSpring:
    """Whether records show a spring although none was given, and the finding in words."""

    found: bool
    note: str


def weighed_spring(
    rig: Rig,
    records: Sequence[Record],
    constants: Mapping[str, float],
    given: Mapping[str, float],
    modelled: Sequence[Effect],
    stiffness: str,
    held: Mapping[str, float],
) -> WeighedSpring | None:
    """Weigh an absent spring against the records of an axis; None if they cannot be fitted.

    A stiffness of zero that is given states that there is no spring. It is fitted to windows of the records, beside the same fit
    with zero: if it differs from zero beyond its error and lowers the error, the records contradict the statement.
    """
    known = {**held, **{symbol.name: 0.0 for symbol in rig.motion.rest.free_symbols}}
    try:
        start = {**constants, **linear_start(rig, records, constants, known)}
    except InputError:
        return None
    start = {**start, **given, stiffness: start[stiffness]} if modelled else start
    motion = rig.motion
    assert motion.inertia is not None
    equation = [evaluated(part, start) for part in (motion.inertia, motion.damping, motion.stiffness)]
    limit = longest_free_run(np.roots(equation).astype(np.complex128), records)
    length = min(window_length(rig, records), limit or np.inf)
    windows, structure = cut(records, length), compose(rig, modelled)
    sizes = {
        s.name: max(float(np.std(np.concatenate([r[s.name] for r in records]))), 1e-300) for s in rig.outputs
    }
    problem = GreyBoxFit(structure, windows, characteristic_scales(rig, records, start), sizes)
    free = [p.name for p in rig.parameters if p.name not in known]
    try:
        without = problem.fit({**start, stiffness: 0.0}, [n for n in free if n != stiffness])
        fits = [problem.fit({**found, **known}, free) for found in (start, without.values)]
    except SimulationError:
        return None
    sprung = min(fits, key=lambda fit: fit.cost)
    value, std = sprung.values[stiffness], sprung.standard_errors[stiffness]
    unit = next(p.unit for p in rig.parameters if p.name == stiffness)
    share = math.sqrt(sprung.cost / max(without.cost, 1e-300))
    found = abs(value) > _CLEARLY * std and share < _LEAVES
    done = (
        f"fits estimate {stiffness}, the given simulation keeps 0"
        if found
        else f"{stiffness} = 0 is held in all fits"
    )
    note = (
        f"{stiffness} = 0 stands for no spring. Estimated from windows of {length:.3g} s, "
        f"{stiffness} is {value:.3g} +/- {std:.2g} {unit} "
        f"and leaves {share:.2f} times the error without a spring: {done}."
    )
    return WeighedSpring(found, note)

"""Does an axis that is given without a spring have one?"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rigsight.campaign import Campaign
from rigsight.diagnose.fitting.windows import cut, window_length
from rigsight.diagnose.policy import NOTES
from rigsight.errors import InputError, SimulationError
from rigsight.identify import GreyBoxFit, characteristic_scales, linear_start
from rigsight.identify.linear_view import longest_free_run
from rigsight.rigs import evaluated
from rigsight.simulate import compose


def with_weighed_spring(campaign: Campaign) -> Campaign:
    """Return a campaign whose fits estimate an absent spring if its records show one, with a note on what was done.

    A stiffness of zero that is given states that there is no spring. It is fitted to windows of the records, beside the same fit
    with zero: if it differs from zero beyond its error and lowers the error, the records contradict the statement. The given
    simulation keeps it.
    """
    name = campaign.absent_spring
    if name is None:
        return campaign
    rig, records, constants = campaign.rig, campaign.estimation, campaign.constants
    factor = campaign.open_factor
    known = {} if factor is None else {factor.held: factor.value}
    known |= {symbol.name: 0.0 for symbol in rig.motion.rest.free_symbols}
    try:
        start = {**constants, **linear_start(rig, records, constants, known)}
    except InputError:
        return campaign
    start = {**start, **campaign.given, name: start[name]} if campaign.modelled else start
    motion = rig.motion
    assert motion.inertia is not None
    equation = [evaluated(part, start) for part in (motion.inertia, motion.damping, motion.stiffness)]
    limit = longest_free_run(np.roots(equation).astype(np.complex128), records)
    length = min(window_length(rig, records), limit or np.inf)
    windows, structure = cut(records, length), compose(rig, campaign.modelled)
    sizes = {
        s.name: max(float(np.std(np.concatenate([r[s.name] for r in records]))), 1e-300) for s in rig.outputs
    }
    problem = GreyBoxFit(structure, windows, characteristic_scales(rig, records, start), sizes)
    free = [p.name for p in rig.parameters if p.name not in known]
    try:
        without = problem.fit({**start, name: 0.0}, [n for n in free if n != name])
        fits = [problem.fit({**found, **known}, free) for found in (start, without.values)]
    except SimulationError:
        return campaign
    sprung = min(fits, key=lambda fit: fit.cost)
    value, std = sprung.values[name], sprung.standard_errors[name]
    unit = next(p.unit for p in rig.parameters if p.name == name)
    share = math.sqrt(sprung.cost / max(without.cost, 1e-300))
    released = abs(value) > NOTES.clearly * std and share < NOTES.spring_leaves
    done = (
        f"fits estimate {name}, the given simulation keeps 0"
        if released
        else f"{name} = 0 is held in all fits"
    )
    note = (
        f"{name} = 0 stands for no spring. Estimated from windows of {length:.3g} s, {name} is {value:.3g} +/- {std:.2g} {unit} "
        f"and leaves {share:.2f} times the error without a spring: {done}."
    )
    return replace(campaign, spring_released=released, notes=(*campaign.notes, note))

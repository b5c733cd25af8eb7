"""Errors of the parameters of correct diagnoses, in units of their stated standard errors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rigsight.effects import effect_named, kind_of, placed
from rigsight.rigs import Rig
from rigsight.simulate import compose

OF_RIG = "rig"


@dataclass(frozen=True)
class ParameterError:
    """One estimated number against the true one.

    Attributes
    ----------
    name
        The parameter.
    of
        The effect it belongs to, or ``"rig"``.
    error
        (estimated - true) / standard error.
    """

    name: str
    of: str
    error: float


def parameter_errors(
    rig: Rig,
    effects: Sequence[tuple[str, str]],
    estimates: Mapping[str, Mapping[str, Any]],
    truth: Mapping[str, float],
) -> tuple[ParameterError, ...]:
    """Return the errors of all parameters that were estimated and whose truth is known.

    Truth and estimate stand for the same symbols of the same equations, so no scale or sign is in between.

    Parameters
    ----------
    rig
        The rig.
    effects
        The effects that were hidden and named, all of the catalogue, each with its place; "" where the rig has one for it.
    estimates
        By parameter: ``value`` and ``std``, which is None where the records do not determine it.
    truth
        True values by parameter [SI].
    """
    several = not rig.has_one_motion
    named = [
        placed(effect_named(name), place) if place and several else effect_named(name)
        for name, place in effects
    ]
    structure = compose(rig, named)
    owners = {
        structure.parameter_name(effect, p.name): kind_of(effect.name)
        for effect in named
        for p in effect.parameters
    }
    found = []
    for name, estimate in estimates.items():
        std = estimate["std"]
        if name not in truth or std is None or not (math.isfinite(std) and std > 0.0):
            continue
        error = (float(estimate["value"]) - truth[name]) / std
        found.append(ParameterError(name, owners.get(name, OF_RIG), error))
    return tuple(found)

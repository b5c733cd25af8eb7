"""Records and key of one trial of design ``measured``; everything follows from the folder, seed and number."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from rigsight.effects import family_of, kind_of
from rigsight.errors import InputError, SimulationError
from rigsight.records import Record
from rigsight.simulate import compose
from rigsight_bench.trials.measured.base import Base
from rigsight_bench.trials.measured.campaigns import (
    campaign_files,
    digest_of,
    measured_base,
    measured_spots,
    rig_file_text,
)
from rigsight_bench.trials.measured.spike import spiked, unspiked, whole_samples
from rigsight_bench.trials.measured.spots import Spot, is_beside_own
from rigsight_bench.trials.passes import shuffled
from rigsight_bench.trials.strength import draw_shape, scaled, sized
from rigsight_bench.trials.trial import Trial, as_given

STRENGTHS = (2.0, 8.0)
"""What an effect adds to the error of the base equations, in units of what they leave of the records as they were measured."""
_LEAST = 1.5
"""Smallest strength that is accepted where a drawn one would be stronger than what moves the rig."""
_STRONGEST = 30.0
"""Most that an effect may exceed the start values of its declaration: what a rough model leaves is large."""
_MOST = 12.0
"""Largest strength that is accepted: where an effect moves by whole samples, or stops at once."""
_ATTEMPTS = 40
_SAME = 6
"""Attempts with the effect whose turn it is, before another one of the same campaign is drawn."""


@dataclass(frozen=True)
class MeasuredCell:
    """A campaign, and the number of the effect at its place among those that can be added to it."""

    path: Path
    spot: int


@lru_cache(maxsize=8)
def measured_cells(folder: Path) -> tuple[MeasuredCell, ...]:
    """Return all cells of one pass: each campaign with each effect that can be added to its records, at each place.

    Parameters
    ----------
    folder
        With the campaigns.

    Raises
    ------
    InputError
        If there is no campaign, or none can be used, with the reason of each.
    """
    paths = [folder / file for file in campaign_files(folder)]
    cells = [MeasuredCell(path, i) for path in paths for i in range(len(measured_spots(path)))]
    if not cells:
        reasons = {path: measured_base(path) for path in paths}
        told = [f"{path}: {why}" for path, why in reasons.items() if isinstance(why, str)]
        told = told or ["no force or reading of these rigs can be changed"]
        raise InputError(f"No campaign in {folder} can be used. " + " ".join(told))
    return tuple(cells)


def draw_measured_trial(folder: Path, seed: int, trial: int) -> Trial:
    """Draw one trial of design ``measured``.

    Parameters
    ----------
    folder
        With the campaigns.
    seed
        Seed of the whole bench.
    trial
        Number of the trial.

    Raises
    ------
    SimulationError
        If no effect that was drawn reaches its strength.
    """
    cells, failed = measured_cells(folder), dict[Path, SimulationError]()
    # A campaign whose equations leave more than any effect could add has no trials: another one stands for it.
    for cell in (shuffled(cells, trial + n, seed) for n in range(len(cells))):
        if cell.path in failed:
            continue
        try:
            return _of_campaign(folder, cell, seed, trial)
        except SimulationError as error:
            failed[cell.path] = error
    reasons = "; ".join(f"{path.parent.name}: {error}" for path, error in failed.items())
    raise SimulationError(f"Trial {trial} of seed {seed} cannot be drawn: {reasons}")


def _of_campaign(folder: Path, cell: MeasuredCell, seed: int, trial: int) -> Trial:
    base, offered = measured_base(cell.path), measured_spots(cell.path)
    assert isinstance(base, Base)
    reason = SimulationError("No effect can be added.")
    for attempt in range(_ATTEMPTS):
        rng = np.random.default_rng([seed, trial, attempt])
        spot = offered[cell.spot if attempt < _SAME else int(rng.integers(len(offered)))]
        try:
            equations = base_beside(base, spot)
            own, strength = _drawn(equations, spot, rng)
            return _trial(folder, cell.path, equations, spot, own, strength, {"seed": seed, "trial": trial})
        except SimulationError as error:
            reason = error
    raise reason


def base_beside(base: Base, spot: Spot) -> Base:
    """Return the base equations beside an effect: without the friction that the records chose where more of it is added.

    Then the family of the cause is known, and at least the strength that was added.

    Parameters
    ----------
    base
        Base equations of the campaign.
    spot
        Effect and place.
    """
    return base.without if is_beside_own(base, spot) and base.without is not None else base


def _drawn(base: Base, spot: Spot, rng: np.random.Generator) -> tuple[dict[str, float], float]:
    """Return parameters of an effect by their own names, and what it adds to the error of the base equations."""
    wished = math.exp(rng.uniform(*np.log(STRENGTHS)))
    shape = draw_shape(spot.effect, base.scales, rng)
    dt = base.campaign.records[0].dt

    def values_at(strength: float) -> dict[str, float]:
        return whole_samples(spot, scaled(spot.effect, shape, strength, base.scales, limits={}), dt)

    found = sized(
        spot.effect.name,
        values_at,
        functools.partial(added_error, base, spot),
        math.hypot(1.0, wished),
        _LEAST,
        _STRONGEST,
    )
    if found.gap > _MOST:
        raise SimulationError(f"{spot.effect.name} cannot be made smaller than {found.gap:.2g}.")
    return found.values, found.gap


def added_error(base: Base, spot: Spot, own: Mapping[str, float]) -> float:
    """Return what an effect adds to the error of the base equations, in units of what they leave without it.

    Parameters
    ----------
    base
        The base equations.
    spot
        Effect and place.
    own
        Its parameters by their own names.
    """
    changed = [spiked(base, spot, own, record) for record in base.campaign.estimation]
    pairs = zip(base.campaign.estimation, changed, strict=True)
    return base.added(changed, [unspiked(record, other) for record, other in pairs])


def _trial(
    folder: Path,
    path: Path,
    base: Base,
    spot: Spot,
    own: Mapping[str, float],
    strength: float,
    numbers: Mapping[str, int],
) -> Trial:
    rig, campaign = base.rig, base.campaign
    with_it = compose(rig, [*base.modelled, spot.effect])
    named = {with_it.parameter_name(spot.effect, name): value for name, value in own.items()}
    of_base = compose(rig, base.modelled).names
    whole = measured_base(path)
    is_own = not isinstance(whole, str) and is_beside_own(whole, spot)
    key = {
        "schema_version": 2,
        "design": "measured",
        **numbers,
        "kind": "single",
        "effects": [kind_of(spot.effect.name)],
        "where": [rig.where(spot.effect)],
        "place": spot.place,
        "family": family_of(spot.effect.name),
        "strength": strength,
        "own_values": dict(own),
        "way": spot.way,
        "signal": spot.signal,
        "campaign": path.relative_to(folder).as_posix(),
        "source": digest_of(path),
        "base": {
            "modelled": [effect.name for effect in base.modelled],
            "chosen_by_fit": base.is_chosen,
            "own_of_same_family": is_own,
            "values": {name: base.values[name] for name in of_base},
            "force_residual": base.remainder.tolist(),
        },
        "rig": rig.name,
        "declaration": dict(rig.declaration),
        "noise": "measured",
        "gap": math.hypot(1.0, strength),
        "values": {**{name: base.values[name] for name in of_base}, **named},
        "noise_floor": {},
    }
    parameters = {p.name for p in compose(rig, base.modelled).parameters} - {p.name for p in rig.constants}
    known = parameters - {
        p.name for p in rig.parameters if p.name not in base.free and p.name not in campaign.given
    }
    given = as_given({name: base.values[name] for name in sorted(known)})
    return Trial(
        rig,
        {**base.values, **campaign.constants},
        given,
        tuple(_handed(records_of(base, spot, own))),
        (),
        key,
        modelled=tuple(effect.name for effect in base.modelled),
        rig_file=rig_file_text(campaign),
        offsets_by_record=any(record.free_offsets for record in campaign.records),
    )


def records_of(base: Base, spot: Spot, own: Mapping[str, float]) -> list[Record]:
    """Return all records of a campaign with an effect in them.

    Parameters
    ----------
    base
        The base equations.
    spot
        Effect and place.
    own
        Its parameters by their own names.
    """
    return [spiked(base, spot, own, record) for record in base.campaign.records]


def _handed(records: Sequence[Record]) -> list[Record]:
    """Return records under names that tell nothing."""
    return [replace(record, name=f"record_{number}") for number, record in enumerate(records, 1)]


def again(folder: Path, key: Mapping[str, Any]) -> list[Record]:
    """Return the records of a trial from its key and the campaign that was measured.

    Parameters
    ----------
    folder
        With the campaigns.
    key
        Of the trial.

    Raises
    ------
    InputError
        If the campaign has changed since, or does not offer the effect.
    """
    path = folder / str(key["campaign"])
    base = measured_base(path)
    if isinstance(base, str) or digest_of(path) != key["source"]:
        raise InputError(f"{path} is not what it was when the trial was drawn.")
    wanted = (key["effects"][0], key["place"])
    spot = next(s for s in measured_spots(path) if (kind_of(s.effect.name), s.place) == wanted)
    equations = base_beside(base, spot)
    same = replace(equations, values={**equations.values, **key["base"]["values"]})
    return _handed(records_of(same, spot, key["own_values"]))

"""Is a diagnosis right? It is held against the key of its trial."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from rigsight.effects import AT, family_of
from rigsight.errors import InputError
from rigsight.rigs import Rig
from rigsight.rigs.built_in import declared_rig
from rigsight_bench.scoring.parameter_errors import ParameterError, parameter_errors
from rigsight_bench.scoring.trial_outcome import FAILED, Outcome, WithheldError
from rigsight_bench.trials.kinds import SEVERAL, TIERS

BY_PLACE_SCHEMA = 2
"""Schema of keys from which on `where` holds the place of each effect; before, it was the set of places."""
BELOW = "below"
"""Tier of a gap that is smaller than the faintest."""
UNMEASURED = "not measured"
"""Tier of a gap whose size neither key nor diagnosis tells."""


def outcome(
    key: Mapping[str, Any],
    diagnosis: Mapping[str, Any] | None,
    withheld: Sequence[WithheldError],
    seconds: float,
    version: str,
    message: str = "",
) -> Outcome:
    """Compare a diagnosis with its key.

    Parameters
    ----------
    key
        As `draw_trial` makes it. An external key may contain a `fingerprint`, and None for `where` and `gap`. Without `values`
        no errors of parameters are told.
    diagnosis
        Content of ``diagnosis.json``; None if the diagnosis failed.
    withheld
        Errors on the withheld records.
    seconds
        Time of the diagnosis.
    version
        The rigsight that scores.
    message
        Why the diagnosis failed.
    """
    found = diagnosis or {
        "verdict": FAILED,
        "effects": [],
        "where": [],
        "ambiguous_with": [],
        "candidates": [],
    }
    kind = str(key["kind"])
    by_place = key.get("schema_version", 1) >= BY_PLACE_SCHEMA
    truth, named = effects_at_places(key, by_place), effects_at_places(found, by_place)
    verdict = str(found["verdict"])
    expected = {"none": "none", "parameters": "parameters", "outside": "unknown"}.get(kind, "effect")
    honest = kind == "outside" and _is_relative_at_its_place(key, found)
    needed = needed_effects(key, by_place)
    right = honest or (verdict == expected and (expected != "effect" or needed <= named <= truth))
    effect_right = honest or (
        verdict == expected and (expected != "effect" or _are_kinds_of(named, needed, truth))
    )
    within = expected == "effect" and _is_among(needed, truth, found["ambiguous_with"])
    candidates = {effects_at_places(c, by_place): float(c["probability"] or 0.0) for c in found["candidates"]}
    outside = max(0.0, 1.0 - sum(candidates.values()))
    of_truth = [p for effects, p in candidates.items() if needed <= effects <= truth]
    is_tried = kind != "outside" and bool(of_truth) and not _is_other_control(expected, verdict)
    probability = math.fsum(of_truth) if is_tried else outside
    stated = outside if verdict == "unknown" else candidates.get(named, 0.0)
    if verdict == FAILED:
        probability = stated = 0.0
    likely = _likely(found, needed, truth, is_tried)
    gap = None if key["gap"] is None else float(key["gap"])
    if truth and gap is not None and gap < 1.0:
        gap = None
    hides_a_place = bool(truth) and key["where"] is not None
    wanted = _families(needed)
    of_families = {
        (one["family"], one["where"] if by_place else ""): float(one["probability"])
        for one in found.get("families", ())
    }
    return Outcome(
        design=str(key["design"]),
        seed=int(key["seed"]),
        trial=str(key["trial"]),
        fingerprint=str(key.get("fingerprint", "")),
        version=version,
        kind=kind,
        effects=_kinds(truth),
        places=_places(truth),
        rig=str(key["rig"]),
        noise=str(key["noise"]),
        gap=gap,
        tier=_tier(gap) if truth else "",
        verdict=verdict,
        named=_kinds(named),
        named_places=_places(named),
        right=right,
        effect_right=effect_right,
        right_within_set=right or within,
        place_right=_is_place_right(key, found, needed) if hides_a_place else None,
        looked_at=_looked_at(key, found) if hides_a_place else None,
        probability=probability,
        stated=stated,
        stated_is_true=not is_tried if verdict == "unknown" else right and not honest,
        in_set=None if likely is None else likely[0],
        set_size=None if likely is None else likely[1],
        several_places=bool(found.get("gap_by_place")),
        held_out=_over_all(withheld),
        withheld=tuple(withheld),
        parameters=_parameter_errors(key, found) if right and kind != "outside" else (),
        seconds=seconds,
        message=message,
        condition=str(key.get("condition", "")),
        families=tuple(family_of(name) for name in _kinds(truth)),
        family_right=wanted <= _named_families(found, named, by_place) if truth else None,
        family_probability=min(of_families.get(one, 0.0) for one in wanted) if wanted else None,
    )


def rig_of(key: Mapping[str, Any]) -> Rig:
    """Return the rig of a key: the one that it declares, else the built-in one of its name."""
    rig = declared_rig(str(key["rig"]), key.get("declaration") or {})
    if rig is None:
        raise InputError(
            f"The key of trial {key['trial']} names the rig {key['rig']}, which is not built in, and does not declare it."
        )
    return rig


def effects_at_places(said: Mapping[str, Any], by_place: bool) -> frozenset[tuple[str, str]]:
    """Return effects with their places; with none where the key does not say them effect by effect."""
    effects = [str(name) for name in said["effects"]]
    places = (
        said["where"] if by_place and len(said.get("where") or ()) == len(effects) else [""] * len(effects)
    )
    return frozenset(zip(effects, places, strict=True))


def _families(effects: frozenset[tuple[str, str]]) -> frozenset[tuple[str, str]]:
    """Return the family of each effect at its place."""
    return frozenset((family_of(name), place) for name, place in effects)


def _named_families(
    found: Mapping[str, Any], named: frozenset[tuple[str, str]], by_place: bool
) -> frozenset[tuple[str, str]]:
    """Return the families that a diagnosis names at their places: a hysteresis may be one of dry friction."""
    if not named or "families" not in found:
        return _families(named)
    return frozenset(
        (one["family"], one["where"] if by_place else "")
        for one in found["families"]
        if one["share"]["value"] > 0.0
    )


def _kinds(effects: frozenset[tuple[str, str]]) -> tuple[str, ...]:
    return tuple(name for name, _ in sorted(effects))


def _places(effects: frozenset[tuple[str, str]]) -> tuple[str, ...]:
    return tuple(place for _, place in sorted(effects) if place)


def needed_effects(key: Mapping[str, Any], by_place: bool) -> frozenset[tuple[str, str]]:
    """Return the effects without which no verdict is right: all that are hidden, of several the main one."""
    if key["kind"] != SEVERAL:
        return effects_at_places(key, by_place)
    return frozenset({(str(key["effects"][0]), str(key["where"][0]))})


def _are_kinds_of(
    named: frozenset[tuple[str, str]], needed: frozenset[tuple[str, str]], truth: frozenset[tuple[str, str]]
) -> bool:
    """Return True if the effects named are right wherever they are put."""
    kinds, least, most = (Counter(_kinds(effects)) for effects in (named, needed, truth))
    return least <= kinds <= most


def _is_among(
    needed: frozenset[tuple[str, str]],
    truth: frozenset[tuple[str, str]],
    rivals: Sequence[Sequence[str]],
) -> bool:
    """Return True if a right verdict is one of the sets of names; a rig with several places has them in its names."""

    def plain(effects: frozenset[tuple[str, str]]) -> frozenset[str]:
        return frozenset(name for name, _ in effects)

    def whole(effects: frozenset[tuple[str, str]]) -> frozenset[str]:
        return frozenset(f"{name}{AT}{place}" for name, place in effects)

    return any(
        spelled(needed) <= frozenset(rival) <= spelled(truth)
        for rival in rivals
        for spelled in (plain, whole)
    )


def _is_other_control(expected: str, verdict: str) -> bool:
    """Return True if nothing is hidden, but the verdict on the given parameters is wrong: both have the same candidate."""
    controls = {"none", "parameters"}
    return expected in controls and verdict in controls - {expected}


def _likely(
    found: Mapping[str, Any],
    needed: frozenset[tuple[str, str]],
    truth: frozenset[tuple[str, str]],
    is_tried: bool,
) -> tuple[bool, int] | None:
    """Return whether the set of likely causes contains the true one, and its size; None where a diagnosis states no set.

    Of a control, the equations without an effect are the truth.
    """
    likely = found.get("likely_causes")
    if likely is None:
        return None
    size = len(likely["effects"]) + bool(likely["outside"])
    if not is_tried:
        return bool(likely["outside"]), size
    if not truth:
        return [] in likely["effects"], size
    return _is_among(needed, truth, likely["effects"]), size


def _is_place_right(
    key: Mapping[str, Any], found: Mapping[str, Any], needed: frozenset[tuple[str, str]]
) -> bool:
    where, there = frozenset(found["where"]), frozenset(key["where"])
    if key["kind"] != SEVERAL:
        return where == there
    return frozenset(_places(needed)) <= where <= there


def _is_relative_at_its_place(key: Mapping[str, Any], found: Mapping[str, Any]) -> bool:
    """Return True for a relative that is named at the true place and said to leave a remainder."""
    named = found["verdict"] == "effect" and found.get("adequate") is False
    return named and key["where"] is not None and frozenset(found["where"]) == frozenset(key["where"])


def _looked_at(key: Mapping[str, Any], found: Mapping[str, Any]) -> bool | None:
    """Return whether all true places are among those that were chosen, or the truth is among what was tried in the end."""
    places = found.get("gap_by_place") or []
    if not places:
        return None
    chosen = {place["place"] for place in places if place["looked_at"]}
    tried = {place for candidate in found["candidates"] for place in candidate.get("where", ())}
    return frozenset(key["where"]) <= chosen | tried


def _tier(gap: float | None) -> str:
    if gap is None:
        return UNMEASURED
    reached = [tier for tier, (least, _) in TIERS.items() if gap >= least]
    return reached[-1] if reached else BELOW


def _over_all(withheld: Sequence[WithheldError]) -> float | None:
    """Return the RMS error over all samples of all records."""
    errors = [(w.n_samples, w.error) for w in withheld if w.error is not None]
    if not errors or len(errors) < len(withheld):
        return None
    return math.sqrt(sum(n * error**2 for n, error in errors) / sum(n for n, _ in errors))


def _parameter_errors(key: Mapping[str, Any], found: Mapping[str, Any]) -> tuple[ParameterError, ...]:
    by_place = key.get("schema_version", 1) >= BY_PLACE_SCHEMA
    truth = effects_at_places(key, by_place)
    named = next((c for c in found["candidates"] if effects_at_places(c, by_place) == truth), None)
    if named is None or "values" not in key:
        return ()
    return parameter_errors(rig_of(key), sorted(truth), named["parameters"], key["values"])

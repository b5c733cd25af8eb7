"""What came of one trial whose truth is known? The diagnosis is held against the key."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from rigsight.blind.parameter_errors import ParameterError, parameter_errors
from rigsight.blind.subjects import TIERS

FAILED = "failed"
"""Verdict of a diagnosis that ended with an error."""
BELOW = "below"
"""Tier of a gap that is smaller than the faintest."""
UNMEASURED = "not measured"
"""Tier of a gap whose size neither key nor diagnosis tells."""


@dataclass(frozen=True)
class WithheldError:
    """What a diagnosed model leaves of one record that no diagnosis has seen.

    Attributes
    ----------
    name, kind, amplitude
        The record; amplitude [unit of the input].
    n_samples
        Its length.
    error
        RMS error over all outputs in units of the true noise floor, from the model and the input alone; None where there is no
        model or it cannot be simulated.
    """

    name: str
    kind: str
    amplitude: float
    n_samples: int
    error: float | None


@dataclass(frozen=True)
class Outcome:
    """What came of one trial.

    Attributes
    ----------
    design, seed, trial
        Which trial it is: a number of a drawn bench as text, or the name of a campaign.
    fingerprint
        Of the files of a campaign written by somebody else and of its key; empty where design, seed and number say all.
    version
        The rigsight that scored it.
    kind, effects, rig, noise
        From the key: kind of subject, hidden effects, rig, noise level.
    gap
        What the re-identified equations leave on validation records, in units of the true noise floor; None if not known.
    tier
        Strength by that gap; "below" where it is smaller than the faintest, "" where nothing is hidden.
    verdict, named
        Verdict and named effects; verdict "failed" where the diagnosis ended with an error.
    right
        The verdict is the truth: the very effects, or none, parameters, and unknown for an effect from outside.
    right_within_set
        Right, or the truth is among those that the diagnosis cannot tell from what it names.
    place_right
        The places named are those of the hidden effects; None where nothing is hidden or the key does not say where.
    probability
        On the truth; for an effect from outside, what is left beside all candidates.
    stated
        On what the verdict says; 0 where there is none.
    held_out
        RMS error on all withheld records in units of the true noise floor, from the model alone; None where one of them cannot
        be simulated, or there is none.
    withheld
        The same record by record.
    parameters
        Errors of the numbers where the verdict is right.
    seconds
        Time of the diagnosis.
    message
        Why it failed.
    """

    design: str
    seed: int
    trial: str
    fingerprint: str
    version: str
    kind: str
    effects: tuple[str, ...]
    rig: str
    noise: str
    gap: float | None
    tier: str
    verdict: str
    named: tuple[str, ...]
    right: bool
    right_within_set: bool
    place_right: bool | None
    probability: float
    stated: float
    held_out: float | None
    withheld: tuple[WithheldError, ...]
    parameters: tuple[ParameterError, ...]
    seconds: float
    message: str = ""

    def to_json(self) -> dict[str, Any]:
        """Return the outcome for ``blind.json``."""
        return asdict(self)


def outcome(
    key: Mapping[str, Any],
    diagnosis: Mapping[str, Any] | None,
    withheld: Sequence[WithheldError],
    seconds: float,
    version: str,
    message: str = "",
) -> Outcome:
    """Hold a diagnosis against its key.

    Parameters
    ----------
    key
        As `draw_trial` makes it. A key written by somebody else may hold a `fingerprint`, and None for `where` and `gap`.
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
    truth, named = frozenset(key["effects"]), frozenset(found["effects"])
    verdict = str(found["verdict"])
    expected = {"none": "none", "parameters": "parameters", "outside": "unknown"}.get(kind, "effect")
    right = verdict == expected and (expected != "effect" or named == truth)
    within = expected == "effect" and truth in [frozenset(rival) for rival in found["ambiguous_with"]]
    candidates = {frozenset(c["effects"]): float(c["probability"] or 0.0) for c in found["candidates"]}
    left = max(0.0, 1.0 - sum(candidates.values()))
    probability = left if kind == "outside" else candidates.get(truth, 0.0)
    stated = left if verdict == "unknown" else candidates.get(named, 0.0)
    if verdict == FAILED:
        probability = stated = 0.0
    gap = None if key["gap"] is None else float(key["gap"])
    hides_a_place = bool(truth) and key["where"] is not None
    return Outcome(
        design=str(key["design"]),
        seed=int(key["seed"]),
        trial=str(key["trial"]),
        fingerprint=str(key.get("fingerprint", "")),
        version=version,
        kind=kind,
        effects=tuple(sorted(truth)),
        rig=str(key["rig"]),
        noise=str(key["noise"]),
        gap=gap,
        tier=_tier(gap) if truth else "",
        verdict=verdict,
        named=tuple(sorted(named)),
        right=right,
        right_within_set=right or within,
        place_right=frozenset(found["where"]) == frozenset(key["where"]) if hides_a_place else None,
        probability=probability,
        stated=stated,
        held_out=_over_all(withheld),
        withheld=tuple(withheld),
        parameters=_parameter_errors(key, found) if right and kind != "outside" else (),
        seconds=seconds,
        message=message,
    )


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
    effects = sorted(key["effects"])
    named = next((c for c in found["candidates"] if sorted(c["effects"]) == effects), None)
    if named is None:
        return ()
    return parameter_errors(str(key["rig"]), effects, named["parameters"], key["values"])

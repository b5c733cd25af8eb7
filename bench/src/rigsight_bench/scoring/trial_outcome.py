"""What is recorded of one trial whose truth is known?"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from rigsight_bench.scoring.parameter_errors import ParameterError

FAILED = "failed"
"""Verdict of a diagnosis that ended with an error."""


@dataclass(frozen=True)
class WithheldError:
    """Error of a diagnosed model on one withheld record.

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
    """The outcome of one trial.

    Attributes
    ----------
    design, seed, trial
        Which trial it is: a number of a drawn bench as text, or the name of a campaign.
    fingerprint
        Of the files of an external campaign and of its key; empty if design, seed and number define it.
    version
        Version of rigsight that scored it.
    kind, effects, places, rig, noise
        From the key: kind of subject, hidden effects, the place of each (empty where the key does not say it effect by effect),
        rig, noise level.
    gap
        Error of the re-identified equations on validation records, in units of the true noise floor; None if unknown, or below 1,
        which no model can have: then the floor of the key contains a disturbance that made the rig drift.
    tier
        Strength by that gap; "below" where it is smaller than the faintest, "" where nothing is hidden.
    verdict, named, named_places
        Verdict, named effects, and the place of each; verdict "failed" where the diagnosis ended with an error.
    right
        The verdict is the truth: the very effects, each at its place, or none, or parameters; for an effect from outside
        unknown, or a relative at its place that is said to leave a remainder; for several effects the main one, alone or with
        others that are hidden too.
    effect_right
        The same, wherever the diagnosis puts the effects.
    right_within_set
        Right, or the truth is among the effects that the diagnosis does not distinguish from the named one.
    place_right
        The places named are those of the hidden effects, of several that of the main one and no place of none; None where
        nothing is hidden or the key does not say where.
    looked_at
        All these places are among those at which the diagnosis tried effects; None as above, and where it did not have to choose.
    probability
        Of the true cause. Where it is none of the models tried, the probability that it is none of them.
    stated
        Of what the verdict says; 0 where there is none.
    stated_is_true
        What the verdict says is the truth: as `right`, but a relative of an effect from outside is not that effect, and `unknown`
        is true if the cause is none of the models tried, even if each of its effects is in the catalogue.
    in_set, set_size
        Whether the set of likely causes contains the true one, and its size; None where the diagnosis states none.
    several_places
        The rig has several places for effects.
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
    condition
        Under which the records of a laboratory were taken; empty elsewhere.
    families
        Of the hidden effects, in their order; empty where nothing is hidden.
    family_right
        An effect of the family of each hidden effect (of several: of the main one) is named at its place; None where nothing is
        hidden.
    family_probability
        Stated probability of the least probable of these families at their places, 0 for one that is not listed; None as above.
    """

    design: str
    seed: int
    trial: str
    fingerprint: str
    version: str
    kind: str
    effects: tuple[str, ...]
    places: tuple[str, ...]
    rig: str
    noise: str
    gap: float | None
    tier: str
    verdict: str
    named: tuple[str, ...]
    named_places: tuple[str, ...]
    right: bool
    effect_right: bool
    right_within_set: bool
    place_right: bool | None
    looked_at: bool | None
    probability: float
    stated: float
    stated_is_true: bool
    in_set: bool | None
    set_size: int | None
    several_places: bool
    held_out: float | None
    withheld: tuple[WithheldError, ...]
    parameters: tuple[ParameterError, ...]
    seconds: float
    message: str = ""
    condition: str = ""
    families: tuple[str, ...] = ()
    family_right: bool | None = None
    family_probability: float | None = None

    def to_json(self) -> dict[str, Any]:
        """Return the outcome for ``blind.json``."""
        return asdict(self)

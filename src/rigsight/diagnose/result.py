"""Result of a diagnosis as data: verdict, ranking, gap budget, traces; no pictures and no files."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from rigsight.diagnose.advise import Advice
from rigsight.diagnose.data_quality.finding import DataQuality
from rigsight.diagnose.location.gap_parts import Localization
from rigsight.diagnose.location.trace import Trace
from rigsight.diagnose.noise.adequacy import Remainder
from rigsight.diagnose.noise.detection import NoiseFloor
from rigsight.diagnose.search.worth_fitting import SuspectedPlace
from rigsight.diagnose.trust.statement import Trust
from rigsight.diagnose.trust.trust import RecordNumbers
from rigsight.diagnose.verdict.families import FamilyAtPlace, Shares
from rigsight.diagnose.verdict.judgement import Verdict
from rigsight.diagnose.verdict.ranking import Grounds
from rigsight.effects import kind_of
from rigsight.inverse import Proposal
from rigsight.json_data import json_data

StdMethod = Literal["bootstrap", "formula"]

SCHEMA_VERSION = 2


@dataclass(frozen=True)
class Estimate:
    """A number with its standard error and unit; the error is infinite where the records do not determine the number."""

    value: float
    std: float
    unit: str


@dataclass(frozen=True)
class OutputGap:
    """Gap budget of one output on the validation records, as NRMSE = RMS(measured - simulated) / RMS(measured - mean)."""

    before: float  # the simulation as given; what was not given is identified
    reidentified: float  # the same equations with refitted parameters
    after: float  # with the effects of the verdict added
    noise_floor: float  # error of a perfect model
    # 95 % limits by stage and of ``"closed"``, see `trace.gap_intervals`.
    intervals: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def closed(self) -> float:
        """Share of the gap that is closed, 1 at the noise floor; 1 where there was none."""
        gap = self.before - self.noise_floor
        return 1.0 if gap <= 0.0 else (self.before - self.after) / gap


@dataclass(frozen=True)
class Candidate:
    """A set of effects that was fitted and scored."""

    # Names, strongest first, with ``@place`` where a rig has several places; empty for the re-identified equations alone.
    effects: tuple[str, ...]
    where: tuple[str, ...]  # place of each
    probability: float  # that this set is the cause, given the records and the candidates tried
    validation_nrmse: dict[str, float]  # by output
    estimation_nrmse: dict[str, float]
    # Weighted RMS of the validation residuals in units of the noise floor; 1 is perfect.
    error_over_noise: float
    parameters: dict[str, Estimate]  # every fitted parameter of rig and effects
    success: bool  # whether the fit converged
    message: str
    grounds: Grounds | None = None  # basis of the probability; None for the equations without an effect
    # Source of the standard errors: ``"bootstrap"`` for the diagnosed simulation, else ``"formula"``, that of the fit.
    std_method: StdMethod = "formula"


def probability_not_tried(candidates: Sequence[Candidate]) -> float:
    """Return the probability of a cause that is none of the candidates."""
    return max(0.0, 1.0 - math.fsum(candidate.probability for candidate in candidates))


@dataclass(frozen=True)
class LikelyCauses:
    """The smallest set of causes that contains the true one in nine trials of ten."""

    # Names of the effects of each; empty names are the equations without an effect.
    sets: tuple[tuple[str, ...], ...] = ()
    outside: bool = False  # True if a cause outside the candidates belongs to the set


@dataclass(frozen=True)
class Diagnosis:
    """The result of a diagnosis.

    Attributes
    ----------
    title, rig
        Campaign title and rig name.
    verdict, effects, where, ambiguous_with, candidates, gap
        As in ``diagnosis.json``, but names of effects are with ``@place`` where a rig has several places; candidates are sorted,
        best first.
    noise_floors
        Per output.
    traces
        Per record, validation records first.
    units
        Unit of each signal.
    given
        Parameters of the given simulation, by name.
    model
        The diagnosed simulation, ready for ``model.json``.
    notes
        Notes, one sentence each.
    windows
        Length [s] of the windows scored with their own initial states, None for whole records.
    window_cycles
        Cycles of motion in such a window if the motion is sensitive to small disturbances, else None.
    bandwidth
        Angular frequency [rad/s] up to which an observer tracks the measured motion of a rig that drifts, else None.
    scored_on
        ``"validation"``, or ``"estimation"`` where the campaign has no validation records.
    data_quality
        Findings in the records themselves; None where they were not checked.
    advice
        For each rival that the records cannot distinguish, the experiment that would.
    localization
        The gap split by record, amplitude, band, state, time and signal path.
    effect_shares
        Effect -> output -> share of the closed gap that it explains, where the verdict names several.
    places
        Share of the squared gap of the re-identified equations that the best push at each joint, drive and sensor explains, the
        largest first; empty on a rig with one motion.
    missing_force
        What the equations leave along the measured motion at each joint, and the families that explain it there; None where the
        sensors do not show the motion.
    adequate
        Whether the residual of the diagnosed simulation is noise and disturbance; None where that could not be tested.
    remainder
        Its error above them; None as above.
    families
        The causes as families at places with their shares of the gap, the largest first, and probable rivals.
    shares
        How the squared gap of the re-identified equations divides into families, remainder and noise; None as above.
    likely
        The causes that the records do not exclude.
    error_of_choice
        Error, on the rest of the scored records, of a model selected on part of them, in units of the noise floor; None where no
        model with an effect was selected by its errors.
    trust
        Whether the parameters of the diagnosed model are the same in every record, at every amplitude and in shorter windows;
        None where that was not tested.
    record_numbers
        The change of each number of the model that each record asks for, one number at a time.
    """

    title: str
    rig: str
    verdict: Verdict
    effects: tuple[str, ...]
    where: tuple[str, ...]
    ambiguous_with: tuple[tuple[str, ...], ...]
    candidates: tuple[Candidate, ...]
    gap: dict[str, OutputGap]
    noise_floors: tuple[NoiseFloor, ...]
    traces: tuple[Trace, ...]
    units: dict[str, str]
    model: dict[str, Any]
    notes: tuple[str, ...]
    windows: float | None = None
    window_cycles: int | None = None
    bandwidth: float | None = None
    scored_on: str = "validation"
    advice: tuple[Advice, ...] = ()
    data_quality: DataQuality | None = None
    localization: Localization = field(default_factory=Localization)
    effect_shares: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    places: tuple[SuspectedPlace, ...] = ()
    missing_force: Proposal | None = None
    adequate: bool | None = None
    remainder: Remainder | None = None
    families: tuple[FamilyAtPlace, ...] = ()
    shares: Shares | None = None
    likely: LikelyCauses = field(default_factory=LikelyCauses)
    error_of_choice: float | None = None
    trust: Trust | None = None
    record_numbers: RecordNumbers = field(default_factory=dict)
    given: Mapping[str, float] = field(default_factory=dict)

    @property
    def probability(self) -> float:
        """Probability of what the verdict states: the families, no missing effect, or for ``unknown`` none of the families.

        Which form of a family it is has a probability of its own, see `families`.
        """
        named = [own.probability for own in self.families if own.share > 0.0]
        if self.verdict == "unknown":
            return max(0.0, 1.0 - max((own.probability for own in self.families), default=0.0))
        if self.verdict == "effect" and named:
            return min(named)
        return next((c.probability for c in self.candidates if c.effects == self.effects), 0.0)

    def to_json(self) -> dict[str, Any]:
        """Return the content of ``diagnosis.json``; numbers that are not finite become None."""
        content = {
            "schema_version": SCHEMA_VERSION,
            "title": self.title,
            "rig": self.rig,
            "verdict": self.verdict,
            "probability": self.probability,
            "effects": list(map(kind_of, self.effects)),
            "where": self.where,
            "families": [family.to_json() for family in self.families],
            "shares": self.shares,
            "adequate": self.adequate,
            "remainder": self.remainder and self.remainder.to_json(),
            "trust": self.trust and self.trust.to_json(),
            "numbers_by_record": [
                {"record": record, **vars(own)}
                for record, numbers in self.record_numbers.items()
                for own in numbers
            ],
            "ambiguous_with": self.ambiguous_with,
            "given": self.given,
            "likely_causes": {"effects": self.likely.sets, "outside": self.likely.outside},
            "error_of_choice": self.error_of_choice,
            "candidates": [_candidate(candidate) for candidate in self.candidates],
            "gap": {
                output: {
                    "before": gap.before,
                    "reidentified": gap.reidentified,
                    "after": gap.after,
                    "noise_floor": gap.noise_floor,
                    "closed": gap.closed,
                    "interval": gap.intervals,
                }
                for output, gap in self.gap.items()
            },
            "noise_floor": {
                floor.output: {
                    "std": floor.std,
                    "unit": floor.unit,
                    "method": floor.method,
                    "lower_bound": floor.lower_bound,
                    "interval": floor.interval,
                    "disturbance": floor.disturbance,
                }
                for floor in self.noise_floors
            },
            **self.localization.to_json(),
            "gap_by_place": [
                {"place": place.name, "share": place.share, "looked_at": place.examined}
                for place in self.places
            ],
            "effect_shares": self.effect_shares,
            "missing_force": self.missing_force and self.missing_force.to_json(),
            "window": self.windows,
            "window_cycles": self.window_cycles,
            "observer_bandwidth": self.bandwidth,
            "scored_on": self.scored_on,
            "data_quality": [] if self.data_quality is None else self.data_quality.to_json(),
            "advice": [
                {{"source": "input"}.get(key, key): value for key, value in vars(advice).items()}
                for advice in self.advice
            ],
            "notes": self.notes,
        }
        return json_data(content)


def _candidate(candidate: Candidate) -> dict[str, Any]:
    grounds = candidate.grounds
    return {
        "effects": list(map(kind_of, candidate.effects)),
        "where": candidate.where,
        "probability": candidate.probability,
        "validation_nrmse": candidate.validation_nrmse,
        "estimation_nrmse": candidate.estimation_nrmse,
        "error_over_noise": candidate.error_over_noise,
        "parameters": candidate.parameters,
        "std_method": candidate.std_method,
        "n_fitted": len(candidate.parameters),
        "ranking_share": grounds and grounds.share,
        "held_out_share": grounds and grounds.held_out,
        "log_evidence": grounds and grounds.evidence,
        "success": candidate.success,
        "message": candidate.message,
    }

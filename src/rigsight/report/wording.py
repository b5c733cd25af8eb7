"""Sentences that the page and the terminal share."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from rigsight.diagnose.location.gap_parts import GapPart
from rigsight.diagnose.location.trace import Stage
from rigsight.diagnose.policy import FAMILIES, VERDICT
from rigsight.diagnose.result import Candidate, Diagnosis, OutputGap
from rigsight.effects import AT, kind_of
from rigsight.report.labels import (
    TIMES,
    effect_label,
    effects_label,
    family_label,
    gap_percent,
    listed,
    percent,
    place_label,
)
from rigsight.units import behind

_SEPARATES = 1.0
"""RMS difference in standard deviations of the noise below which an experiment does not help."""
_DECIDES = 100.0
"""RMS difference in standard deviations of the noise above which a larger one decides no more: models err by more than noise."""
_VERDICT_NAMES = {
    "effect": "Missing effect",
    "parameters": "Wrong parameters",
    "none": "No gap",
    "unknown": "Unknown cause",
}
_STATED = {
    "parameters": "no missing effect",
    "none": "no missing effect",
    "unknown": "a cause that is none of the families",
}

_LAWS_NAMED = 3


def verdict_name(diagnosis: Diagnosis) -> str:
    """Return the verdict in two words."""
    if diagnosis.verdict == "effect" and diagnosis.probability < FAMILIES.probable:
        return "Possible cause"
    if diagnosis.verdict == "effect" and _leaves_more(diagnosis):
        return "Main cause"
    return _VERDICT_NAMES[diagnosis.verdict]


def _leaves_more(diagnosis: Diagnosis) -> bool:
    """Return whether the named cause leaves more than noise and disturbance."""
    remainder = diagnosis.remainder
    return diagnosis.adequate is False and (remainder is None or remainder.share > 0.0)


def _is_named_by_motion(diagnosis: Diagnosis) -> bool:
    """Return whether the missing force names the cause, because no simulation decides."""
    return diagnosis.verdict == "effect" and diagnosis.shares is not None and diagnosis.shares.of == "motion"


def after_label(diagnosis: Diagnosis) -> str:
    """Return what the simulation after the diagnosis is called in tables and legends."""
    return list(stage_names(diagnosis).values())[0 if diagnosis.verdict == "none" else -1]


def is_given(diagnosis: Diagnosis) -> bool:
    """Return whether a simulation was given at all; where none was, the first two stages are one and the same."""
    pairs: list[tuple[ArrayLike, ArrayLike]] = [
        (gap.before, gap.reidentified) for gap in diagnosis.gap.values()
    ]
    pairs += [
        (trace.before[output], trace.reidentified[output])
        for trace in diagnosis.traces
        for output in trace.measured
    ]
    return any(not np.array_equal(first, second, equal_nan=True) for first, second in pairs)


def stage_names(diagnosis: Diagnosis) -> dict[Stage, str]:
    """Return the stages of the diagnosis that are different simulations, with their names for people."""
    names: dict[Stage, str] = {"before": "given simulation", "reidentified": "re-identified"}
    if not is_given(diagnosis):
        names = {"reidentified": "identified"}
    if diagnosis.effects:
        names["after"] = "with effect" if len(diagnosis.effects) == 1 else "with effects"
    return names


def stages_reported(diagnosis: Diagnosis, gap: OutputGap | GapPart) -> str:
    """Return the error of each stage: ``"given simulation 42 %, re-identified 13 %, with effect 0.94 %"``."""
    return ", ".join(
        f"{name} {gap_percent(getattr(gap, stage))}" for stage, name in stage_names(diagnosis).items()
    )


def times_floor(error_over_noise: float) -> str:
    """Return ``"1.04 × the noise floor"``."""
    return (
        f"{error_over_noise:.3g} {TIMES} the noise floor"
        if math.isfinite(error_over_noise)
        else "an unknown multiple of the noise floor"
    )


def named_candidate(diagnosis: Diagnosis) -> Candidate | None:
    """Return the candidate that the verdict names; without an effect that of the re-identified equations."""
    return next((c for c in diagnosis.candidates if c.effects == diagnosis.effects), None)


def error_over_noise(diagnosis: Diagnosis, stage: str) -> float:
    """Return the RMS of the residual over all outputs in units of the noise floor."""
    ratios = [
        getattr(gap, stage) / gap.noise_floor for gap in diagnosis.gap.values() if gap.noise_floor > 0.0
    ]
    return math.sqrt(sum(r * r for r in ratios) / len(ratios)) if ratios else math.nan


def verdict_sentence(diagnosis: Diagnosis) -> str:
    """Return the verdict in one plain sentence."""
    before, after = error_over_noise(diagnosis, "before"), error_over_noise(diagnosis, "after")
    if diagnosis.verdict == "effect":
        return _effect_sentence(diagnosis)
    if diagnosis.verdict == "parameters":
        return (
            f"The gap is caused by wrong parameters: refitting the same equations {_shrinks(before, after)}, "
            f"down to {times_floor(after)}."
        )
    if diagnosis.verdict == "none":
        if not before > VERDICT.at_floor:
            return f"There is no gap to explain: {_first(diagnosis)} {times_floor(before)}."
        if before > VERDICT.at_lower_bound:
            return (
                f"No missing effect was found: {_first(diagnosis)} {times_floor(before)}, but this error correlates with no "
                f"signal that was tested. The noise floor is probably too low; repeat a record to measure it."
            )
        other = ", and refitting the parameters hardly changes it" if is_given(diagnosis) else ""
        return (
            f"The gap is too small, compared with the noise, to find a cause: {_first(diagnosis)} "
            f"{times_floor(before)}{other}."
        )
    return _unknown_sentence(diagnosis)


def _first(diagnosis: Diagnosis) -> str:
    return "the given simulation leaves" if is_given(diagnosis) else "the identified equations leave"


def _effect_sentence(diagnosis: Diagnosis) -> str:
    cause = _cause_label(diagnosis)
    it = "them" if len(diagnosis.effects) > 1 else "it"
    refitted, after = error_over_noise(diagnosis, "reidentified"), error_over_noise(diagnosis, "after")
    # What wrong numbers cause is closed by refitting them, and is no share of the effect.
    of = " that refitting leaves" if is_given(diagnosis) else ""
    by_motion = _is_named_by_motion(diagnosis)
    subject = "the force that the equations lack along the measured motion" if by_motion else "the gap"
    verb = "explained" if by_motion else "caused"
    mainly = "mainly " if by_motion or _leaves_more(diagnosis) else ""
    if diagnosis.probability < FAMILIES.probable:
        # Nobody would bet on it.
        claim = f"{subject} may be {mainly}{verb} by {cause} (probability {percent(diagnosis.probability)})"
    else:
        likely = "most likely " if diagnosis.ambiguous_with else ""
        claim = f"{likely}{subject} is {mainly}{verb} by {cause}"
    claim = f"{claim[0].upper()}{claim[1:]}"
    if by_motion:
        share = percent(max(own.share for own in diagnosis.families))
        return (
            f"{claim}: {share} of the square of that force. "
            f"Simulated, adding {it} {_shrinks(refitted, after, of)}; with {it} {times_floor(after)} remains."
        )
    return f"{claim}; adding {it} {_shrinks(refitted, after, of)}, down to {times_floor(after)}."


def _cause_label(diagnosis: Diagnosis) -> str:
    """Return the named effects with their places, once for effects that all have none in their names."""
    pairs = list(zip(diagnosis.effects, diagnosis.where, strict=False))
    if not any(AT in effect for effect, _ in pairs):
        places = listed(dict.fromkeys(place_label(where) for _, where in pairs))
        return f"{effects_label(diagnosis.effects)}{' ' if places else ''}{places}"
    return listed(
        effect_label(effect) if AT in effect else f"{effect_label(effect)} {place_label(where)}"
        for effect, where in pairs
    )


def _unknown_sentence(diagnosis: Diagnosis) -> str:
    scored = [c for c in diagnosis.candidates if c.effects and math.isfinite(c.error_over_noise)]
    best = min(scored, key=lambda c: c.error_over_noise, default=None)
    places = listed(dict.fromkeys(map(place_label, diagnosis.where)))
    points = f"; the evidence points to a cause {places}" if places else ""
    if best is None:
        return f"The cause of the gap is unknown{points}."
    return (
        f"The cause of the gap is unknown: the best of {len(scored)} candidates, {effects_label(best.effects)}, "
        f"still leaves {times_floor(best.error_over_noise)}{points}."
    )


def _shrinks(before: float, after: float, of: str = "") -> str:
    """Return by how much the error above the noise floor shrinks between two stages, in noise floors."""
    if not before > 1.0:
        return "closes none of it, because there is hardly any gap"
    share = (before - after) / (before - 1.0)
    # A set that stays below half a percent would read "closes 0 %".
    return f"closes {percent(share)} of the gap{of}" if share >= 0.005 else f"closes none of the gap{of}"


def remainder_sentence(diagnosis: Diagnosis) -> str:
    """Return the remaining error of a named or an unknown cause and its correlated signal; empty where there is none."""
    remainder = diagnosis.remainder
    if remainder is None or not remainder.goes_with or diagnosis.verdict not in ("effect", "unknown"):
        return ""
    if _is_named_by_motion(diagnosis):
        # What the simulation leaves says nothing of a cause that the simulation did not name.
        return ""
    return remainder.text


def given_text(diagnosis: Diagnosis, name: str) -> str:
    """Return the value that a parameter has in the given simulation; empty where it has none."""
    return f"{diagnosis.given[name]:.4g}" if name in diagnosis.given else ""


def fault_sentences(diagnosis: Diagnosis) -> list[str]:
    """Return what is wrong with the records or the campaign, with the remedy; it counts before any verdict."""
    if diagnosis.data_quality is None:
        return []
    faults = [finding for finding in diagnosis.data_quality.findings if finding.serious]
    return [f"Check the records first: {finding.sentence} {finding.remedy}".strip() for finding in faults]


def missing_force_sentence(diagnosis: Diagnosis) -> str:
    """Return a sentence on the missing force if no effect explains the gap; empty where the motion does not show it."""
    found = diagnosis.missing_force
    if found is None or diagnosis.verdict != "unknown" or not found.forces:
        return ""
    force = found.forces[0]
    size = f"Along the measured motion a force of {force.rms:.3g} {force.unit} RMS is missing {place_label(force.where)}"
    if len(found.forces) > 1:
        size += f", which alone would explain {percent(force.share)} of what the equations leave"
    laws = [
        f"{effect_label(kind_of(cause.effect.name))} {place_label(cause.where)} {percent(cause.share)}"
        for cause in found.alone[:_LAWS_NAMED]
        if cause.share > found.by_chance
    ]
    if not laws:
        return f"{size}; no law of the catalogue explains it."
    return f"{size}. Of its square, each alone: {listed(laws)}."


def ambiguity_sentence(diagnosis: Diagnosis) -> str:
    """Return which other causes belong to the likely ones; empty where there are none."""
    sentences = []
    if diagnosis.ambiguous_with:
        rivals = listed((effects_label(effects) for effects in diagnosis.ambiguous_with), "or")
        sentences.append(f"These records cannot tell {effects_label(diagnosis.effects)} from {rivals}.")
    if diagnosis.verdict == "effect" and diagnosis.likely.outside:
        sentences.append("A cause outside the catalogue is also among the likely causes.")
    return " ".join(sentences)


def advice_sentences(diagnosis: Diagnosis) -> list[str]:
    """Return, for each rival, the experiment that would tell it from the named effects."""
    several = len({name for trace in diagnosis.traces for name in trace.inputs}) > 1
    sentences = []
    for advice in diagnosis.advice:
        unit = diagnosis.units.get(advice.source, "")
        size = f"amplitude {advice.amplitude:.3g}{behind(unit)}"
        band = f" on {advice.source}" if several else ""
        if advice.band is not None:
            low, high = advice.band
            band += f" at {low:.3g} rad/s" if low == high else f" from {low:.3g} to {high:.3g} rad/s"
        rival = effects_label(advice.rival)
        if advice.separation < _SEPARATES:
            sentences.append(
                f"None of the experiments considered would rule out {rival}: with the best, a {advice.waveform} of {size}{band}, "
                f"the two predictions of {advice.output} differ by only {_deviations(advice.separation)} of the noise."
            )
        else:
            sentences.append(
                f"To confirm or rule out {rival}, record a {advice.waveform} of {size}{band}: the two predictions of "
                f"{advice.output} then differ by {_deviations(advice.separation)} of the noise."
            )
    return sentences


def _deviations(separation: float) -> str:
    if separation < 0.1:
        return "less than 0.1 standard deviations"
    if separation > _DECIDES:
        return f"more than {_DECIDES:g} standard deviations"
    return f"{separation:{'.0f' if separation >= 10.0 else '.2g'}} standard deviations"


def what_is_probable(diagnosis: Diagnosis) -> str:
    """Return what the probability of a diagnosis is that of: the named families, or no missing effect."""
    named = [family_label(own) for own in diagnosis.families if own.share > 0.0]
    return (
        (listed(named) or effects_label(diagnosis.effects))
        if diagnosis.effects
        else _STATED[diagnosis.verdict]
    )


def basis_sentence(diagnosis: Diagnosis) -> str:
    """Return on which records the errors were measured."""
    windows = ""
    if diagnosis.windows is not None:
        windows = f", scored in windows of {diagnosis.windows:.3g} s, each with its own initial state"
    elif diagnosis.window_cycles is not None:
        windows = f", scored in windows of {diagnosis.window_cycles} cycles, each with its own initial state"
    elif diagnosis.bandwidth is not None:
        windows = f", of models that follow the measured motion up to {diagnosis.bandwidth:.3g} rad/s"
    if diagnosis.scored_on == "validation":
        chosen = ""
        if diagnosis.verdict == "effect" and diagnosis.error_of_choice is not None:
            chosen = (
                " The model was also selected on these records, which makes this error optimistic. A model selected on part of "
                "them leaves "
                f"{diagnosis.error_of_choice:.3g} times the noise floor on the rest."
            )
        return f"Errors are those of validation records, which were not fitted{windows}.{chosen}"
    return f"There is no validation record: errors are those of the fitted records{windows}, and therefore optimistic."

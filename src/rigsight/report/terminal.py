"""The verdict in about ten lines for a terminal: plain ASCII of our own, color only as an extra."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from rich.console import Console, ConsoleOptions, RenderResult
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from rigsight.diagnose.result import Candidate, Diagnosis
from rigsight.report.quantities import estimate_text, gap_percent
from rigsight.report.trust import trust_line
from rigsight.report.wording import (
    TIMES,
    advice_sentences,
    ambiguity_sentence,
    basis_sentence,
    effects_label,
    family_label,
    fault_sentences,
    forms_label,
    given_text,
    missing_force_sentence,
    named_candidate,
    percent,
    remainder_sentence,
    share_label,
    stages_reported,
    verdict_name,
    verdict_sentence,
    what_is_probable,
)

_RANKED = 3
_ADVICES = 1
_FAULTS = 3
"""Numbers of candidates, experiments and faults shown; the report holds all."""
_COLORS = {"effect": "bold green", "parameters": "bold green", "none": "bold green", "unknown": "bold yellow"}


@dataclass(frozen=True)
class Summary:
    """A rich renderable that says the verdict, the gap, the ranking and the parameters of a diagnosis."""

    diagnosis: Diagnosis

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the lines, in characters that the terminal's encoding has."""

        def text(words: str, style: str = "") -> Text:
            return plain_text(words, options.encoding, style)

        diagnosis = self.diagnosis
        yield text(f"{verdict_name(diagnosis)}: {diagnosis.title}", _COLORS[diagnosis.verdict])
        yield text(verdict_sentence(diagnosis))
        for sentence in fault_sentences(diagnosis)[:_FAULTS]:
            yield text(sentence, "bold yellow")
        if remainder_sentence(diagnosis):
            yield text(remainder_sentence(diagnosis))
        if missing_force_sentence(diagnosis):
            yield text(missing_force_sentence(diagnosis))
        if trust_line(diagnosis):
            yield text(trust_line(diagnosis))
        if ambiguity_sentence(diagnosis):
            yield text(ambiguity_sentence(diagnosis))
        for sentence in advice_sentences(diagnosis)[:_ADVICES]:
            yield text(sentence)
        table = Table.grid(padding=(0, 2))
        for subject, words in diagnosis_rows(diagnosis):
            table.add_row(text(subject, "bold"), text(words))
        yield Padding(table, (0, 0, 0, 2), expand=False)
        yield text(basis_sentence(diagnosis), "dim")


def plain_text(words: str, encoding: str, style: str = "") -> Text:
    """Return words as a terminal with this encoding can show them, each control character as a question mark."""
    # An escape sequence in somebody's title must not reach the terminal.
    plain = "".join(c if c.isprintable() else "?" for c in words.replace(TIMES, "x"))
    return Text(plain.encode(encoding, "replace").decode(encoding), style)


def summary(diagnosis: Diagnosis) -> Summary:
    """Return the diagnosis as a rich renderable of about ten lines."""
    return Summary(diagnosis)


def diagnosis_rows(diagnosis: Diagnosis) -> Iterator[tuple[str, str]]:
    """Yield subject and words: the gap of each output, the best candidates, the numbers of the effect and of the rig."""
    for output, gap in diagnosis.gap.items():
        yield (
            f"gap in {output}",
            f"{stages_reported(diagnosis, gap)}, noise floor {gap_percent(gap.noise_floor)}",
        )
    for cause in diagnosis.families[:_RANKED]:
        of_gap = f", {share_label(cause)} of the squared gap" if cause.share > 0.0 else ""
        yield family_label(cause), f"probability {percent(cause.probability)}{of_gap}: {forms_label(cause)}"
    if diagnosis.candidates:
        yield "candidates", "; ".join(map(_candidate, diagnosis.candidates[:_RANKED]))
        if not diagnosis.effects:
            yield "probability", f"{percent(diagnosis.probability)} for {what_is_probable(diagnosis)}"
    named = named_candidate(diagnosis)
    if named is not None and named.parameters:
        own = diagnosis.model.get("effect_parameters", {}) if diagnosis.effects else named.parameters
        for subject, is_told in (("parameters", True), ("of the rig", False)):
            numbers = [
                f"{name} = {estimate_text(estimate)}{_given(diagnosis, name)}"
                for name, estimate in named.parameters.items()
                if (name in own) == is_told
            ]
            if numbers:
                yield subject, "; ".join(numbers)


def _given(diagnosis: Diagnosis, name: str) -> str:
    given = given_text(diagnosis, name)
    return f" (given {given})" if given else ""


def _candidate(candidate: Candidate) -> str:
    left = (
        f"{candidate.error_over_noise:.3g} x floor"
        if math.isfinite(candidate.error_over_noise)
        else "not scored"
    )
    unfinished = "" if candidate.success else ", not converged"
    return f"{effects_label(candidate.effects)} {percent(candidate.probability)} ({left}{unfinished})"

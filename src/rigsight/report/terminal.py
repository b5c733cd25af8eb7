"""A diagnosis and a discovery on a terminal and in a notebook; plain ASCII of our own, color only as an extra."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from rigsight.diagnose.result import Candidate, Diagnosis, Estimate
from rigsight.discover.result import Discovery, Term
from rigsight.report import labels, wording
from rigsight.report.labels import estimate_text, gap_percent
from rigsight.report.page import notebook_html
from rigsight.report.sections import trust_line

_RANKED = 3
_ADVICES = 1
_FAULTS = 3
"""Numbers of candidates and rivals, experiments and faults shown; the report holds all."""
_COLORS = {"effect": "bold green", "parameters": "bold green", "none": "bold green", "unknown": "bold yellow"}
Writer = Callable[..., Text]
"""Makes a line of words and, optionally, a style."""


@dataclass(frozen=True)
class Summary:
    """A rich renderable: lines, in characters that the terminal's encoding has, for the width of the terminal."""

    lines: Callable[[Writer, int], Iterator[RenderableType]]

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the lines."""
        return self.lines(
            lambda words, style="": plain_text(words, options.encoding, style), options.max_width
        )


def plain_text(words: str, encoding: str, style: str = "") -> Text:
    """Return words as a terminal with this encoding can show them, each control character as a question mark."""
    # An escape sequence in somebody's title must not reach the terminal.
    plain = "".join(c if c.isprintable() else "?" for c in words.replace(labels.TIMES, "x"))
    return Text(plain.encode(encoding, "replace").decode(encoding), style)


def pairs(rows: Iterable[tuple[str, str]], text: Writer) -> Padding:
    """Return subjects and words as a table of two columns."""
    table = Table.grid(padding=(0, 2))
    for subject, words in rows:
        table.add_row(text(subject, "bold"), text(words))
    return Padding(table, (0, 0, 0, 2), expand=False)


def worth_knowing(notes: Sequence[str], text: Writer, n_more: int = 0, file: str = "") -> Iterator[Text]:
    """Yield what must be known about a result, and how much more of it a file holds; nothing without a note."""
    if notes:
        yield text("Worth knowing", "bold yellow")
    for note in notes:
        yield text(f"- {note}")
    if n_more > 0:
        yield text(f"- and {n_more} more in {file}.", "dim")


def summary(diagnosis: Diagnosis) -> Summary:
    """Return the verdict, the gap, the ranking and the parameters of a diagnosis, in about ten lines."""

    def lines(text: Writer, _: int) -> Iterator[RenderableType]:
        yield text(f"{wording.verdict_name(diagnosis)}: {diagnosis.title}", _COLORS[diagnosis.verdict])
        yield text(wording.verdict_sentence(diagnosis))
        for sentence in wording.fault_sentences(diagnosis)[:_FAULTS]:
            yield text(sentence, "bold yellow")
        for sentence_of in (
            wording.remainder_sentence,
            wording.missing_force_sentence,
            trust_line,
            wording.ambiguity_sentence,
        ):
            if sentence := sentence_of(diagnosis):
                yield text(sentence)
        for sentence in wording.advice_sentences(diagnosis)[:_ADVICES]:
            yield text(sentence)
        yield pairs(diagnosis_rows(diagnosis), text)
        yield text(wording.basis_sentence(diagnosis), "dim")

    return Summary(lines)


def diagnosis_rows(diagnosis: Diagnosis) -> Iterator[tuple[str, str]]:
    """Yield subject and words: the gap of each output, the best candidates, the numbers of the effect and of the rig."""
    for output, gap in diagnosis.gap.items():
        yield (
            f"gap in {output}",
            f"{wording.stages_reported(diagnosis, gap)}, noise floor {gap_percent(gap.noise_floor)}",
        )
    for cause in diagnosis.families[:_RANKED]:
        of_gap = (
            f", {labels.share_label(cause)} of the {labels.gap_of_shares(diagnosis)}" if cause.share else ""
        )
        yield (
            labels.family_label(cause),
            f"probability {labels.percent(cause.probability)}{of_gap}"
            + (f": {labels.forms_label(cause)}" if cause.forms else "; no fit of it is a candidate"),
        )
    if diagnosis.candidates:
        ranked = "; ".join(map(_candidate, diagnosis.candidates[:_RANKED]))
        yield "candidates", f"probability that exactly these are missing: {ranked}"
        if not diagnosis.effects:
            yield (
                "probability",
                f"{labels.percent(diagnosis.probability)} for {wording.what_is_probable(diagnosis)}",
            )
    named = wording.named_candidate(diagnosis)
    if named is not None and named.parameters:
        own = diagnosis.model.get("effect_parameters", {}) if diagnosis.effects else named.parameters
        for subject, is_of_effect in (("parameters", True), ("of the rig", False)):
            numbers = [
                f"{name} = {estimate_text(estimate)}{_given(diagnosis, name)}"
                for name, estimate in named.parameters.items()
                if (name in own) == is_of_effect
            ]
            if numbers:
                yield subject, "; ".join(numbers)


def _given(diagnosis: Diagnosis, name: str) -> str:
    given = wording.given_text(diagnosis, name)
    return f" (given {given})" if given else ""


def _candidate(candidate: Candidate) -> str:
    error = (
        f"{candidate.error_over_noise:.3g} x floor"
        if math.isfinite(candidate.error_over_noise)
        else "not scored"
    )
    unfinished = "" if candidate.success else ", not converged"
    return f"{labels.effects_label(candidate.effects)} {labels.percent(candidate.probability)} ({error}{unfinished})"


def discovery_summary(discovery: Discovery) -> Summary:
    """Return the equations, their terms and numbers, the held-out error, and what must be known of a discovery."""

    def lines(text: Writer, _: int) -> Iterator[RenderableType]:
        yield text(f"Discovered: {discovery.title}", "bold green")
        for equation in discovery.equations:
            yield Padding(text(equation), (0, 0, 0, 2))
        yield pairs(discovery_rows(discovery), text)
        for name, alone in discovery.by_record:
            yield text(f"{name} alone: {_alone(alone)}")
        yield from worth_knowing(discovery.warnings, text)

    return Summary(lines)


def discovery_rows(found: Discovery) -> Iterator[tuple[str, str]]:
    """Yield subject and words: the numbers, the terms, the held-out error, the rivals."""
    for name, c in found.rig_parameters.items():
        yield name, estimate_text(Estimate(c.value, c.std, c.unit))
    for term in found.kept:
        yield f"{term.name} at {term.where}" if term.where else term.name, _term(term)
    for joint in found.joints:
        yield f"missing at {joint.joint}", joint.sentence
    if found.offered is not None:
        yield "outside the library", found.offered.sentence
    if found.own_laws:
        yield "in no catalogue", found.laws_sentence
    for own in found.held_out:
        error = f"{gap_percent(own.nrmse)}, {own.error_over_noise:.3g} x floor"
        yield f"{own.record}, held out", f"{error}; not fitted, but it chose among the terms"
    for rival in found.alternatives[:_RANKED]:
        error = (
            f"{rival.held_out:.3g} x floor, BIC {rival.bic:.1f}"
            if math.isfinite(rival.held_out)
            else "diverges"
        )
        yield "compared", f"{', '.join(rival.terms) or 'no further term'}: {error}"


def _term(term: Term) -> str:
    numbers = [
        f"{name} = {estimate_text(Estimate(c.value, c.std, c.unit))}" for name, c in term.coefficients.items()
    ]
    family = [term.family.replace("_", " ")] if term.family else []
    without = [f"without it {term.otherwise:.3g} x floor"] if math.isfinite(term.otherwise) else []
    selected = [] if term.inclusion is None else [f"selected in {100 * term.inclusion:.0f} % of the draws"]
    return f"{'; '.join(numbers)} ({'; '.join([*family, *without, *selected])})"


def _alone(found: Discovery | str) -> str:
    if isinstance(found, str):
        return found
    terms = ", ".join(term.name for term in found.kept)
    return f"{terms or 'no further term'}, held-out error {gap_percent(found.held_out_nrmse)}"


def diagnosis_html(diagnosis: Diagnosis) -> str:
    """Return verdict, gap, ranking and the numbers of the effect."""
    sentences = [
        wording.verdict_sentence(diagnosis),
        *wording.fault_sentences(diagnosis),
        wording.missing_force_sentence(diagnosis),
        wording.remainder_sentence(diagnosis),
        trust_line(diagnosis),
        wording.ambiguity_sentence(diagnosis),
        *wording.advice_sentences(diagnosis),
        wording.basis_sentence(diagnosis),
    ]
    rows = ((), list(diagnosis_rows(diagnosis)))
    return notebook_html(f"{wording.verdict_name(diagnosis)}: {diagnosis.title}", sentences, [rows])


def discovery_html(discovery: Discovery) -> str:
    """Return the equations, their numbers and terms, and the error on the held-out records."""
    rows = ((), list(discovery_rows(discovery)))
    return notebook_html(f"Discovered: {discovery.title}", discovery.equations, [rows], discovery.warnings)

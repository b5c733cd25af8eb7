"""A discovery for a terminal: the equations, their terms and numbers, the held-out error, and what must be known."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from rich.console import Console, ConsoleOptions, RenderResult
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from rigsight.diagnose.result import Estimate
from rigsight.discover import Discovery, JointForce
from rigsight.discover.result import Term
from rigsight.report.quantities import estimate_text, gap_percent
from rigsight.report.terminal import plain_text

_MOST_RIVALS = 3


@dataclass(frozen=True)
class DiscoverySummary:
    """A rich renderable of a discovery."""

    discovery: Discovery

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the lines, in characters that the terminal's encoding has."""

        def text(words: str, style: str = "") -> Text:
            return plain_text(words, options.encoding, style)

        found = self.discovery
        yield text(f"Discovered: {found.title}", "bold green")
        for equation in found.equations:
            yield Padding(text(equation), (0, 0, 0, 2))
        table = Table.grid(padding=(0, 2))
        for subject, words in discovery_rows(found):
            table.add_row(text(subject, "bold"), text(words))
        yield Padding(table, (0, 0, 0, 2), expand=False)
        for name, alone in found.by_record:
            yield text(f"{name} alone: {_alone(alone)}")
        if found.warnings:
            yield text("Worth knowing", "bold yellow")
            for warning in found.warnings:
                yield text(f"- {warning}")


def discovery_summary(discovery: Discovery) -> DiscoverySummary:
    """Return the discovery as a rich renderable."""
    return DiscoverySummary(discovery)


def discovery_rows(found: Discovery) -> Iterator[tuple[str, str]]:
    """Yield subject and words: the numbers, the terms, the held-out error, the rivals."""
    for name, c in found.rig_parameters.items():
        yield name, estimate_text(Estimate(c.value, c.std, c.unit))
    for term in found.kept:
        if term.name not in found.rig_parameters:
            yield f"{term.name} at {term.where}" if term.where else term.name, _term(term)
    for joint in found.joints:
        yield f"missing at {joint.joint}", _joint(joint)
    where = ", ".join(found.held_out)
    yield (
        "held-out error",
        f"{gap_percent(found.held_out_nrmse)} on {where} (noise floor {gap_percent(found.noise_floor)})",
    )
    for rival in found.alternatives[:_MOST_RIVALS]:
        error = (
            f"{rival.held_out:.3g} x floor, BIC {rival.bic:.1f}"
            if math.isfinite(rival.held_out)
            else "diverges"
        )
        yield "compared", f"{', '.join(rival.terms) or 'no further term'}: {error}"


def _term(term: Term) -> str:
    numbers = "; ".join(
        f"{name} = {estimate_text(Estimate(c.value, c.std, c.unit))}" for name, c in term.coefficients.items()
    )
    return f"{numbers} (selected in {100 * term.inclusion:.0f} % of the draws)"


def _joint(joint: JointForce) -> str:
    left = f"leaves {joint.error_over_noise:.3g} x floor"
    reported = " and ".join(term.text for term in joint.law.terms) or "not a function of the motion"
    return f"explains {100 * joint.share:.4g} % of the sensor errors, {left}: {reported}"


def _alone(found: Discovery | str) -> str:
    if isinstance(found, str):
        return found
    terms = ", ".join(term.name for term in found.kept if term.name not in found.rig_parameters)
    return f"{terms or 'no further term'}, held-out error {gap_percent(found.held_out_nrmse)}"

"""A planned experiment as one self-contained HTML page without a script."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from rigsight.plan import Sizes
from rigsight.plan.planning import DECIDED, Plan
from rigsight.report.figures import page_figure
from rigsight.report.labels import percent
from rigsight.report.page import rendered
from rigsight.units import INPUT_UNIT

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SIZES: Mapping[Sizes, str] = {
    "fitted": "Each rival was fitted to the records.",
    "usual": "No verdict named the rivals: they have a usual size. Each was fitted to the records as they would be if another "
    "one were true.",
    "usual, no records": "There are no records yet: the rivals have a usual size, the rig the numbers of its file.",
}
_GAIN = 0.05
"""Gain of probability below which an experiment is not worth its time (a convention)."""
_MOSTLY = 0.5
"""Share of the outcomes from which an experiment that decides tells rivals apart (a convention)."""


def render_plan(plan: Plan, picture: Figure, command: str, versions: Mapping[str, str], seed: int) -> str:
    """Return the page of a plan."""
    record = plan.record
    shown = {name: "" if unit == INPUT_UNIT else unit for name, unit in record.units.items()}
    units = {}
    for limit, _ in plan.limits:
        unit = shown.get(limit.signal, "")
        units[limit.name] = f"{unit or '1'}/s" if limit.is_rate else unit
    return rendered(
        "plan.html.jinja",
        command or "from Python",
        versions,
        seed,
        plan=plan,
        headline=plan_headline(plan),
        instructions=[
            f"plan.csv holds the time and every input at {1.0 / record.dt:.5g} Hz, in SI units.",
            "Measure every sensor meanwhile, and list the record in the campaign.",
        ],
        picture=page_figure(
            picture,
            "plan",
            plan_headline(plan),
            "The inputs, the readings that each rival predicts, and the residual of the others.",
        ),
        units=units,
        sizes=_SIZES[plan.sizes],
        promise=promise(plan),
    )


def plan_headline(plan: Plan) -> str:
    """Return what to play in a sentence."""
    constants = ", ".join(f"{name} = {value:g}" for name, value in plan.record.constants.items())
    return f"Play: {plan.what}, {plan.record.duration:g} s{f', with {constants}' if constants else ''}."


def promise(plan: Plan) -> str:
    """Return what to expect afterwards."""
    trials = plan.trials
    remark = ""
    # No probability exceeds that of a verdict, so that one which is high already hardly gains.
    if plan.now >= DECIDED:
        remark = "The records decide between these rivals already. "
    elif plan.promised <= plan.now + _GAIN and trials.decided <= _MOSTLY:
        remark = "No record within these limits tells these rivals apart. "
    return (
        f"{remark}"
        f"Expected probability of the cause: {plan.now:.2f} now, {plan.promised:.2f} afterwards. "
        f"In {trials.n} simulated outcomes the cause was the most probable in {percent(trials.right)}, "
        f"decided in {percent(trials.decided)}, wrongly in {percent(trials.wrong)}."
    )

"""A diagnosis as one self-contained HTML page: no network, nothing beside the file, and readable without its script."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.resources import files

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from rigsight.diagnose.location.trace import STAGES
from rigsight.diagnose.result import Diagnosis
from rigsight.effects import CATALOGUE, Effect
from rigsight.report import location, sections
from rigsight.report.drawing.loop_figures import loop_figures
from rigsight.report.drawing.response_charts import amplitude_figures
from rigsight.report.drawing.rig_figure import rig_figure
from rigsight.report.quantities import Written, effect_of, rig_of
from rigsight.report.record_views import record_views
from rigsight.report.responses import record_responses
from rigsight.report.trust import trust_view
from rigsight.report.wording import (
    advice_sentences,
    ambiguity_sentence,
    basis_sentence,
    effect_label,
    effects_label,
    error_over_noise,
    fault_sentences,
    missing_force_sentence,
    percent,
    remainder_sentence,
    sentence_case,
    stage_names,
    times_floor,
    verdict_name,
    verdict_sentence,
    what_is_probable,
)
from rigsight.rigs import Rig
from rigsight.simulate import compose
from rigsight.simulate.printing.notation import mathml_equation
from rigsight.simulate.printing.shown import shown_equations

_TEMPLATES = files("rigsight.report") / "templates"


def render_report(
    diagnosis: Diagnosis,
    command: str,
    versions: Mapping[str, str],
    seed: int | None = None,
    own_effects: Iterable[Effect] = (),
) -> str:
    """Return the report as one HTML page.

    Parameters
    ----------
    diagnosis
        The result.
    command
        The command line that made it.
    versions
        Package -> version, as in ``{"rigsight": "0.1.0", "numpy": "2.0.0"}``.
    seed
        Seed of everything random; None where nothing was.
    own_effects
        Effects beside those of the catalogue that the simulation may have.
    """
    known = known_effects(own_effects)
    responses = {trace.record: record_responses(diagnosis, trace) for trace in diagnosis.traces}
    script = _script()
    return (
        environment()
        .get_template("report.html.jinja")
        .render(
            diagnosis=diagnosis,
            verdict_name=verdict_name(diagnosis),
            verdict_sentence=verdict_sentence(diagnosis),
            fault_sentences=fault_sentences(diagnosis),
            missing_force_sentence=missing_force_sentence(diagnosis),
            law_rows=location.law_rows(diagnosis),
            remainder_sentence=remainder_sentence(diagnosis),
            ambiguity_sentence=ambiguity_sentence(diagnosis),
            basis_sentence=basis_sentence(diagnosis),
            stages=stage_names(diagnosis),
            rivals=[sentence_case(effects_label(effects)) for effects in diagnosis.ambiguous_with],
            effects=sections.effect_summaries(diagnosis, known),
            left={stage: times_floor(error_over_noise(diagnosis, stage)) for stage in STAGES},
            probability=percent(diagnosis.probability) if diagnosis.candidates else "",
            what_is_probable=what_is_probable(diagnosis),
            rig_figure=rig_figure(diagnosis),
            budget=sections.budget_figure(diagnosis),
            budget_rows=sections.budget_rows(diagnosis),
            path_sentence=diagnosis.localization.sentence.replace("->", "\u2192"),
            path_rows=location.path_rows(diagnosis),
            place_rows=location.place_rows(diagnosis),
            maps=[
                *location.force_maps(diagnosis),
                *location.output_maps(diagnosis),
                *location.joint_maps(diagnosis),
            ],
            share_rows=location.share_rows(diagnosis),
            ranking=sections.ranking_figure(diagnosis) if diagnosis.candidates else None,
            family_rows=sections.family_rows(diagnosis),
            ranking_rows=sections.ranking_rows(diagnosis),
            outputs=[sections.output_label(diagnosis, output) for output in diagnosis.gap],
            parameters=sections.parameter_rows(diagnosis, known),
            has_given=bool(diagnosis.given),
            trust=trust_view(diagnosis),
            errors_reported=sections.errors_reported(diagnosis),
            equations=equation_groups(diagnosis, known),
            amplitude_figures=amplitude_figures(diagnosis, responses),
            loops=loop_figures(diagnosis),
            records=list(record_views(diagnosis, responses)),
            advice=advice_sentences(diagnosis),
            findings=sections.finding_rows(diagnosis),
            notes=sections.other_notes(diagnosis),
            script=Markup(script),
            script_hash=_content_hash(script),
            floors=sections.floor_rows(diagnosis),
            command=command,
            versions=versions,
            seed=seed,
            made=datetime.now(UTC),
        )
    )


def _script() -> str:
    """Return what the page runs: uPlot, below the license that must go with it, and what sets up its charts."""
    terms, library, charts = (
        (_TEMPLATES / name).read_text(encoding="utf-8")
        for name in ("uplot/LICENSE", "uplot/uPlot.iife.min.js", "charts.js")
    )
    return f"\n/* {terms}*/\n{library}{charts}"


def _content_hash(script: str) -> str:
    """Return the name by which the page's policy allows this one script and no other."""
    return f"sha256-{base64.b64encode(hashlib.sha256(script.encode('utf-8')).digest()).decode('ascii')}"


def environment(*packages: str) -> Environment:
    """Return what all pages are rendered with."""
    made = Environment(
        loader=ChoiceLoader([PackageLoader(name) for name in ("rigsight.report", *packages)]),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )
    made.filters |= {"unit": _unit, "number": _number}
    return made


def _unit(unit: str) -> Markup:
    """Return a unit with its exponents raised; nothing for a dimensionless one."""
    if unit in ("", "1"):
        return Markup("")
    parts = str(escape(unit)).split("^")
    raised = [parts[0]]
    for part in parts[1:]:
        digits = len(part) - len(part.lstrip("-0123456789"))
        raised.append(f"<sup>{part[:digits].replace('-', '&minus;')}</sup>{part[digits:]}")
    return Markup("".join(raised))


def _number(number: Written) -> Markup:
    """Return a number as ``(3.100 ± 0.020) · 10<sup>5</sup>``."""
    text = escape(number.value.replace("-", "\u2212"))
    if number.std:
        text = Markup("{} ± {}").format(text, number.std)
    if not number.exponent:
        return text
    brackets = Markup("({})") if number.std else Markup("{}")
    power = str(number.exponent).replace("-", "\u2212")
    return brackets.format(text) + Markup(" · 10<sup>{}</sup>").format(power)


@dataclass(frozen=True)
class EquationGroup:
    """Equations that belong together: whose they are, and each as MathML."""

    title: str
    equations: list[Markup]


def known_effects(own: Iterable[Effect] = ()) -> dict[str, Effect]:
    """Return the effects of the catalogue and a user's own by name."""
    return {effect.name: effect for effect in (*CATALOGUE, *own)}


def equation_groups(diagnosis: Diagnosis, known: Mapping[str, Effect]) -> list[EquationGroup]:
    """Return the equations of the rig, then those of each effect of the diagnosed simulation, in the order of the signal path."""
    rig = rig_of(diagnosis)
    # What the given simulation had already stands in the model beside what was added.
    names = dict.fromkeys([*diagnosis.model.get("effects", ()), *diagnosis.effects])
    effects = [effect_of(name, known) for name in names]
    named = [effect for effect in effects if effect is not None]
    if rig is None or len(named) < len(effects):
        return []
    return equations_of(rig, named)


def equations_of(rig: Rig, effects: Sequence[Effect]) -> list[EquationGroup]:
    """Return the equations of a rig, then those of each effect on it, in the order of the signal path."""
    shown = shown_equations(compose(rig, effects), effect_label)
    return [
        EquationGroup(
            sentence_case(rig.name.replace("_", " ") if owner is None else effect_label(owner)),
            [Markup(mathml_equation(equation, shown.names)) for equation in equations],
        )
        for owner, equations in shown.of_owners.items()
    ]

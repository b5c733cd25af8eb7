"""A diagnosis as one self-contained HTML page: no network, nothing beside the file, and readable without its script."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

from markupsafe import Markup

from rigsight.diagnose.result import Diagnosis
from rigsight.effects import CATALOGUE, Effect
from rigsight.report import labels, location, record_views, sections, wording
from rigsight.report.figures import loop_figures, rig_figure
from rigsight.report.page import rendered
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
    origin: Mapping[str, Any] | None = None,
) -> str:
    """Return the report as one HTML page; `origin` is what repeats it, see `workflow.reproduce`."""
    known = known_effects(own_effects)
    responses = {trace.record: record_views.record_responses(diagnosis, trace) for trace in diagnosis.traces}
    script = _script()
    # The name by which the page's policy allows this one script and no other.
    digest = base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")
    return rendered(
        "report.html.jinja",
        command,
        versions,
        seed,
        diagnosis=diagnosis,
        origin=origin,
        origin_text=json.dumps(origin),
        labels=labels,
        wording=wording,
        sections=sections,
        record_views=record_views,
        stages=wording.stage_names(diagnosis),
        outputs={output: sections.output_label(diagnosis, output) for output in diagnosis.gap},
        known=known,
        rig_figure=rig_figure(diagnosis),
        maps=location.all_maps(diagnosis),
        equations=equation_groups(diagnosis, known),
        amplitude_figures=record_views.amplitude_figures(diagnosis, responses),
        loops=loop_figures(diagnosis),
        records=list(record_views.record_charts(diagnosis, responses)),
        advice=wording.advice_sentences(diagnosis),
        script=Markup(script),
        script_hash=f"sha256-{digest}",
    )


def _script() -> str:
    """Return what the page runs: uPlot, below the license that must go with it, and what sets up its charts."""
    terms, library, charts = (
        (_TEMPLATES / name).read_text(encoding="utf-8")
        for name in ("uplot/LICENSE", "uplot/uPlot.iife.min.js", "charts.js")
    )
    return f"\n/* {terms}*/\n{library}{charts}"


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
    rig = labels.rig_of(diagnosis)
    # What the given simulation had already is in the model beside what was added.
    names = dict.fromkeys([*diagnosis.model.get("effects", ()), *diagnosis.effects])
    effects = [labels.effect_of(name, known) for name in names]
    named = [effect for effect in effects if effect is not None]
    if rig is None or len(named) < len(effects):
        return []
    return equations_of(rig, named)


def equations_of(rig: Rig, effects: Sequence[Effect]) -> list[EquationGroup]:
    """Return the equations of a rig, then those of each effect on it, in the order of the signal path."""
    shown = shown_equations(compose(rig, effects), labels.effect_label)
    return [
        EquationGroup(
            labels.sentence_case(rig.name.replace("_", " ") if owner is None else labels.effect_label(owner)),
            [Markup(mathml_equation(equation, shown.names)) for equation in equations],
        )
        for owner, equations in shown.of_owners.items()
    ]

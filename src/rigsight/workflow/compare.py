"""The work of `rigsight compare`: models and a campaign -> `comparison.json`, `.csv`, `.html` and figures."""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import cast

from joblib import Parallel, delayed

from rigsight.campaign import Campaign
from rigsight.compare import Comparison, Competitor, Floor, Yardstick, compare_on_record
from rigsight.compare.comparison import comparison_csv, comparison_json
from rigsight.diagnose.noise.detection import noise_floors
from rigsight.effects import Effect
from rigsight.errors import InputError, check_option, readable
from rigsight.identify.closed_loop import closed_loop_notes
from rigsight.identify.fit.windows import cut, window_length
from rigsight.identify.transfer.record_response import METHODS, Method
from rigsight.plot import svg_text
from rigsight.report.comparison import comparison_figures, render_comparison
from rigsight.rigs import Rig
from rigsight.simulate import Model, compose
from rigsight.simulate.equilibrium import can_drift
from rigsight.workflow.campaign.model_file import MODEL_FILE, named_model, of_this_rig
from rigsight.workflow.campaign.read_campaign import free_name, read_campaign
from rigsight.workflow.run.kernels import checked_jobs, prepare_kernels
from rigsight.workflow.run.progress import Listener, Stage, silent
from rigsight.workflow.run.results import check_writable, json_text, versions, write_together

COMPARISON_FILE, TABLE_FILE, PAGE_FILE = "comparison.json", "comparison.csv", "comparison.html"
COMPARING = "Comparing"
GIVEN = "given"
"""Name of the given simulation of a campaign among models."""


def run_compare(
    campaign: str | Path,
    models: Sequence[str | Path],
    out: str | Path | None = None,
    *,
    method: str = "local_rational",
    step_seconds: float = 4.0,
    own_effects: Sequence[Effect] = (),
    own_rigs: Sequence[Rig] = (),
    n_jobs: int | None = None,
    listener: Listener = silent,
    command: str | None = None,
) -> Comparison:
    """Score models on all records of a campaign."""
    _check_wishes(models, method, step_seconds)
    jobs = checked_jobs(n_jobs)
    if out is not None:
        check_writable(Path(out), COMPARISON_FILE, TABLE_FILE, PAGE_FILE)
    read = read_campaign(campaign, own_effects, own_rigs)
    competitors = named_competitors(models, read, own_effects, own_rigs)
    comparison = compare_campaign(read, competitors, method, step_seconds, jobs, listener)
    if out is not None:
        quoted = shlex.join(["rigsight", "compare", str(campaign), *map(str, models)])
        write_comparison(comparison, Path(out), command or quoted)
    return comparison


def compare_campaign(
    campaign: Campaign,
    competitors: Sequence[Competitor],
    method: str = "local_rational",
    step_seconds: float = 4.0,
    n_jobs: int = 1,
    listener: Listener = silent,
) -> Comparison:
    """Score models on all records of a campaign that was read or made of records."""
    _check_wishes(competitors, method, step_seconds)
    if method == "thesis" and not campaign.rig.has_one_motion:
        raise InputError(
            "The method 'thesis' supports only rigs of one motion with one input and no feedback, unlike the rig "
            f"'{campaign.rig.name}'; use --method local_rational."
        )
    chosen = cast("Method", method)
    rig = campaign.rig
    structures = {c.model.structure.effect_names: c.model.structure for c in competitors}
    prepare_kernels(list(structures.values()), n_jobs, listener)
    # If one model has no spring, all models are simulated in windows, so that the errors are comparable.
    drifts = any(can_drift(rig, c.model.values) for c in competitors)
    floors = tuple(
        Floor(floor.output, floor.unit, floor.std, floor.method, floor.lower_bound, floor.stretches)
        for floor in noise_floors(rig, campaign.records, drifts)
    )
    yardstick = Yardstick(rig, floors, chosen, step_seconds)
    length = window_length(rig, campaign.records) if drifts else None
    stage = Stage(COMPARING, len(campaign.records), listener)
    found = []
    # Threads suffice: kernels and linear algebra release the GIL.
    parallel = Parallel(n_jobs=n_jobs, prefer="threads", return_as="generator")
    for record in parallel(
        delayed(compare_on_record)(competitors, record, cut([record], length), yardstick)
        for record in campaign.records
    ):
        found.append(record)
        stage.finished(record.record.name)
    comparison = Comparison(
        title=campaign.title,
        rig=rig.name,
        method=chosen,
        step_seconds=step_seconds,
        window_length=length,
        competitors=tuple(competitors),
        records=tuple(found),
        floors=floors,
        notes=tuple(_notes(campaign, competitors)),
    )
    if not comparison.scores:
        reasons = "\n".join(f"- {f.model} on '{f.record}': {f.reason}" for f in comparison.failures[:10])
        raise InputError(f"No model can be compared on any record of {campaign.called}.\n{reasons}")
    return comparison


def _check_wishes(models: Sequence[object], method: str, step_seconds: float) -> None:
    check_option("The method", method, METHODS)
    if not (math.isfinite(step_seconds) and step_seconds > 0.0):
        raise InputError(f"The step window must last a positive number of seconds, got {step_seconds!r}.")
    if not models:
        raise InputError(
            f"Name at least one model: a {MODEL_FILE}, a folder that contains one, or a published set."
        )


def write_comparison(comparison: Comparison, out: Path, command: str) -> tuple[Path, ...]:
    """Write all results of a comparison into a folder, all or none."""
    figures = comparison_figures(comparison)
    return write_together(
        out,
        {
            COMPARISON_FILE: json_text(comparison_json(comparison, {f.file: f.caption for f in figures})),
            TABLE_FILE: comparison_csv(comparison),
            PAGE_FILE: render_comparison(comparison, figures, command=command, versions=versions()),
            **{figure.file: svg_text(figure.drawing, figure.file) for figure in figures},
        },
    )


def named_competitors(
    models: Sequence[str | Path],
    campaign: Campaign,
    own_effects: Sequence[Effect] = (),
    own_rigs: Sequence[Rig] = (),
) -> list[Competitor]:
    """Return models with names of their own."""
    found: list[Competitor] = []
    for text in map(str, models):
        name, source = _name_and_source(text)
        model = (
            given_model(campaign)
            if source == GIVEN and not Path(source).exists()
            else of_this_rig(text, named_model(source, own_effects, own_rigs), campaign)
        )
        found.append(Competitor(free_name(name, [c.name for c in found]), model, source))
    return found


def given_model(campaign: Campaign) -> Model:
    """Return the given simulation of a campaign as a model."""
    structure = compose(campaign.rig, campaign.modelled)
    defaults = {p.name: p.default for p in structure.parameters if p.default is not None}
    values = {**defaults, **campaign.constants, **campaign.given}
    missing = [name for name in structure.names if name not in values]
    if missing:
        raise InputError(
            f"The given simulation of {campaign.called} has no value of {', '.join(missing)}, so it cannot be compared. Give it "
            "under [rig.parameters]."
        )
    return Model(structure, {name: values[name] for name in structure.names}, campaign.estimation[0].hold)


def _name_and_source(text: str) -> tuple[str, str]:
    """Return name and path of a model: both from ``NAME=MODEL``, else the name is that of the folder of ``model.json``."""
    if "=" in text and not Path(text).exists():
        name, _, source = text.partition("=")
        if not name.strip() or not source:
            raise InputError(f"'{text}' cannot be read; write NAME=MODEL, for instance mine=identification.")
        return name.strip(), source
    path = Path(text)
    if path.name == MODEL_FILE:
        return readable(path.absolute().parent.name) or text, text
    return readable(path.stem if path.suffix == ".json" else path.absolute().name) or text, text


def _notes(campaign: Campaign, competitors: Sequence[Competitor]) -> list[str]:
    notes = [
        *campaign.notes,
        *(f"Record '{record.name}': {note}" for record in campaign.records for note in record.notes),
        *closed_loop_notes(campaign.records, campaign.rig, "It is not used in a comparison."),
    ]
    if all(record.kind == "step" for record in campaign.records):
        notes.append(
            "No record is a sweep or a multisine, so no frequency responses are compared, only steps and free runs."
        )
    if all(record.kind != "step" for record in campaign.records):
        notes.append("No record is a step, so no step is compared.")
    for competitor in competitors:
        other = [
            f"{name} = {competitor.model.values[name]:g} (campaign: {value:g})"
            for name, value in campaign.constants.items()
            if not math.isclose(competitor.model.values[name], value, rel_tol=1e-6)
        ]
        if other:
            notes.append(
                f"Model '{competitor.name}' has other constants than the campaign: {', '.join(other)}. It is compared with "
                "its own constants."
            )
        held = {record.hold for record in campaign.records} - {competitor.model.hold}
        if held:
            notes.append(
                f"Model '{competitor.name}' has hold {competitor.model.hold}, records have {', '.join(sorted(held))}: each "
                "record is simulated with its own hold."
            )
    return notes

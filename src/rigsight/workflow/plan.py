"""The work of `rigsight plan`: a campaign or a rig, and rivals -> the experiment that separates them, as a CSV to play."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from pydantic import BaseModel, ValidationError
from threadpoolctl import threadpool_limits

from rigsight.campaign import Campaign
from rigsight.check import holes_of
from rigsight.check.campaign_check import PARTS, check_campaign
from rigsight.diagnose.policy import FAMILIES
from rigsight.effects import AT, CATALOGUE, Effect
from rigsight.errors import InputError
from rigsight.plan import Named, Sizes, use_of
from rigsight.plan.experiments import read_limits, read_payloads
from rigsight.plan.planning import Plan, plan_experiment
from rigsight.plot import png_bytes, svg_text
from rigsight.plot.signals import planned_experiment
from rigsight.report.plan import render_plan
from rigsight.rigs import Rig
from rigsight.workflow.campaign.in_memory import campaign_of_rig, is_rig_file
from rigsight.workflow.campaign.model_file import json_object
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.own.own_effects import candidates_of, effect_on
from rigsight.workflow.run.progress import Listener, Stage, report_notes, silent
from rigsight.workflow.run.results import (
    DIAGNOSIS_FILE,
    check_writable,
    csv_text,
    json_text,
    versions,
    write_together,
)

PLAN_FILE, PLAN_PAGE, PLAN_RECORD = "plan.json", "plan.html", "plan.csv"
PLAN_PICTURES = ("plan.svg", "plan.png")
_MOST_RIVALS = 4
_STEPS = 40
"""Announced to the listener; more raise the total."""


class _Value(BaseModel):
    value: float


class _Candidate(BaseModel):
    effects: list[str]
    where: list[str]
    probability: float
    parameters: dict[str, _Value]


class _Diagnosis(BaseModel):
    """What a plan reads of a diagnosis.json."""

    rig: str
    candidates: list[_Candidate]


def run_plan(
    campaign: str | Path,
    out: str | Path | None = None,
    *,
    limits: Sequence[str] = (),
    seconds: float = 20.0,
    diagnosis: str | Path | None = None,
    rivals: str | None = None,
    own_effects: Sequence[Effect] = (),
    own_rigs: Iterable[Rig] = (),
    seed: int = 0,
    listener: Listener = silent,
    command: str = "",
) -> Plan:
    """Return the experiment that separates rivals best, and write it into a folder: plan.csv, plan.json and pictures.

    The rivals are those of a diagnosis, or those named; without either, effects that the check of the campaign or of a rig file
    leaves open.

    Raises
    ------
    InputError
        If the campaign, the diagnosis, a limit or a rival cannot be used, nothing is open, or no experiment keeps the limits.
    SimulationError
        If a rival cannot be simulated near the records.
    """
    if out is not None:
        check_writable(Path(out), PLAN_FILE, PLAN_PAGE, PLAN_RECORD, *PLAN_PICTURES)
    if diagnosis is not None and rivals is not None:
        raise InputError("Give the rivals once: with --diagnosis DIR, or with --rivals NAME,NAME.")
    before = is_rig_file(Path(campaign))
    if before and diagnosis is not None:
        raise InputError(
            f"{campaign} is the file of a rig: a diagnosis has rivals in the records of its campaign; name that one."
        )
    read = (
        _before_records(Path(campaign), limits) if before else read_campaign(campaign, own_effects, own_rigs)
    )
    known = {effect.name: effect for effect in (*CATALOGUE, *own_effects)}
    asked, payloads = read_limits(read.rig, limits), read_payloads(read.rig, limits)
    sizes: Sizes = "usual, no records" if before else "fitted"
    with threadpool_limits(limits=1, user_api="blas"):
        if diagnosis is not None:
            named = _of_diagnosis(read, Path(diagnosis), known)
        elif rivals is not None:
            named = _listed(read, rivals, known)
        else:
            named = _of_holes(read, list(known.values()), listener)
            sizes = sizes if before else "usual"
        stage = Stage("Planning", _STEPS, listener)
        plan = plan_experiment(
            read, named, asked, seconds, seed, stage.finished, sizes=sizes, payloads=payloads
        )
    if out is not None:
        figure = planned_experiment(plan)
        svg, png = PLAN_PICTURES
        write_together(
            Path(out),
            {
                PLAN_RECORD: csv_text(plan.record, [signal.name for signal in read.rig.inputs]),
                PLAN_FILE: json_text(plan.to_json()),
                PLAN_PAGE: render_plan(plan, figure, command, versions(), seed),
                svg: svg_text(figure, "plan"),
                png: png_bytes(figure, dpi=150),
            },
        )
    return plan


def _before_records(path: Path, limits: Sequence[str]) -> Campaign:
    """Return a campaign of a rig file whose simulated sweep is about as large as the limits allow."""
    plain = campaign_of_rig(path)
    asked = read_limits(plain.rig, limits)
    room = {limit.signal: limit.value for limit in asked if not limit.is_rate}
    missing = [signal.name for signal in plain.rig.inputs if signal.name not in room]
    if missing:
        raise InputError(
            f"{path}: without records no input has a size yet. Give the largest value of each: "
            f"{' '.join(f'--limit {name}=VALUE' for name in missing)}."
        )
    largest = {signal.name: room[signal.name] for signal in plain.rig.inputs}
    use = use_of(asked, campaign_of_rig(path, largest).estimation[0])
    return campaign_of_rig(path, {name: value / use for name, value in largest.items()})


def _of_holes(campaign: Campaign, effects: Sequence[Effect], listener: Listener) -> list[Named]:
    """Return effects that the check of a campaign leaves open, and no effect where one of them does not show."""
    candidates = candidates_of(campaign, effects)
    found = check_campaign(campaign, candidates, Stage("Checking", len(PARTS), listener).finished)
    if found.matrix.reason:
        raise InputError(f"{found.matrix.reason} Name the rivals with --rivals NAME,NAME.")
    holes = holes_of(found.matrix, _MOST_RIVALS)
    if not holes.effects:
        raise InputError(
            "These records tell all effects of different families apart already. Name rivals with --rivals NAME,NAME."
        )
    others = f" Open too, to be named with --rivals: {', '.join(holes.others)}." if holes.others else ""
    hidden = ", of which one may not show" if holes.hidden else ""
    listed = ", ".join(holes.effects)
    report_notes([f"Planned for effects that the check leaves open: {listed}{hidden}.{others}"], listener)
    by_name = {effect.name: effect for effect in candidates}
    named = [Named((by_name[name],)) for name in holes.effects]
    return [*named, Named(())] if holes.hidden else named


def _listed(campaign: Campaign, text: str, known: Mapping[str, Effect]) -> list[Named]:
    """Return the rivals that a list names: one effect each, or several joined by a plus sign."""
    sets = [[name.strip() for name in part.split("+")] for part in text.split(",") if part.strip()]
    named = [
        Named(tuple(effect_on(campaign.rig, name, known, "--rivals") for name in names)) for names in sets
    ]
    return _checked(campaign, named, "--rivals")


def _of_diagnosis(campaign: Campaign, folder: Path, known: Mapping[str, Effect]) -> list[Named]:
    """Return the most probable candidate of a diagnosis, and the most probable ones of other families."""
    path = folder / DIAGNOSIS_FILE if folder.is_dir() else folder
    if not path.is_file():
        raise InputError(
            f"--diagnosis {folder}: there is no {DIAGNOSIS_FILE}; name the --out folder of 'rigsight diagnose'."
        )
    try:
        found = _Diagnosis.model_validate(json_object(path, "diagnosis", "'rigsight diagnose' writes one."))
    except ValidationError as error:
        key = ".".join(map(str, error.errors()[0]["loc"]))
        raise InputError(
            f"{path}: {key}: {error.errors()[0]['msg']}. 'rigsight diagnose' writes this file."
        ) from None
    if found.rig != campaign.rig.name:
        raise InputError(
            f"{path}: is of the rig '{found.rig}', the campaign of '{campaign.rig.name}'. Name its own diagnosis."
        )
    named: dict[frozenset[tuple[object, str]], Named] = {}
    for candidate in sorted(found.candidates, key=lambda one: -one.probability):
        places = zip(candidate.effects, candidate.where, strict=False)
        effects = tuple(_placed(campaign.rig, kind, place, known, path) for kind, place in places)
        family = frozenset((effect.family, campaign.rig.where(effect)) for effect in effects)
        if candidate.probability >= FAMILIES.listed or len(named) < 2:
            values = {name: number.value for name, number in candidate.parameters.items()}
            named.setdefault(family, Named(effects, candidate.probability, values))
    return _checked(campaign, list(named.values())[:_MOST_RIVALS], str(path))


def _placed(rig: Rig, kind: str, place: str, known: Mapping[str, Effect], path: Path) -> Effect:
    at = f"{AT}{place}" if kind in known and place in rig.places(known[kind].place) else ""
    return effect_on(rig, f"{kind}{at}", known, str(path))


def _checked(campaign: Campaign, named: Sequence[Named], where: str) -> list[Named]:
    labels = [one.label for one in named]
    if len(set(labels)) != len(labels) or not 2 <= len(labels) <= _MOST_RIVALS:
        raise InputError(
            f"{where}: a plan separates 2 to {_MOST_RIVALS} different rivals, got {', '.join(labels) or 'none'}. "
            "Name them with --rivals NAME,NAME."
        )
    modelled = {effect.name for effect in campaign.modelled}
    there = [effect.name for one in named for effect in one.effects if effect.name in modelled]
    if there:
        raise InputError(
            f"{where}: the given simulation has {there[0]} already; name effects that it may lack."
        )
    return list(named)

"""The work of `rigsight identify`: a campaign -> `identification.json`, `model.json` and Bode plots."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import cast

from rigsight.campaign import Campaign
from rigsight.effects import Effect
from rigsight.errors import InputError, check_option
from rigsight.identify.identification import Identification
from rigsight.identify.record_identification import EstimationOptions
from rigsight.identify.transfer.record_response import METHODS, Method
from rigsight.report.identification_page import render_identification
from rigsight.rigs import Rig
from rigsight.workflow.campaign.model_file import MODEL_FILE
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.identification.figures import amplitudes_figure, identification_figures, view_figure
from rigsight.workflow.identification.hysteresis import structure_with_memory, with_hysteresis
from rigsight.workflow.identification.json import identification_json
from rigsight.workflow.identification.rig import identify_rig
from rigsight.workflow.own.effect_names import effects_on
from rigsight.workflow.run.kernels import checked_jobs
from rigsight.workflow.run.progress import Listener, report_notes, silent
from rigsight.workflow.run.results import check_writable, json_text, versions, write_together

IDENTIFICATION_FILE = "identification.json"
PAGE_FILE = "identification.html"


def run_identify(
    campaign: str | Path,
    out: str | Path | None = None,
    *,
    method: str = "local_rational",
    resolution: float | None = None,
    effects: Sequence[Effect] = (),
    own_effects: Sequence[Effect] = (),
    own_rigs: Iterable[Rig] = (),
    seed: int = 0,
    n_jobs: int | None = None,
    listener: Listener = silent,
    command: str | None = None,
) -> Identification:
    """Identify the rig behind the estimation records of a campaign, with the effects that its simulation has.

    The rig with effects of memory is calibrated as well if some are named.
    """
    options = checked_options(method, resolution)
    jobs = checked_jobs(n_jobs)
    if out is not None:
        check_writable(Path(out), IDENTIFICATION_FILE, MODEL_FILE, PAGE_FILE)
    identification = identify_campaign(
        read_campaign(campaign, own_effects, own_rigs), options, jobs, listener, effects=effects, seed=seed
    )
    if out is not None:
        asked = [word for effect in effects for word in ("--effect", effect.name)]
        estimated = [] if method == "local_rational" else ["--method", method]
        resolved = [] if resolution is None else ["--resolution", f"{resolution!r}"]
        seeded = ["--seed", str(seed)] if seed else []
        quoted = [
            "rigsight",
            "identify",
            str(campaign),
            *estimated,
            *resolved,
            *asked,
            *seeded,
            "--out",
            str(out),
        ]
        write_identification(identification, Path(out), command or shlex.join(quoted), seed)
    return identification


def checked_options(method: str, resolution: float | None) -> EstimationOptions:
    """Return how records are to be read."""
    check_option("The method", method, METHODS)
    if resolution is not None and not (math.isfinite(resolution) and resolution > 0.0):
        raise InputError(f"The resolution must be a positive number of rad/s, got {resolution!r}.")
    if method == "thesis" and resolution is not None:
        raise InputError(
            "The method 'thesis' takes every line of a record, so --resolution would change nothing. Leave it out, or choose "
            "another --method."
        )
    return EstimationOptions(cast("Method", method), resolution)


def identify_campaign(
    campaign: Campaign,
    options: EstimationOptions,
    n_jobs: int = 1,
    listener: Listener = silent,
    *,
    effects: Sequence[Effect] = (),
    seed: int = 0,
) -> Identification:
    """Identify each estimation record, then all of them together, and score the validation records."""
    if seed and not effects:
        raise InputError(
            f"Only the calibration of effects draws random numbers, so the seed {seed} would change nothing. Leave it out, or "
            "name an effect (--effect)."
        )
    if options.method == "thesis" and not campaign.rig.is_driven:
        raise InputError(
            f"The method 'thesis' fits rigs whose input moves a mass, and that of {campaign.rig.name} prescribes the motion. Use "
            "--method local_rational."
        )
    report_notes(campaign.notes, listener)
    structure = structure_with_memory(campaign, effects) if effects else None
    # The rig is identified without the effects that are calibrated, also where its simulation has one of them already.
    asked = {effect.name for effect in effects_on(campaign.rig, effects, "--effect")}
    campaign = replace(
        campaign, modelled=tuple(effect for effect in campaign.modelled if effect.name not in asked)
    )
    identification = identify_rig(campaign, options, n_jobs, listener)
    identification = replace(identification, given=campaign.given)
    if structure is None:
        return identification
    return with_hysteresis(identification, campaign, structure, seed, n_jobs, listener)


def write_identification(
    identification: Identification, out: Path, command: str = "", seed: int | None = None
) -> tuple[Path, ...]:
    """Write all results of an identification into a folder, all or none."""
    figures = identification_figures(identification)
    captions = {file: what for file, (what, _) in figures.items()}
    page = {}
    if identification.identifiability is not None:
        drawings = [
            view_figure(v, identification.units) for v in identification.views if v.measured is not None
        ]
        amplitudes = amplitudes_figure(identification)
        page[PAGE_FILE] = render_identification(
            identification, drawings, amplitudes, command, versions(), seed
        )
    return write_together(
        out,
        {
            IDENTIFICATION_FILE: json_text(identification_json(identification, captions)),
            MODEL_FILE: json_text(identification.model),
            **page,
            **{file: svg for file, (_, svg) in figures.items()},
        },
    )

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
from rigsight.report.identification import render_identification
from rigsight.rigs import Rig
from rigsight.workflow.campaign.model_file import MODEL_FILE
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.identification.figures import amplitudes_figure, identification_figures, view_figure
from rigsight.workflow.identification.hysteresis import has_hysteresis, structure_with_memory, with_hysteresis
from rigsight.workflow.identification.json import identification_json
from rigsight.workflow.identification.rig import identify_rig
from rigsight.workflow.own.own_effects import effects_on
from rigsight.workflow.run.kernels import checked_jobs
from rigsight.workflow.run.progress import Listener, report_notes, silent
from rigsight.workflow.run.results import check_writable, json_text, versions, write_together

OBJECTIVES = ("windows", "free-run")
"""How fits over time compare a model with a record."""
_STARTING_SAMPLES = 20
IDENTIFICATION_FILE = "identification.json"
PAGE_FILE = "identification.html"


def run_identify(
    campaign: str | Path,
    out: str | Path | None = None,
    *,
    method: str = "local_rational",
    resolution: float | None = None,
    objective: str = "windows",
    initial_samples: int | None = None,
    effects: Sequence[Effect] = (),
    own_effects: Sequence[Effect] = (),
    own_rigs: Iterable[Rig] = (),
    seed: int = 0,
    n_jobs: int | None = None,
    listener: Listener = silent,
    command: str | None = None,
) -> Identification:
    """Identify the rig behind the estimation records of a campaign, with the effects that its simulation has and `effects`.

    Of one motion on a spring, effects with a memory are calibrated after the rig alone was identified.
    """
    options = checked_options(method, resolution, objective, initial_samples)
    jobs = checked_jobs(n_jobs)
    if out is not None:
        check_writable(Path(out), IDENTIFICATION_FILE, MODEL_FILE, PAGE_FILE)
    identification = identify_campaign(
        read_campaign(campaign, own_effects, own_rigs), options, jobs, listener, effects=effects, seed=seed
    )
    if out is not None:
        given = {
            "--method": None if method == "local_rational" else method,
            "--resolution": resolution,
            "--objective": None if objective == "windows" else objective,
            "--initial-samples": initial_samples,
        }
        chosen = [(option, value) for option, value in given.items() if value is not None]
        chosen += [("--effect", effect.name) for effect in effects]
        chosen += [("--seed", seed)] if seed else []
        words = [str(word) for pair in (*chosen, ("--out", out)) for word in pair]
        quoted = shlex.join(["rigsight", "identify", str(campaign), *words])
        write_identification(identification, Path(out), command or quoted, seed)
    return identification


def checked_options(
    method: str, resolution: float | None, objective: str = "windows", initial_samples: int | None = None
) -> EstimationOptions:
    """Return how records are to be read and fitted."""
    check_option("The method", method, METHODS)
    if resolution is not None and not (math.isfinite(resolution) and resolution > 0.0):
        raise InputError(f"The resolution must be a positive number of rad/s, got {resolution!r}.")
    if method == "thesis" and resolution is not None:
        raise InputError(
            "The method 'thesis' takes every line of a record, so --resolution would change nothing. Leave it out, or choose "
            "another --method."
        )
    check_option("The objective", objective, OBJECTIVES)
    if initial_samples is not None and objective != "free-run":
        raise InputError(
            "Only a free run takes its initial state from the first samples, so --initial-samples would change nothing. Leave it "
            "out, or choose --objective free-run."
        )
    if initial_samples is not None and initial_samples < 2:
        raise InputError(
            f"A position and a speed need at least 2 initial samples, got --initial-samples {initial_samples}."
        )
    starting = (initial_samples or _STARTING_SAMPLES) if objective == "free-run" else 0
    return EstimationOptions(cast("Method", method), resolution, starting)


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
    if options.method == "thesis" and not campaign.rig.is_driven:
        raise InputError(
            f"The method 'thesis' fits rigs whose input moves a mass, and that of {campaign.rig.name} prescribes the motion. Use "
            "--method local_rational."
        )
    asked = effects_on(campaign.rig, effects, "--effect")
    # The numbers of an effect that is asked for are fitted anew, also where the given simulation has it.
    names = {effect.name for effect in asked}
    known = tuple(effect for effect in campaign.modelled if effect.name not in names)
    is_hysteresis = has_hysteresis(campaign, asked)
    if seed and not is_hysteresis:
        raise InputError(
            f"Only the calibration of a hysteresis draws random numbers, so the seed {seed} would change nothing. Leave it out, "
            "or name an effect with memory (--effect)."
        )
    if options.starting_samples and is_hysteresis:
        raise InputError(
            "The calibration of an effect with memory fits the initial states, so --effect has no --objective free-run. Name the "
            "effect in the campaign instead: effects = [...] under [rig]."
        )
    report_notes(campaign.notes, listener)
    campaign = replace(_free_run(campaign, options.starting_samples), modelled=known)
    if not is_hysteresis:
        campaign = replace(campaign, modelled=(*known, *asked))
        return replace(identify_rig(campaign, options, n_jobs, listener, asked), given=campaign.given)
    structure = structure_with_memory(campaign, asked)
    identification = replace(identify_rig(campaign, options, n_jobs, listener), given=campaign.given)
    return with_hysteresis(identification, campaign, structure, seed, n_jobs, listener)


def _free_run(campaign: Campaign, starting_samples: int) -> Campaign:
    """Return a campaign whose records are run free from the state that their first samples give; the same for none."""
    for record in campaign.records if starting_samples else ():
        if record.n_samples <= starting_samples:
            raise InputError(
                f"Record '{record.name}' has {record.n_samples} samples, so that nothing is left to run free after the first "
                f"{starting_samples}. Choose fewer with --initial-samples, or leave the record out."
            )
    return replace(
        campaign,
        records=tuple(replace(record, starting_samples=starting_samples) for record in campaign.records),
    )


def write_identification(
    identification: Identification, out: Path, command: str = "", seed: int | None = None
) -> tuple[Path, ...]:
    """Write all results of an identification into a folder, all or none."""
    figures = identification_figures(identification)
    captions = {file: what for file, (what, _) in figures.items()}
    page = {}
    if identification.identifiability is not None:
        drawings = [
            view_figure(view, identification.units) for view in identification.views if view.has_responses
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

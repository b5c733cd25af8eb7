"""The work of `rigsight identify`: a campaign -> `identification.json`, `model.json` and Bode plots."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import cast

from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

from rigsight.campaign import Campaign
from rigsight.effects import Effect
from rigsight.errors import InputError, RigsightError, check_option
from rigsight.identify.amplitude_dependence import amplitude_dependence
from rigsight.identify.identification import Identification, JointIdentification, RecordIdentification
from rigsight.identify.record_identification import EstimationOptions, identify_record
from rigsight.identify.transfer.record_response import METHODS, Method
from rigsight.identify.transfer.running_gear_parameters import PhysicalEstimates
from rigsight.report.identification_page import render_identification
from rigsight.rigs import Rig
from rigsight.simulate import compose
from rigsight.simulate.model import Model
from rigsight.workflow.campaign.model_file import MODEL_FILE
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.identification.any_rig import (
    IDENTIFYING,
    METHODS_OF_ANY_RIG,
    has_transfer_forms,
    identify_any_rig,
)
from rigsight.workflow.identification.figures import amplitudes_figure, identification_figures, view_figure
from rigsight.workflow.identification.hysteresis import structure_with_memory, with_hysteresis
from rigsight.workflow.identification.joint import UNSERVED, bounds_of, identify_jointly
from rigsight.workflow.identification.json import identification_json
from rigsight.workflow.identification.warnings import (
    beyond_identified_amplitudes,
    campaign_warnings,
    offsets_of_records,
    out_of_band,
)
from rigsight.workflow.own.effect_names import effects_on
from rigsight.workflow.run.kernels import checked_jobs, prepare_kernels
from rigsight.workflow.run.progress import Listener, Stage, report_notes, silent
from rigsight.workflow.run.results import check_writable, json_text, versions, write_together

IDENTIFICATION_FILE = "identification.json"
PAGE_FILE = "identification.html"
_STEPS_AFTER_RECORDS = 2


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
    if has_transfer_forms(campaign):
        identification = _by_transfer_functions(campaign, options, n_jobs, listener)
    else:
        identification = identify_any_rig(campaign, options, n_jobs, listener)
    identification = replace(identification, given=campaign.given)
    if structure is None:
        return identification
    return with_hysteresis(identification, campaign, structure, seed, n_jobs, listener)


def _by_transfer_functions(
    campaign: Campaign, options: EstimationOptions, n_jobs: int, listener: Listener
) -> Identification:
    """Identify a rig with transfer functions of its own."""
    prepare_kernels([compose(campaign.rig)], n_jobs, listener)
    stage = Stage(IDENTIFYING, len(campaign.estimation) + _STEPS_AFTER_RECORDS, listener)
    found = []
    # Threads suffice: linear algebra releases the GIL. Multithreaded linear algebra would only compete for the same processors.
    with threadpool_limits(limits=1, user_api="blas"):
        parallel = Parallel(n_jobs=n_jobs, prefer="threads", return_as="generator")
        for record in parallel(
            delayed(identify_record)(record, campaign.rig, campaign.constants, options)
            for record in campaign.estimation
        ):
            found.append(record)
            stage.finished(record.record.name)
        if all(record.motion.problem for record in found):
            followed = _over_time_alone(campaign, options, n_jobs)
            if followed is not None:
                return followed
        joint = identify_jointly(campaign, found)
    stage.finished("one set for all records")
    if not campaign.rig.is_driven:
        found = [_over_time(record, joint) for record in found]
    found = [out_of_band(record, campaign, joint) for record in found]
    units = _units(campaign)
    statement, changing = amplitude_dependence(found, units)
    reached = bounds_of(joint.fit, [r.record for r in found if r.record.name not in joint.left_out])
    model = Model.of(joint.fit.fit.structure, joint.fit.fit.values, campaign.estimation[0].hold).to_json()
    identification = Identification(
        title=campaign.title,
        rig=campaign.rig.name,
        method=options.method,
        units=units,
        records=tuple(found),
        amplitude_statement=statement,
        changing=changing,
        joint=joint,
        model=model,
        reached=reached,
        warnings=(
            *(bound.sentence for bound in reached),
            *campaign_warnings(campaign, found, joint),
            *beyond_identified_amplitudes(campaign, joint),
            *offsets_of_records(campaign, joint, {}),
        ),
    )
    stage.finished("amplitudes")
    return identification


def _over_time_alone(campaign: Campaign, options: EstimationOptions, n_jobs: int) -> Identification | None:
    """Return the identification in the time domain of a rig that may have no spring; None if it does not follow the records.

    Such a rig has no break frequency in a record, but moves as its equations say. Its stiffness is estimated only if it shows, as
    one that is given as zero.
    """
    rig = campaign.rig
    loose = {p.name: 0.0 for p in rig.parameters if p.name == str(rig.motion.stiffness) and p.lower <= 0.0}
    if not (loose and rig.is_driven) or options.method not in METHODS_OF_ANY_RIG:
        return None
    without = replace(campaign, parameters={**campaign.parameters, **loose})
    try:
        result = identify_any_rig(without, options, n_jobs, silent)
    except RigsightError:
        return None
    scores = [score for score in result.joint.scores if score.role == "estimation"]
    if any(not value < UNSERVED for score in scores for value in score.nrmse.values()):
        return None
    note = "No record shows a transfer function of these equations: all were fitted in the time domain."
    return replace(result, warnings=(note, *result.warnings))


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


def _units(campaign: Campaign) -> dict[str, str]:
    rig = campaign.rig
    units = {p.name: p.unit for p in compose(rig).parameters}
    return units | {signal.name: signal.unit for signal in (*rig.inputs, *rig.outputs)}


def _over_time(found: RecordIdentification, joint: JointIdentification) -> RecordIdentification:
    """Give a record of an element the parameters of the time-domain fit of this record alone."""
    own: Sequence[PhysicalEstimates] = [
        PhysicalEstimates(
            kind.fit.free,
            {name: kind.fit.values[name] for name in kind.fit.free},
            kind.fit.covariance,
            "force = k x + d x' + force_off, fitted over time",
        )
        for kind in joint.fit.kinds
        if kind.kind == found.record.name and math.isfinite(kind.fit.cost)
    ]
    if not own:
        return found
    return replace(found, paths=(replace(found.motion, physical=own[0]), *found.paths[1:]))

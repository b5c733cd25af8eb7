"""How is a rig with effects of memory calibrated to the records of an identification, and for which rigs?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from rigsight.campaign import Campaign
from rigsight.effects import Effect, Place
from rigsight.errors import InputError
from rigsight.identify import FitResult, GreyBoxFit, calibrate_to_records, characteristic_scales
from rigsight.identify.hysteresis.calibration import free_parameters, special_structure
from rigsight.identify.identification import EffectScore, HysteresisIdentification, Identification
from rigsight.metrics import rms
from rigsight.records import Record
from rigsight.report.labels import gap_percent
from rigsight.rigs import Rig
from rigsight.simulate import Model, Structure, compose
from rigsight.workflow.identification.joint import errors_by_output
from rigsight.workflow.run.kernels import prepare_kernels
from rigsight.workflow.run.progress import Listener, Stage, Step

CALIBRATING = "Calibrating hysteresis"
_GENERATIONS, _ENDS = 100, 8
_STEPS = _GENERATIONS + _ENDS + 3
_HARDLY = 0.9
"""Share of the error from which effects are said to explain hardly anything."""


def has_hysteresis(campaign: Campaign, effects: Sequence[Effect]) -> bool:
    """Return True if effects give the spring of one mass or element a memory."""
    rig = campaign.rig
    if not rig.has_one_motion or campaign.drifts or rig.motion.stiffness == 0:
        return False
    return any(_has_memory(effect) for effect in effects)


def structure_with_memory(campaign: Campaign, effects: Sequence[Effect]) -> Structure:
    """Return the rig with these effects and those that the campaign's simulation has already."""
    of_spring = [e.name for e in (*campaign.modelled, *effects) if e.spring is not None and e.states]
    if len(of_spring) > 1:
        raise InputError(
            f"The records do not tell {' and '.join(of_spring)} of the same spring apart; name one of them, then compare the "
            "models."
        )
    return compose(campaign.rig, (*campaign.modelled, *effects))


def with_hysteresis(
    identification: Identification,
    campaign: Campaign,
    structure: Structure,
    seed: int,
    n_jobs: int,
    listener: Listener,
) -> Identification:
    """Calibrate a structure to the records of an identification, beginning at its joint fit."""
    joint = identification.joint
    fitted = campaign.estimation
    outputs = [s.name for s in structure.rig.outputs if all(s.name in record for record in fitted)]
    free = _free(structure, identification, campaign, outputs)
    prepare_kernels([structure, special_structure(structure, free)[0]], n_jobs, listener)
    stage = Stage(CALIBRATING, _STEPS, listener)
    start = {name: value for name, value in campaign.given.items() if name in structure.names}
    with threadpool_limits(limits=1, user_api="blas"):
        calibration = calibrate_to_records(
            structure,
            [_reduced(record, structure.rig, outputs) for record in fitted],
            campaign.constants,
            np.random.default_rng(seed),
            start={**start, **joint.fit.fit.values},
            free=free,
            n_generations=_GENERATIONS,
            n_ends=_ENDS,
            n_jobs=n_jobs,
            progress=stage.finished,
        )
        names, of_fit = [record.name for record in fitted], calibration.fit.residuals
        residuals = dict(zip(names, of_fit, strict=bool(of_fit)))
        diverging = []
        for record in campaign.validation:
            residual = _validation_residual(
                calibration.fit.structure, calibration.fit.values, record, outputs
            )
            if residual is None:
                diverging.append(record.name)
            else:
                residuals[record.name] = residual
    # A search that settles early takes fewer generations than were announced.
    listener(Step(CALIBRATING, "", _STEPS, _STEPS))
    without = {score.record: score.nrmse for score in joint.scores}
    scores = tuple(
        _score(record, structure.rig, outputs, residuals[record.name], without.get(record.name, {}))
        for record in (*fitted, *campaign.validation)
        if record.name in residuals
    )
    values = {**calibration.fit.values, **dict(calibration.fit.structure.fixed)}
    of_effects = [p for p in structure.parameters if p.name not in _of_rig(structure.rig)]
    statement = _statement(structure.effect_names, calibration.fit, scores)
    if diverging:
        listed = " and ".join(f"'{name}'" for name in diverging)
        statement += (
            f" The calibrated model diverges on {listed} of the held-out records: no error is given there."
        )
    found = HysteresisIdentification(
        effects=structure.effect_names,
        calibration=calibration,
        held={p.name: values[p.name] for p in of_effects if p.name not in calibration.fit.free},
        units={p.name: p.unit for p in structure.parameters},
        meanings={p.name: p.description for p in structure.parameters},
        statement=statement,
        scores=scores,
    )
    model = Model.of(calibration.fit.structure, calibration.fit.values, campaign.estimation[0].hold)
    return replace(identification, model=model.to_json(), hysteresis=found)


def _has_memory(effect: Effect) -> bool:
    # A force of several states is a motion of its own, as that of a flexible mode.
    has_state = len(effect.states) == 1 or (effect.spring is not None and bool(effect.states))
    return effect.place is Place.DYNAMICS and has_state


def _of_rig(rig: Rig) -> set[str]:
    return {p.name for p in (*rig.constants, *rig.parameters)}


def _free(
    structure: Structure, identification: Identification, campaign: Campaign, outputs: Sequence[str]
) -> tuple[str, ...]:
    """Return what is fitted: the parameters of the effects, and of the rig's those that the joint fit moved."""
    joint = identification.joint
    moved = {*joint.names, *(() if joint.pooled is None else joint.pooled.names)}
    if campaign.open_factor is not None:
        moved.discard(campaign.open_factor.held)
    kept = _of_rig(structure.rig) - moved
    return tuple(name for name in free_parameters(structure, outputs) if name not in kept)


def _reduced(record: Record, rig: Rig, outputs: Sequence[str]) -> Record:
    """Return a record without the outputs that others lack."""
    left_out = {signal.name for signal in rig.outputs} - set(outputs)
    return replace(
        record, signals={name: samples for name, samples in record.signals.items() if name not in left_out}
    )


def _validation_residual(
    structure: Structure, values: Mapping[str, float], record: Record, outputs: Sequence[str]
) -> np.ndarray | None:
    """Return measured minus simulated of a record; None if the simulation diverges."""
    own = _reduced(record, structure.rig, outputs)
    scales = characteristic_scales(structure.rig, [own], values)
    noise = {name: float(np.std(own[name])) or 1.0 for name in outputs if name in own}
    # Only initial states are estimated: a record may start away from rest.
    residuals = GreyBoxFit(structure, [own], scales, noise).fit(values, ()).residuals
    return residuals[0] if residuals else None


def _score(
    record: Record, rig: Rig, outputs: Sequence[str], residual: np.ndarray, without: Mapping[str, float]
) -> EffectScore:
    own = _reduced(record, rig, outputs)
    found = errors_by_output([residual], [own], [signal.name for signal in rig.outputs])
    before = {name: without[name] for name in found if name in without}
    return EffectScore(record.name, record.role, before, found)


def _statement(effects: Sequence[str], fit: FitResult, scores: Sequence[EffectScore]) -> str:
    """Say how much closer the records are followed, on the motion of the rig."""
    label = " and ".join(effects)
    doubt = f"The calibration with {label} did not converge ({fit.message.rstrip('.')}): its numbers are to be doubted."
    if not scores:
        return doubt
    motion = next(iter(scores[0].nrmse))
    parts, worst = [], 0.0
    for role, called in (("estimation", "the fitted records"), ("validation", "the held-out records")):
        seen = [s for s in scores if s.role == role and motion in s.without and motion in s.nrmse]
        if seen:
            before, after = (
                rms(np.array([errors[motion] for errors in of]))
                for of in zip(*((s.without, s.nrmse) for s in seen), strict=True)
            )
            parts.append(f"from {gap_percent(before)} to {gap_percent(after)} on {called}")
            worst = max(worst, after / before if before > 0.0 else 1.0)
    text = f"With {label} the error of {motion} (NRMSE) goes {', '.join(parts)}."
    if worst > 1.0:
        return f"{text} It did not fall: the calibration failed, or the records do not follow this rig. Check units and columns."
    if worst > _HARDLY:
        return f"{text} The effects explain hardly any of the error; 'rigsight diagnose' says what the rig lacks."
    return text if fit.success else f"{text} {doubt}"

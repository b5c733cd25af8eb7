"""The whole diagnosis: records and a given simulation -> verdict, ranking, gap budget, completed model."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rigsight.diagnose.advise import advise
from rigsight.diagnose.characterize import fit_candidate, fit_candidates, fit_linear
from rigsight.diagnose.data_quality import data_quality, with_best_model
from rigsight.diagnose.detect import noise_floors
from rigsight.diagnose.grow import Prepare, grown
from rigsight.diagnose.localize import localize
from rigsight.diagnose.quantify import budget_intervals, effect_shares
from rigsight.diagnose.rank import Ranking, noise_vector, rank
from rigsight.diagnose.result import (
    Candidate,
    Diagnosis,
    Estimate,
    NoiseFloor,
    OutputGap,
    Trace,
)
from rigsight.diagnose.verdict import AT_FLOOR, AT_LOWER_BOUND, Judgement, judge
from rigsight.diagnose.windows import WINDOW, cut, window_length
from rigsight.diagnose.workbench import Scored, Workbench, liveliest
from rigsight.discover import MissingForce, missing_force
from rigsight.effects import CATALOGUE, Effect
from rigsight.errors import InputError, SimulationError
from rigsight.identify import FitMemory, characteristic_scales, linear_start
from rigsight.metrics import nrmse
from rigsight.records.record import Record
from rigsight.rigs import Rig
from rigsight.simulate.model import Model

_SIGNIFICANT = 3.0
"""Standard errors from zero at which a constant force counts as needed."""
_WITHOUT_EFFECT = 0.95
"""Probability given to the equations without an effect where they reach the noise floor."""


@dataclass(frozen=True)
class Task:
    """What is to be diagnosed.

    Attributes
    ----------
    title
        For people.
    rig
        The rig.
    constants
        Every constant of the rig.
    given
        Parameters of the simulation whose gap is in question; what is missing of the rig's is identified.
    records
        Estimation and validation records.
    modelled
        Effects that this simulation has already; `given` holds all their values.
    """

    title: str
    rig: Rig
    constants: Mapping[str, float]
    given: Mapping[str, float]
    records: tuple[Record, ...]
    modelled: tuple[Effect, ...] = ()


def diagnose(
    task: Task,
    effects: Sequence[Effect] = CATALOGUE,
    seed: int = 0,
    n_jobs: int = 1,
    progress: Callable[[str], None] | None = None,
    prepare: Prepare | None = None,
    memory: FitMemory | None = None,
) -> Diagnosis:
    """Diagnose the gap between a simulation and records of its rig.

    Parameters
    ----------
    task
        Records and the given simulation.
    effects
        Candidates.
    seed
        Seed of the resampling behind probabilities.
    n_jobs
        Candidates fitted at the same time.
    progress
        Called with a short text when a stage or candidate is done.
    prepare
        Called with structures that are about to be simulated, to compile them side by side.
    memory
        Where the outcomes of fits are kept; those that it has are not done again.

    Raises
    ------
    InputError
        If there is no estimation record or it does not move the rig.
    SimulationError
        If the rig's own equations cannot be simulated near the records.
    """
    say = progress or (lambda _: None)
    estimation = tuple(r for r in task.records if r.role == "estimation")
    validation = tuple(r for r in task.records if r.role == "validation")
    if not estimation:
        raise InputError('A diagnosis needs at least one record with role = "estimation".')
    notes = [note for record in task.records for note in record.notes]
    scored_on = "validation" if validation else "estimation"
    if not validation:
        notes.append(
            "There is no validation record: errors are those of the records that were fitted, and too good."
        )
    floors = noise_floors(task.rig, task.records)
    noise = {floor.output: floor.std for floor in floors}
    say("noise floor")

    no_spring = _no_spring(task)
    length = window_length(task.rig, estimation) if no_spring else None
    start = _start(task, estimation)
    fitted = cut(estimation, length)
    bench = Workbench(
        rig=task.rig,
        estimation=fitted,
        look=liveliest(fitted, task.rig.outputs[0].name),
        scoring=cut(validation or estimation, length),
        scales=characteristic_scales(task.rig, estimation, start),
        noise=noise,
        held=_held(task, estimation, no_spring),
        modelled=task.modelled,
        memory=memory,
    )
    linear = fit_linear(bench, start)
    if not linear.residuals:
        raise SimulationError(
            f"The equations of {task.rig.name} cannot be fitted to the records: {linear.fit.message}"
        )
    say("re-identified")
    before = _before(task, bench, estimation, linear)
    if task.given:
        say("given simulation")
    quality = data_quality(bench, task.records, linear)
    singles = fit_candidates(bench, linear, effects, n_jobs, progress)

    lower_bound = any(floor.lower_bound for floor in floors)
    at_floor = AT_LOWER_BOUND if lower_bound else AT_FLOOR
    pairs = grown(bench, singles, effects, at_floor, n_jobs, prepare)

    rng = np.random.default_rng(seed)
    vector = noise_vector([signal.name for signal in task.rig.outputs], noise)
    ranking = rank([*singles, *pairs], vector, rng, linear.excess)
    if ranking.order and ranking.order[0].residuals:
        ranking = _with_offset_rivals(bench, ranking, effects, vector, rng, linear.excess)
        judgement = judge(before.excess, linear, ranking.order[0], lower_bound)
    else:
        judgement = Judgement("unknown", linear, "No candidate could be fitted.")
    quality = with_best_model(quality, bench, judgement.model)
    notes += [*quality.notes, judgement.reason]
    diagnosis = _assembled(
        task, bench, floors, before, linear, ranking, judgement, notes, length, scored_on, rng
    )
    lacking = _missing_force(bench, linear, no_spring, rng) if judgement.verdict == "unknown" else None
    return replace(diagnosis, data_quality=quality, missing_force=lacking)


def _missing_force(
    bench: Workbench, linear: Scored, no_spring: bool, rng: np.random.Generator
) -> MissingForce | None:
    """Return the shape of what is lacking; beside effects that are modelled already the rig's own terms do not stand alone."""
    if bench.modelled:
        return None
    noise = bench.noise[bench.rig.outputs[0].name]
    return missing_force(bench.rig, bench.estimation, linear.fit.values, bench.scales, noise, rng, no_spring)


def _no_spring(task: Task) -> bool:
    return task.rig.name == "axis" and task.given.get("k") == 0.0


def _start(task: Task, estimation: Sequence[Record]) -> dict[str, float]:
    held = {"k": 0.0} if _no_spring(task) else {}
    start = {**task.constants, **linear_start(task.rig, estimation, task.constants, held)}
    # Numbers fitted without the effects that the simulation has are farther off than those it came with.
    return {**start, **task.given} if task.modelled else start


def _held(task: Task, estimation: Sequence[Record], no_spring: bool) -> frozenset[str]:
    """Return rig parameters that these records say nothing about, and the stiffness of a spring that is not there."""
    held = {"k"} if no_spring else set()
    unmeasured = [
        symbol for symbol in task.rig.downstream if not any(symbol.name in record for record in estimation)
    ]
    if unmeasured:
        held |= task.rig.downstream_parameters
    return frozenset(held)


def _before(task: Task, bench: Workbench, estimation: Sequence[Record], linear: Scored) -> Scored:
    """Score the given simulation; parameters that were not given are identified with the given ones held."""
    if not task.given:
        return linear
    structure = bench.composed()
    start = {**_start(task, estimation), **linear.fit.values, **task.given}
    missing = [name for name in bench.free_parameters(structure) if name not in task.given]
    fit = bench.problem(structure, bench.estimation).fit(start, missing)
    if not fit.residuals:
        raise InputError(f"The given simulation cannot be run: {fit.message}")
    return bench.score((), fit)


def _with_offset_rivals(
    bench: Workbench,
    ranking: Ranking,
    effects: Sequence[Effect],
    noise: NDArray[np.float64],
    rng: np.random.Generator,
    gap: float,
) -> Ranking:
    """Let an even effect without a constant force compete where the best model needs a constant force.

    A symmetric spring under a constant force and an asymmetric spring without one obey the same equation.
    """
    best = ranking.order[0]
    released = bench.releasable_parameters(best.fit.structure)
    needed = [
        name
        for name in best.fit.free
        if name in released and abs(best.fit.values[name]) > _SIGNIFICANT * best.fit.standard_errors[name]
    ]
    if not needed:
        return ranking
    rivals = []
    for effect in effects:
        if effect.signature.even_harmonics and bench.rig.offers(effect):
            base = replace(best.fit, values={**best.fit.values, **dict.fromkeys(needed, 0.0)})
            rivals.append(fit_candidate(bench, (*best.effects, effect), base, hold=frozenset(needed)))
    return rank([*ranking.order, *rivals], noise, rng, gap)


def _assembled(
    task: Task,
    bench: Workbench,
    floors: Sequence[NoiseFloor],
    before: Scored,
    linear: Scored,
    ranking: Ranking,
    judgement: Judgement,
    notes: Sequence[str],
    length: float | None,
    scored_on: str,
    rng: np.random.Generator,
) -> Diagnosis:
    rig = task.rig
    is_effect = judgement.verdict == "effect"
    after = judgement.model if is_effect else (before if judgement.verdict == "none" else linear)
    noise = {floor.output: floor for floor in floors}
    measured = _measured(rig, bench.scoring)
    traces = _traces(task, bench, before, linear, after)
    scored = [trace for trace in traces if trace.role == scored_on]
    at_floor = {name: noise[name].std / float(np.std(values)) for name, values in measured.items()}
    gap = {
        name: OutputGap(
            before=nrmse(_column(rig, before, name), measured[name]),
            reidentified=nrmse(_column(rig, linear, name), measured[name]),
            after=nrmse(_column(rig, after, name), measured[name]),
            noise_floor=at_floor[name],
            intervals=budget_intervals(scored, name, at_floor[name], rng),
        )
        for name in measured
    }
    share = _explained(judgement, ranking)
    explained = judgement.verdict in ("none", "parameters")
    without_effect = _candidate(bench, linear, _WITHOUT_EFFECT if explained else 0.0)
    with_effect = [
        _candidate(bench, model, probability * share)
        for model, probability in zip(ranking.order, ranking.probabilities, strict=True)
    ]
    candidates = tuple(sorted((*with_effect, without_effect), key=lambda c: (-c.probability, c.excess)))
    chosen = judgement.model.effects if is_effect else ()
    tied = tuple(model.names for model in ranking.tied) if is_effect else ()
    places = judgement.model.effects if judgement.verdict in ("effect", "unknown") else ()
    where = tuple(dict.fromkeys(rig.place_name(effect.place) for effect in places))
    return Diagnosis(
        title=task.title,
        rig=rig.name,
        verdict=judgement.verdict,
        effects=tuple(effect.name for effect in chosen),
        where=where,
        ambiguous_with=tied,
        candidates=candidates,
        gap=gap,
        noise_floors=tuple(floors),
        traces=traces,
        units={signal.name: signal.unit for signal in (*rig.inputs, *rig.outputs)},
        model=Model.of(after.fit.structure, after.fit.values, task.records[0].hold).to_json(),
        notes=tuple(notes),
        windows=length,
        scored_on=scored_on,
        advice=advise(bench, judgement.model, ranking.tied, {n: f.std for n, f in noise.items()})
        if is_effect
        else (),
        localization=localize(bench, traces, scored_on, before, linear, after, rng, floors),
        effect_shares=effect_shares(
            [effect.name for effect in chosen], {frozenset(c.effects): c.validation_nrmse for c in candidates}
        ),
    )


def _explained(judgement: Judgement, ranking: Ranking) -> float:
    """Return the probability that the cause is among the candidates at all, from what the best leaves above the floor.

    Near 1 at the floor and one half far above it: an assumed shape, not calibrated on known causes.
    """
    if judgement.verdict in ("none", "parameters"):
        return 0.0  # the equations without an effect explain the records
    if not ranking.order or not np.isfinite(ranking.order[0].excess):
        return 0.0
    left = max(ranking.order[0].excess - AT_FLOOR, 0.0)
    if judgement.verdict == "unknown":
        return 0.3 / (1.0 + left)
    return 0.5 + 0.49 / (1.0 + left)


def _column(rig: Rig, model: Scored, output: str) -> NDArray[np.float64]:
    index = [signal.name for signal in rig.outputs].index(output)
    column = np.concatenate([residual[:, index] for residual in model.residuals])
    return np.asarray(column[np.isfinite(column)])


def _measured(rig: Rig, records: Sequence[Record]) -> dict[str, NDArray[np.float64]]:
    measured = {}
    for signal in rig.outputs:
        parts = [record[signal.name] for record in records if signal.name in record]
        if parts:
            measured[signal.name] = np.concatenate(parts)
    return measured


def _candidate(bench: Workbench, model: Scored, probability: float) -> Candidate:
    units = {p.name: p.unit for p in model.fit.structure.parameters}
    measured = _measured(bench.rig, bench.scoring)
    fitted = _measured(bench.rig, bench.estimation)
    estimation = Scored(model.effects, model.fit, model.fit.residuals, (), 0.0)
    return Candidate(
        effects=model.names,
        probability=probability,
        validation_nrmse={
            name: nrmse(_column(bench.rig, model, name), values) if model.residuals else float("inf")
            for name, values in measured.items()
        },
        estimation_nrmse={
            name: nrmse(_column(bench.rig, estimation, name), values) if model.fit.residuals else float("inf")
            for name, values in fitted.items()
        },
        excess=model.excess,
        parameters={
            name: Estimate(model.fit.values[name], model.fit.standard_errors[name], units[name])
            for name in model.fit.free
        },
        success=model.fit.success,
        message=model.fit.message,
    )


def _traces(task: Task, bench: Workbench, before: Scored, linear: Scored, after: Scored) -> tuple[Trace, ...]:
    """Return measured and simulated outputs of all records, those that score first, windows joined again."""
    scored = _joined(task.rig, bench.scoring, before.residuals, linear.residuals, after.residuals)
    if bench.scoring == bench.estimation:
        return scored
    fitted = _joined(
        task.rig, bench.estimation, before.fit.residuals, linear.fit.residuals, after.fit.residuals
    )
    return (*scored, *fitted)


def _joined(
    rig: Rig,
    records: Sequence[Record],
    before: Sequence[NDArray[np.float64]],
    reidentified: Sequence[NDArray[np.float64]],
    after: Sequence[NDArray[np.float64]],
) -> tuple[Trace, ...]:
    names = [signal.name for signal in rig.outputs]
    groups: dict[str, list[int]] = {}
    for index, record in enumerate(records):
        groups.setdefault(record.name.split(WINDOW)[0], []).append(index)
    traces = []
    for name, indices in groups.items():
        parts = [records[i] for i in indices]
        first = parts[0]
        measured = {n: np.concatenate([p[n] for p in parts]) for n in names if n in first}

        def simulated(
            residuals: Sequence[NDArray[np.float64]],
            indices: Sequence[int] = indices,
            measured: Mapping[str, NDArray[np.float64]] = measured,
        ) -> dict[str, NDArray[np.float64]]:
            joined = np.concatenate([residuals[i] for i in indices])
            return {n: measured[n] - joined[:, names.index(n)] for n in measured}

        traces.append(
            Trace(
                record=name,
                role=first.role,
                kind=first.kind,
                amplitude=first.amplitude,
                t=np.concatenate([p.t for p in parts]),
                inputs={s.name: np.concatenate([p[s.name] for p in parts]) for s in rig.inputs},
                measured=measured,
                before=simulated(before),
                reidentified=simulated(reidentified),
                after=simulated(after),
            )
        )
    return tuple(traces)

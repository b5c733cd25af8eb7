"""Fit and score of a set of terms (a support): output-error fit, then free runs on held-out records."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from rigsight.effects import Effect, placed_dimension
from rigsight.identify import FitResult, GreyBoxFit, IdleThreads, free_names
from rigsight.records.record import Floats, Record
from rigsight.rigs import Rig
from rigsight.simulate import Structure, carried_over, compose, unique_names
from rigsight.units import characteristic_value

Support = frozenset[str]
Release = frozenset[tuple[str, str]]
"""Parameters as effect and own name, which is the same whatever other effects a structure has."""
Progress = Callable[[Support], None]
_EVALUATIONS = 40
_FIRST_EVALUATIONS = 12
HOPELESS = 10.0
"""Factor over the best RMS so far at which a support is given up after the first evaluations."""
_FAR = 2.0
"""Factor over the best held-out error from which better initial states would not change the selection."""
_TOLERANCE = 1e-5
"""Relative change of the cost at which a fit of the search stops, and a score: with ten thousand independent samples this is a
hundredth of the decisive difference of the criterion."""
_FULL = 1e-7
"""The same for reported results."""


@dataclass(frozen=True, eq=False)
class Trial:
    """One polished support with its held-out score."""

    support: Support  # names of the effects
    fit: FitResult  # output-error fit to the estimation records
    error_over_noise: float  # RMS of the held-out free-run error in units of the noise floors
    # Held-out errors in units of the noise floors, all records one after the other, shape (n_samples, n_outputs); NaN
    # where nothing was measured, empty if a rough score was sufficient.
    residuals: Floats

    @property
    def n_free(self) -> int:
        """Number of fitted parameters."""
        return len(self.fit.free)

    @property
    def shown(self) -> list[Floats]:
        """Held-out errors of each output that was measured."""
        columns = [column[np.isfinite(column)] for column in self.residuals.T]
        return [column for column in columns if column.size]


@dataclass(frozen=True, eq=False)
class Attempt:
    """A support and the start of its fit."""

    support: Support  # names of the effects
    starts: Sequence[
        Mapping[str, float]
    ]  # values from which its fit starts; the best after a few evaluations goes on
    release: Release = frozenset()  # parameters that are not held at their special values

    @property
    def key(self) -> tuple[Support, Release]:
        """Key under which the trial is stored."""
        return self.support, self.release


@dataclass(frozen=True, eq=False)
class _RoughTrial:
    """A fit with the first evaluations of its score; None if the fit is not scored."""

    support: Support
    fit: FitResult
    problem: GreyBoxFit
    score: FitResult | None

    @property
    def error_over_noise(self) -> float:
        """Upper limit of the held-out error."""
        return float("inf") if self.score is None else float(np.sqrt(self.score.cost / self.score.n_samples))

    def as_it_is(self) -> Trial:
        return Trial(self.support, self.fit, self.error_over_noise, np.zeros(0))


@dataclass(frozen=True, eq=False)
class Bench:
    """Data and settings with which every support is polished and scored."""

    rig: Rig  # of one motion: the rig without what follows the motion
    # Records to fit and records to score; of one motion with the first output alone.
    estimation: tuple[Record, ...]
    held_out: tuple[Record, ...]
    values: Mapping[str, float]  # constants, and parameters without any term as start values
    # Size of each base quantity, noise floor of each output.
    scales: Mapping[str, float]
    noise: Mapping[str, float]
    held: frozenset[str]  # parameters of the rig that are not fitted
    effects: Mapping[str, Effect] = field(default_factory=dict)  # those offered as terms, by name
    modelled: tuple[Effect, ...] = ()  # effects of the given simulation, in every equation
    # Threads that fit supports, and the records of a fit, in parallel.
    threads: IdleThreads = field(default_factory=IdleThreads)
    # The supports polished so far.
    trials: dict[tuple[Support, Release], Trial] = field(default_factory=dict)

    def structure(self, support: Support, release: Release = frozenset()) -> Structure:
        """Return the equations of a support; special values of its effects are inserted unless released."""
        effects = (*self.modelled, *(self.effects[name] for name in sorted(support)))
        names = unique_names(self.rig, effects)
        fixed = {
            names[effect.name, own]: value
            for effect in effects
            for own, value in effect.special_cases.items()
            if (effect.name, own) not in release
        }
        return compose(self.rig, effects, fixed)

    def free_parameters(self, structure: Structure) -> list[str]:
        """Return the parameters that a fit of a structure varies."""
        return free_names(structure, {p.name for p in self.rig.parameters} - self.held)

    def trials_of(self, attempts: Sequence[Attempt], progress: Progress = lambda _: None) -> list[Trial]:
        """Polish supports in parallel and score them; an attempt that was made before is not repeated."""
        new = list({attempt.key: attempt for attempt in attempts if attempt.key not in self.trials}.values())
        polished = self._polished(new, progress)
        self.trials.update({attempt.key: trial for attempt, trial in zip(new, polished, strict=True)})
        return [self.trials[attempt.key] for attempt in attempts]

    def shortened(self, supports: Sequence[Support], longer: Trial) -> list[Trial]:
        """Polish supports from the fitted values of a longer one; of two fits of the same terms the better one is kept.

        Parameters that the longer one released from their special values are released here, too; those of terms that it lacks
        keep them.
        """
        moved = {(e.name, own) for e in longer.fit.structure.effects for own in e.special_cases}
        moved -= longer.fit.structure.special_cases
        attempts = []
        for support in supports:
            release = frozenset((name, own) for name, own in moved if name in support)
            structure = self.structure(support, release)
            attempts.append(Attempt(support, [self.carried(longer.fit, structure)], release))
        found = self._polished(attempts)
        for attempt, trial in zip(attempts, found, strict=True):
            known = self.trials.get(attempt.key)
            if known is None or trial.error_over_noise < known.error_over_noise:
                self.trials[attempt.key] = trial
        return [self.trials[attempt.key] for attempt in attempts]

    def carried(self, fit: FitResult, structure: Structure) -> dict[str, float]:
        """Return the values of a fit for another structure; what it does not know is as at first, linear terms are zero."""
        known = carried_over({**dict(fit.structure.fixed), **fit.values}, fit.structure, structure)
        values = {**self.values, **known}
        for effect in structure.effects:
            for p in effect.linear_parameters:
                if p.null is not None:
                    values.setdefault(structure.parameter_name(effect, p.name), p.null)
        return values

    def declared(self, structure: Structure) -> dict[str, float]:
        """Return the first start that each parameter of the effects of a structure declares."""
        values = {}
        for effect in structure.effects:
            for p in effect.parameters:
                size = characteristic_value(placed_dimension(effect, p.dimension), self.scales)
                start = p.starts[0] * size if p.fitted and p.starts else p.held_at(size)
                values[structure.parameter_name(effect, p.name)] = start
        return values

    def scored(self, support: Support, fit: FitResult) -> Trial:
        """Simulate the held-out records with a fit; only their initial states are estimated, to full precision."""
        return self._finely_scored(self._roughly_scored(support, fit), _FULL)

    def _polished(self, attempts: Sequence[Attempt], progress: Progress = lambda _: None) -> list[Trial]:
        """Fit and score; attempts far behind the best are not refined further.

        They are compared with all earlier trials, and with all of these attempts at the same stage, so that the result does not
        depend on the order in which the threads finish.
        """
        begun = self._begun(attempts)
        fits = [*(trial.fit for trial in self.trials.values()), *(fit for _, _, fit in begun)]
        hopeless = HOPELESS**2 * min((fit.cost for fit in fits), default=float("inf"))

        def further(one: tuple[Attempt, GreyBoxFit, FitResult]) -> _RoughTrial:
            attempt, problem, fit = one
            if not fit.success and fit.cost < hopeless:
                fit = problem.fit(
                    fit.values,
                    fit.free,
                    fit.initial_states,
                    max_evaluations=_EVALUATIONS - _FIRST_EVALUATIONS,
                    tolerance=_TOLERANCE,
                    finish=False,
                    substeps=fit.substeps,
                )
            return self._roughly_scored(attempt.support, fit)

        rough = []
        for trial in self.threads.side_by_side(further, begun):
            progress(trial.support)
            rough.append(trial)
        errors = [trial.error_over_noise for trial in self.trials.values()]
        errors += [trial.error_over_noise for trial in rough]
        far = _FAR * min(errors, default=float("inf"))

        def finished(trial: _RoughTrial) -> Trial:
            return self._finely_scored(trial) if trial.error_over_noise < far else trial.as_it_is()

        return list(self.threads.side_by_side(finished, rough))

    def _begun(self, attempts: Sequence[Attempt]) -> list[tuple[Attempt, GreyBoxFit, FitResult]]:
        """Return each attempt with its problem and, after the first evaluations, its best fit over its start values."""
        structures = [self.structure(attempt.support, attempt.release) for attempt in attempts]
        problems = [
            GreyBoxFit(structure, self.estimation, self.scales, self.noise, threads=self.threads)
            for structure in structures
        ]
        held = {name: self.values[name] for name in self.held if name in self.values}
        starts = [
            [_within_bounds(structure, {**start, **held}) for start in attempt.starts]
            for attempt, structure in zip(attempts, structures, strict=True)
        ]
        # Second starts come last: run together with the first one, they would only wait for the same kernel to be compiled.
        begun = [
            (number, own[rank])
            for rank in range(max(map(len, starts), default=0))
            for number, own in enumerate(starts)
            if rank < len(own)
        ]

        def looked(begin: tuple[int, Mapping[str, float]]) -> FitResult:
            number, start = begin
            free = self.free_parameters(structures[number])
            return problems[number].fit(
                start, free, max_evaluations=_FIRST_EVALUATIONS, tolerance=_TOLERANCE, finish=False
            )

        best: dict[int, FitResult] = {}
        for (number, _), fit in zip(begun, self.threads.side_by_side(looked, begun), strict=True):
            if number not in best or fit.cost < best[number].cost:
                best[number] = fit
        return [(attempt, problems[i], best[i]) for i, attempt in enumerate(attempts)]

    def _roughly_scored(self, support: Support, fit: FitResult) -> _RoughTrial:
        problem = GreyBoxFit(fit.structure, self.held_out, self.scales, self.noise, threads=self.threads)
        if not np.isfinite(fit.cost):
            return _RoughTrial(support, fit, problem, None)
        score = problem.fit(
            fit.values, [], max_evaluations=_FIRST_EVALUATIONS, tolerance=_TOLERANCE, finish=False
        )
        return _RoughTrial(support, fit, problem, score)

    def _finely_scored(self, trial: _RoughTrial, tolerance: float = _TOLERANCE) -> Trial:
        if not np.isfinite(trial.error_over_noise) or trial.score is None:
            return trial.as_it_is()
        score = trial.problem.fit(trial.fit.values, [], trial.score.initial_states, tolerance=tolerance)
        if not score.residuals:
            return Trial(trial.support, trial.fit, float("inf"), np.zeros(0))
        floors = [self.noise.get(signal.name, 1.0) for signal in trial.fit.structure.rig.outputs]
        errors = np.concatenate(score.residuals) / floors
        shown = errors[np.isfinite(errors)]
        return Trial(trial.support, trial.fit, float(np.sqrt(np.mean(shown**2))), errors)


def _within_bounds(structure: Structure, values: Mapping[str, float]) -> dict[str, float]:
    """Return start values of all parameters of a structure, within their bounds."""
    known = {p.name: p.default for p in structure.parameters if p.default is not None} | dict(values)
    return {
        p.name: float(np.clip(known[p.name], p.lower, p.upper))
        for p in structure.parameters
        if p.name in known
    }

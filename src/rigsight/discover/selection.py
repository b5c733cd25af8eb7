"""Selection of terms: every support is fitted by output error and judged by free-run simulation of held-out records.

Regression along the motion proposes terms; this module selects them. A term must improve the fit to the held-out records by more
than the penalty of the Bayesian information criterion for their independent samples; of two indistinguishable models the one with
fewer terms is kept.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigsight.discover.along_motion import AlongMotion, Proposed
from rigsight.discover.bench import HOPELESS, Attempt, Bench, Support, Trial
from rigsight.discover.input_noise import error_of_inputs
from rigsight.discover.stability import information_criterion
from rigsight.effects import Effect
from rigsight.errors import SimulationError
from rigsight.inverse.effect_terms import is_late, lateness
from rigsight.records.record import Floats
from rigsight.simulate import carried_over

STRONG = 10.0
"""Difference of the criterion that counts as decided (Kass and Raftery 1995: very strong evidence)."""
BY_NOISE = 1.5
"""Error in noise floors up to which it may be noise of the sensors; above, something else is missing."""
_BARE = 2.0
"""Difference that is not worth more than a bare mention (the same)."""
_MOST_TERMS = 5
_ROUNDS = 4
"""Rounds in which terms are added; rounds in which terms are only removed end by themselves."""
_BESIDE = 2
"""Equations that are extended beside the best, if terms act at several joints."""
_NEAR = 1.5
"""Factor of the smallest held-out error up to which they are."""
_RELEASED = 0.98
"""Factor by which a released special value (an exponent of 1) must lower the held-out error to be kept."""

_FEWEST = 10.0
"""Independent samples that are assumed at least."""
_CHANCE = 2.0
"""Standard deviations by which an RMS may exceed the floor by chance."""
_WHITE = 0.75
"""Share of independent samples from which residuals count as white."""


def independent_samples(trial: Trial) -> float:
    """Return the number of independent samples that is equivalent to the colored held-out errors of all outputs."""
    return sum(map(_independent, trial.shown)) or _FEWEST


def _independent(residuals: Floats) -> float:
    n = residuals.size
    centered = residuals - np.mean(residuals)
    power = np.abs(np.fft.rfft(centered, 2 * n)) ** 2
    correlation = np.fft.irfft(power)[: n // 2] / max(float(centered @ centered), 1e-300)
    # Beyond a tenth of the record the remaining correlation is random.
    lags = correlation[1 : max(2, n // 10)]
    return float(max(n / (1.0 + 2.0 * np.sum(lags**2)), _FEWEST))


def at_floor(trial: Trial) -> bool:
    """Return True if a held-out error is as small and as white as the noise: there is nothing left to explain."""
    n = sum(errors.size for errors in trial.shown)
    if n == 0:
        return False
    return bool(
        trial.error_over_noise <= 1.0 + _CHANCE / np.sqrt(2.0 * n)
        and independent_samples(trial) >= _WHITE * n
    )


def _is_noise_of_inputs(bench: Bench, trial: Trial) -> bool:
    """Return True if noise of the inputs can leave the error of the fitted records, and noise of the sensors cannot."""
    error = trial.fit.weighted_rms
    if not BY_NOISE < error < math.inf:
        return False
    of_inputs = error_of_inputs(trial.fit, bench.estimation, bench.noise)
    by_chance = 1.0 + _CHANCE / math.sqrt(2.0 * independent_samples(trial))
    return error <= by_chance * math.hypot(1.0, of_inputs)


def criterion(trial: Trial, independent: float) -> float:
    """Return the information criterion of a held-out error."""
    if not np.isfinite(trial.error_over_noise):
        return float("inf")
    return information_criterion(trial.error_over_noise**2, trial.n_free, independent)


@dataclass(frozen=True, eq=False)
class Selection:
    """The chosen support, and all that were tried."""

    best: Trial  # the chosen support
    trials: tuple[Trial, ...]  # all polished supports, best first
    independent: float  # number of independent samples of the held-out errors

    def otherwise(self, term: str) -> float:
        """Return the held-out error, in noise floors, of the equation without a term of its own or with another one.

        NaN where this equation was not tried.
        """
        changed = self.best.support ^ {term}
        return next((t.error_over_noise for t in self.trials if t.support == changed), math.nan)


def select(
    bench: Bench, linear: Trial, along: AlongMotion | None, progress: Callable[[str], None]
) -> Selection:
    """Search for the support with the lowest held-out criterion, from the equation without any term on.

    Where the sensors do not show the motion, every term is tried by a fit.
    """
    search = _Search(bench, along, progress)
    pool = [linear]
    if not at_floor(linear):
        pool += search.tried([search.attempt(p, linear) for p in along.at_once()] if along else [])
    best = linear
    # A term that another one has made unnecessary is removed, even if that one was added later.
    for number in range(_ROUNDS + _MOST_TERMS):
        shorter = [best.support - {name} for name in sorted(best.support)]
        longer: list[Attempt] = []
        if number < _ROUNDS and len(best.support) < _MOST_TERMS and not any(map(at_floor, pool)):
            for trial in _to_extend(bench, pool, best) if along is not None else [best]:
                longer += search.longer(trial)
        pool += search.tried(longer)
        pool += bench.shortened(shorter, best) + search.tried(search.exchanged(best))
        found = _fewest(bench, pool)
        if found is best and number > 0 and not at_floor(best):
            pool += search.tried(search.generalized(best))
            found = _fewest(bench, pool)
        if found is best and number > 0:
            break
        best = found
    if not math.isfinite(best.error_over_noise):
        raise SimulationError(
            f"The equations of {bench.rig.name} cannot be simulated near these records: {best.fit.message}"
        )
    while along is not None and (name := along.by_chance(best.fit)):
        (without,) = bench.shortened([best.support - {name}], best)
        if not _is_noise_of_inputs(bench, without):
            break
        best = without
        pool.append(best)
    independent = _independent_of(pool)
    by_support: dict[Support, Trial] = {}
    for trial in sorted(pool, key=lambda t: criterion(t, independent)):
        by_support.setdefault(trial.support, trial)
    return Selection(best, tuple(by_support.values()), independent)


def best_with_law(
    bench: Bench,
    along: AlongMotion,
    equation: Trial,
    laws: Sequence[tuple[Effect, Sequence[str]]],
    progress: Callable[[str], None],
) -> Trial:
    """Return the best of the equations with one further law each, in place of the terms that are named beside it."""
    offered = {**bench.effects, **{law.name: law for law, _ in laws}}
    search = _Search(replace(bench, effects=offered), along, progress)
    longer = [search.attempt(along.with_law(equation.fit, law, others), equation) for law, others in laws]
    return _fewest(search.bench, search.tried(longer))


@dataclass(frozen=True, eq=False)
class _Search:
    """Attempts beside an equation, and their trials."""

    bench: Bench
    along: AlongMotion | None
    progress: Callable[[str], None]

    def longer(self, trial: Trial) -> list[Attempt]:
        """Return the attempts with one term more than an equation."""
        if self.along is not None:
            return [self.attempt(proposed, trial) for proposed in self.along.beside(trial.fit)]
        found = []
        for name in self.bench.effects:
            if name not in trial.support:
                structure = self.bench.structure(trial.support | {name})
                known = carried_over(trial.fit.all_values, trial.fit.structure, structure)
                start = {**self.bench.values, **self.bench.declared(structure), **known}
                found.append(Attempt(trial.support | {name}, [start]))
        return found

    def attempt(self, proposed: Proposed, shorter: Trial) -> Attempt:
        """Return an attempt that starts from the regression, and from the fit of a shorter equation.

        Columns of a smoothed motion can be inaccurate: a fit that starts from them alone may end with a higher cost than one with
        fewer terms.
        """
        support = frozenset(effect.name for effect in proposed.effects)
        structure = self.bench.structure(support)
        regressed = [start.values(structure) for start in proposed.starts]
        carried = self.bench.carried(shorter.fit, structure)
        starts = [{**carried, **start} for start in regressed]
        return Attempt(support, [*starts, {**regressed[0], **carried}])

    def exchanged(self, trial: Trial) -> list[Attempt]:
        """Return the attempts with another form in place of a term.

        A regression may prefer a complex term to its special case, and to it a delay and a lag at one place are the same.
        """
        effects = self.bench.effects
        found = []
        for name in sorted(trial.support):
            found += self._as_late(trial, effects[name])
            for parent in effects[name].parents:
                found += self._instead(trial, name, parent)
        return found

    def generalized(self, trial: Trial) -> list[Attempt]:
        """Return the attempts with a form in place of a term that contains it.

        A search that adds the fewest parameters first may end at a special case of what is missing.
        """
        found = []
        for name in sorted(trial.support):
            forms = [name]
            for form in forms:
                wider = [effect.name for effect in self.bench.effects.values() if form in effect.parents]
                forms += [one for one in wider if one not in forms]
            for form in forms[1:]:
                found += self._instead(trial, name, form)
        return found

    def _instead(self, trial: Trial, name: str, other: str) -> list[Attempt]:
        effects = self.bench.effects
        if self.along is None or other not in effects or other in trial.support:
            return []
        proposed = self.along.instead(trial.fit, effects[name], effects[other])
        return [] if proposed is None else [self.attempt(proposed, trial)]

    def _as_late(self, trial: Trial, effect: Effect) -> list[Attempt]:
        """Return the attempts with another delay or lag at the place of one, as late as this one.

        Another term may make up for the difference of both. So a fit also starts without each of them.
        """
        bench, found = self.bench, list[Attempt]()
        if not is_late(effect):
            return []
        late = lateness(effect, trial.fit.structure.values_of(effect, trial.fit.all_values))
        for other in bench.effects.values():
            is_alike = is_late(other) and bench.rig.acts_at(other) == bench.rig.acts_at(effect)
            if is_alike and other.name not in trial.support:
                support = trial.support - {effect.name} | {other.name}
                structure = bench.structure(support)
                (own,) = (p.name for p in other.parameters if p.fitted)
                start = {**bench.carried(trial.fit, structure), structure.parameter_name(other, own): late}
                beside = [bench.effects[name] for name in sorted(support - {other.name})]
                absent = [
                    {structure.parameter_name(e, p.name): p.null for p in e.parameters if p.null is not None}
                    for e in beside
                ]
                found.append(
                    Attempt(support, [start, *({**start, **without} for without in absent if without)])
                )
        return found

    def tried(self, attempts: Sequence[Attempt]) -> list[Trial]:
        """Return the trials of attempts, with special values released where that lowers the error."""
        bench = self.bench
        trials = bench.trials_of(
            attempts, lambda support: self.progress(", ".join(sorted(support)) or "linear")
        )
        enough = HOPELESS * min((t.error_over_noise for t in bench.trials.values()), default=math.inf)
        releases = [
            Attempt(t.support, [{**dict(t.fit.structure.fixed), **t.fit.values}], special)
            for t in trials
            if (special := t.fit.structure.special_cases) and t.error_over_noise < enough and not at_floor(t)
        ]
        released = {trial.support: trial for trial in bench.trials_of(releases)}
        # A trial with released values is kept if its lower error justifies the additional parameters.
        pairs = [(held, released.get(held.support, held)) for held in trials]
        return [
            held if new.error_over_noise >= _RELEASED * held.error_over_noise else new for held, new in pairs
        ]


def _independent_of(trials: Sequence[Trial]) -> float:
    return independent_samples(min(trials, key=lambda t: t.error_over_noise))


def _fewest(bench: Bench, trials: Sequence[Trial]) -> Trial:
    """Return the trial with the fewest parameters of those that the held-out records do not distinguish from the best.

    With equal numbers of parameters, fewer states are preferred, then what was offered first: a loop with one state to a series
    of sliders with six, a cubic spring to a pendulum.
    """
    independent = _independent_of(trials)
    costs = {id(trial): criterion(trial, independent) for trial in trials}
    lowest = min(costs.values())
    close = [t for t in trials if costs[id(t)] <= lowest + STRONG or costs[id(t)] == lowest]
    size = min((t.n_free, len(t.fit.structure.states)) for t in close)
    alike = [t for t in close if (t.n_free, len(t.fit.structure.states)) == size]
    best = min(costs[id(t)] for t in alike)
    order = {name: number for number, name in enumerate(bench.effects)}
    near = [t for t in alike if costs[id(t)] <= best + _BARE or costs[id(t)] == best]
    return min(near, key=lambda t: (sorted(order[name] for name in t.support), costs[id(t)]))


def _to_extend(bench: Bench, pool: Sequence[Trial], best: Trial) -> list[Trial]:
    """Return the trials whose equations get a further term, the best first.

    With terms at several joints, a wrong term that imitates two right ones at once can be better than either of them alone.
    """
    if len(bench.rig.mechanism.joints) < 2:
        return [best]
    as_long = {trial.support: trial for trial in pool if len(trial.support) == len(best.support)}
    ordered = sorted(as_long.values(), key=lambda trial: trial.error_over_noise)
    near = [t for t in ordered if t.error_over_noise < _NEAR * best.error_over_noise and t is not best]
    return [best, *near[:_BESIDE]]

"""Which terms stay? Every support is polished by output error and judged by free-run simulation of records it has not seen.

Regression proposes and this decides. A term must earn its place on the held-out records by more than the Bayesian information
criterion of their independent samples; of two models that those cannot tell apart the one with fewer terms is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from rigsight.discover.hysteresis import LOOPS
from rigsight.discover.library import Candidate
from rigsight.discover.regression import Projected, information_criterion, sparse_path
from rigsight.identify import FitResult, GreyBoxFit
from rigsight.records.record import Record
from rigsight.rigs import Rig
from rigsight.simulate import Structure, carried_over, compose

STRONG = 10.0
"""Difference of the criterion that counts as decided (Kass and Raftery 1995: very strong evidence)."""
_SEEDS = 5
_LONGEST_SEED = 3
_MOST_TERMS = 5
_GROWTH = 3
_WORTH = 0.02
"""Share of the regression's residual power that a term must explain to be worth a polish, unless it is the first in line."""
_ROUNDS = 4
_EVALUATIONS = 40
_FIRST_EVALUATIONS = 12
_HOPELESS = 10.0
"""Factor over the best RMS so far at which a support is given up after the first evaluations."""
_TOLERANCE = 1e-5
_SMALL = 1e-3
_RELEASED = 0.98
"""Factor by which a released special value (an exponent of 1) must lower the held-out error to be kept."""

_CHANCE = 2.0
"""Standard deviations by which an RMS may exceed the floor by chance."""
_WHITE = 0.75
"""Share of independent samples from which residuals count as white."""

Support = frozenset[str]


@dataclass(frozen=True, eq=False)
class Trial:
    """One polished support with its held-out score.

    Attributes
    ----------
    support
        Names of the effects.
    fit
        Output-error fit to the estimation records.
    excess
        RMS of the first output's held-out free-run error in units of the noise floor.
    residuals
        Held-out errors of the first output in units of the noise floor, all records one after the other.
    """

    support: Support
    fit: FitResult
    excess: float
    residuals: NDArray[np.float64]

    @property
    def n_free(self) -> int:
        """Number of fitted parameters."""
        return len(self.fit.free)


@dataclass(frozen=True, eq=False)
class Bench:
    """What every support is polished and scored with.

    Attributes
    ----------
    rig
        The rig.
    estimation, held_out
        Records to fit and records to score.
    values
        Constants, and linear parameters as start values.
    scales, noise
        Size of each base quantity, noise floor of each output.
    held
        Parameters of the rig that no fit moves.
    candidates
        The library, by name.
    projected
        The regression.
    own_terms
        Columns of the rig's own terms that compete (full form), by parameter.
    trials
        What has been polished.
    """

    rig: Rig
    estimation: tuple[Record, ...]
    held_out: tuple[Record, ...]
    values: Mapping[str, float]
    scales: Mapping[str, float]
    noise: Mapping[str, float]
    held: frozenset[str]
    candidates: Mapping[str, Candidate]
    projected: Projected
    own_terms: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    trials: dict[tuple[Support, Support, Support], Trial] = field(default_factory=dict)

    @property
    def sparse(self) -> Projected:
        """The regression with nothing projected out that competes."""
        if not self.own_terms:
            return self.projected
        kept = [
            i
            for i in range(self.projected.base.shape[1])
            if not any(
                np.array_equal(self.projected.base[:, i], column) for column in self.own_terms.values()
            )
        ]
        return replace(self.projected, base=self.projected.base[:, kept])

    def column(self, name: str) -> NDArray[np.float64]:
        """Return the column of a term, one of the library or of the rig's own."""
        return self.own_terms[name] if name in self.own_terms else self.candidates[name].column

    def structure(self, support: Support, release: frozenset[str] = frozenset()) -> Structure:
        """Return the equations of a support; special values of its effects are written in unless released."""
        effects = [self.candidates[name].effect for name in sorted(support)]
        fixed = {
            name: value
            for effect in effects
            for name, value in effect.special_cases.items()
            if name not in release and self.candidates[effect.name].inner.get(name, value) == value
        }
        return compose(self.rig, effects, fixed)

    def free_parameters(self, structure: Structure, held: frozenset[str] = frozenset()) -> list[str]:
        """Return what a fit of a structure moves."""
        fixed = dict(structure.fixed)
        names = {p.name for p in self.rig.parameters} - self.held - held
        for effect in structure.effects:
            for parameter in effect.parameters:
                name = structure.parameter_name(effect, parameter.name)
                if parameter.fitted and name not in fixed:
                    names.add(name)
        return [name for name in structure.names if name in names]

    def start(self, structure: Structure, support: Support) -> dict[str, float]:
        """Return the values that the regression gives a support, in SI."""
        chosen = [self.candidates[name] for name in sorted(support)]
        columns = (
            np.column_stack([c.column for c in chosen])
            if chosen
            else np.zeros((self.projected.target.size, 0))
        )
        solution, _ = self.projected.solved(columns)
        values, force = _rig_values(self.rig, self.values, solution[: self.projected.base.shape[1]])
        for candidate, coefficient in zip(
            chosen, solution[self.projected.base.shape[1] :] * force, strict=True
        ):
            values |= self._effect_values(structure, candidate, float(coefficient), values)
        bounds = {p.name: p for p in structure.parameters}
        return {
            name: float(np.clip(value, bounds[name].lower, bounds[name].upper))
            for name, value in values.items()
            if name in bounds
        }

    def _effect_values(
        self, structure: Structure, candidate: Candidate, coefficient: float, values: Mapping[str, float]
    ) -> dict[str, float]:
        effect = candidate.effect
        own = {p.name: p.default for p in effect.parameters if p.default is not None}
        own |= candidate.inner
        own |= {name: share * coefficient for name, share in candidate.linear.items()}
        found: dict[str, float] = {}
        if effect.name in LOOPS:
            stiffness = self.rig.motion.stiffness.name
            without = max(values[stiffness], _SMALL * coefficient)
            total = without + max(coefficient, _SMALL * without)
            found[stiffness] = total
            own["a"] = without / total
        for parameter in effect.parameters:
            if parameter.name in candidate.linear and parameter.lower == 0.0:
                # A resisting force that the regression turns round is one that is hardly there.
                own[parameter.name] = max(own[parameter.name], _SMALL * abs(own[parameter.name]))
            if parameter.name in own:
                found[structure.parameter_name(effect, parameter.name)] = own[parameter.name]
        return found

    def trial(
        self,
        support: Support,
        release: Support = frozenset(),
        start: Mapping[str, float] | None = None,
        left_out: Support = frozenset(),
    ) -> Trial:
        """Polish a support and score it; what has been done is not done again.

        Parameters
        ----------
        support
            Names of the effects.
        release
            Parameters that are not to be held at their special values.
        start
            Values to start from; default are those of the regression.
        left_out
            Rig parameters that stay where `start` has them.
        """
        key = support, release, left_out
        if key not in self.trials:
            self.trials[key] = self._polished(support, release, start, left_out)
        return self.trials[key]

    def shortened(self, support: Support, longer: Trial) -> Trial:
        """Polish a support once more from the values that a longer one ended at, and keep the better of both."""
        kept = {name for name, _ in longer.fit.structure.fixed}
        special = {name for n in support for name in self.candidates[n].effect.special_cases}
        release = frozenset(special - kept)
        structure = self.structure(support, release)
        start = {
            **self.start(structure, support),
            **carried_over(longer.fit.values, longer.fit.structure, structure),
        }
        before = self.trial(support)
        again = self._polished(support, release, start, frozenset())
        return again if again.excess < before.excess else before

    def _polished(
        self, support: Support, release: Support, start: Mapping[str, float] | None, left_out: Support
    ) -> Trial:
        structure = self.structure(support, release)
        values = dict(start) if start is not None else self.start(structure, support)
        free = self.free_parameters(structure, left_out)
        problem = GreyBoxFit(structure, self.estimation, self.scales, self.noise)
        fit = problem.fit(
            values, free, max_evaluations=_FIRST_EVALUATIONS, tolerance=_TOLERANCE, finish=False
        )
        best = min((trial.fit.cost for trial in self.trials.values()), default=float("inf"))
        if not fit.success and fit.cost < _HOPELESS**2 * best:
            fit = problem.fit(
                fit.values,
                free,
                fit.initial_states,
                max_evaluations=_EVALUATIONS - _FIRST_EVALUATIONS,
                tolerance=_TOLERANCE,
                finish=False,
                substeps=fit.substeps,
            )
        return self.scored(support, fit)

    def scored(self, support: Support, fit: FitResult) -> Trial:
        """Simulate the held-out records with a fit; only their initial states are estimated."""
        if not np.isfinite(fit.cost):
            return Trial(support, fit, float("inf"), np.zeros(0))
        score = GreyBoxFit(fit.structure, self.held_out, self.scales, self.noise).fit(fit.values, [])
        if not score.residuals:
            return Trial(support, fit, float("inf"), np.zeros(0))
        output = self.rig.outputs[0].name
        errors = np.concatenate([r[:, 0] for r in score.residuals]) / self.noise[output]
        return Trial(support, fit, float(np.sqrt(np.mean(errors**2))), errors)


def _rig_values(
    rig: Rig, known: Mapping[str, float], base: NDArray[np.float64]
) -> tuple[dict[str, float], float]:
    """Return the rig's parameters from the coefficients of its own terms, and the force per unit of the others'."""
    values = dict(known)
    motion = rig.motion
    if not rig.is_driven:
        values |= {motion.damping.name: base[0], motion.stiffness.name: base[1], motion.bias.name: base[2]}
        return values, 1.0
    gain = float(motion.drive_gain.subs({s: known[s.name] for s in motion.drive_gain.free_symbols}))
    assert motion.inertia is not None
    inertia = gain / base[0] if base[0] * gain > 0.0 else known[motion.inertia.name]
    values[motion.inertia.name] = inertia
    values[motion.damping.name] = max(base[1] * inertia, 1e-4 * known[motion.damping.name])
    if len(base) == 4:
        stiffness = max(base[2] * inertia, 1e-3 * known[motion.stiffness.name])
        values[motion.stiffness.name] = stiffness
        values[motion.rest.name] = known[motion.rest.name] + base[3] * inertia / stiffness
    else:
        for symbol in motion.bias.free_symbols:
            values[symbol.name] = base[2] * inertia
    return values, inertia


def independent_samples(residuals: NDArray[np.float64]) -> float:
    """Return how many independent samples stand behind colored residuals, shape (n_samples,)."""
    n = residuals.size
    centered = residuals - np.mean(residuals)
    power = np.abs(np.fft.rfft(centered, 2 * n)) ** 2
    correlation = np.fft.irfft(power)[: n // 2] / max(float(centered @ centered), 1e-300)
    # Beyond a tenth of the record, what is left of the correlation is chance.
    lags = correlation[1 : max(2, n // 10)]
    return float(max(n / (1.0 + 2.0 * np.sum(lags**2)), 10.0))


def at_floor(trial: Trial) -> bool:
    """Return True if a held-out error is as small and as white as the noise: there is nothing left to explain."""
    n = trial.residuals.size
    if n == 0:
        return False
    return bool(
        trial.excess <= 1.0 + _CHANCE / np.sqrt(2.0 * n)
        and independent_samples(trial.residuals) >= _WHITE * n
    )


def criterion(trial: Trial, independent: float) -> float:
    """Return the information criterion of a held-out error."""
    if not np.isfinite(trial.excess):
        return float("inf")
    return information_criterion(trial.excess**2, trial.n_free, independent)


@dataclass(frozen=True, eq=False)
class Selection:
    """What was chosen.

    Attributes
    ----------
    best
        The chosen support.
    trials
        All polished supports, best first.
    criteria
        Information criterion of each.
    independent
        Independent samples behind the held-out errors.
    """

    best: Trial
    trials: tuple[Trial, ...]
    criteria: tuple[float, ...]
    independent: float


def select(bench: Bench, progress: Callable[[str], None]) -> Selection:
    """Search for the support with the lowest held-out criterion: seeds from the regression, then steps of one term.

    Parameters
    ----------
    bench
        Library, records and scales.
    progress
        Called with what has just been polished.
    """

    def tried(support: Support) -> Trial:
        trial = bench.trial(support)
        special = dict(trial.fit.structure.fixed)
        if special and not at_floor(trial):
            start = {**trial.fit.values, **special}
            released = bench.trial(support, release=frozenset(special), start=start)
            trial = released if released.excess < _RELEASED * trial.excess else trial
        progress(", ".join(sorted(support)) or "linear")
        return trial

    pool = [tried(frozenset())]
    for support in proposals(bench):
        if at_floor(pool[-1]):
            break
        pool.append(tried(support))
    if not any(at_floor(trial) for trial in pool):
        # A rich term may stand for a simple one in the regression, and its fit stop where that of the simple one does not.
        pool += [tried(support) for support in _special_cases(bench, [trial.support for trial in pool])]
    independent = independent_samples(min(pool, key=lambda t: t.excess).residuals)

    def cost(trial: Trial) -> float:
        return criterion(trial, independent)

    best = _fewest(pool, cost)
    for _ in range(_ROUNDS):
        shorter = _simpler(bench, best.support)
        longer = [best.support | {name} for name in next_terms(bench, best.support)]
        if len(best.support) >= _MOST_TERMS or at_floor(best):
            longer = []
        pool += [tried(frozenset(support)) for support in (*shorter, *longer)]
        # What stopped short from the regression's values may go on from those of the longer equation.
        pool += [bench.shortened(frozenset(support), best) for support in shorter if support]
        finest = min(pool, key=lambda t: t.excess)
        independent = independent_samples(finest.residuals)
        found = _fewest(pool, cost)
        if found is best:
            break
        best = found
    by_support: dict[Support, Trial] = {}
    for trial in sorted(pool, key=cost):
        by_support.setdefault(trial.support, trial)
    ordered = list(by_support.values())
    return Selection(best, tuple(ordered), tuple(cost(trial) for trial in ordered), independent)


def _fewest(trials: Sequence[Trial], cost: Callable[[Trial], float]) -> Trial:
    """Return the trial with the fewest parameters of those that the held-out records cannot tell from the best."""
    lowest = min(cost(trial) for trial in trials)
    close = [trial for trial in trials if cost(trial) <= lowest + STRONG or cost(trial) == lowest]
    # As many parameters: one state is less than the six of a spread of sliders.
    return min(close, key=lambda t: (t.n_free, len(t.fit.structure.states), cost(t)))


def proposals(bench: Bench) -> list[Support]:
    """Return the supports that the regression proposes, short ones first, each of which is worth a polish."""
    names = list(bench.candidates)
    if not names:
        return []
    columns = np.column_stack([bench.candidates[name].column for name in names])
    together = np.column_stack([columns, *bench.own_terms.values()])
    paths = sparse_path(bench.sparse, together)
    supports = {tuple(i for i in path if i < len(names)) for path in paths}
    shares = [bench.projected.explained(columns[:, [i]])[1] for i in range(len(names))]
    supports |= {(int(i),) for i in np.argsort(shares)[::-1][:_GROWTH]}

    def left(support: tuple[int, ...]) -> float:
        return bench.projected.solved(columns[:, list(support)])[1] ** 2

    def worth(support: tuple[int, ...]) -> bool:
        shorter = [tuple(i for i in support if i != out) for out in support]
        return len(support) == 1 or all(left(support) < (1.0 - _WORTH) * left(less) for less in shorter)

    short = [support for support in supports if 0 < len(support) <= _LONGEST_SEED and worth(support)]

    def cost(support: tuple[int, ...]) -> float:
        return information_criterion(left(support), len(support), bench.projected.independent)

    # Short ones first: what reaches the noise floor with one term needs no look at two.
    ordered = sorted(sorted(short, key=cost)[:_SEEDS], key=lambda support: (len(support), cost(support)))
    return [frozenset(names[i] for i in support) for support in ordered]


def _simpler(bench: Bench, support: Support) -> list[Support]:
    """Return the supports with a term less, or with a special case of a term in its place."""
    found = [support - {name} for name in sorted(support)]
    return found + _special_cases(bench, [support])


def _special_cases(bench: Bench, supports: Sequence[Support]) -> list[Support]:
    """Return the supports that have a special case of a term in its place, each once, without those that are given."""
    found = {
        support - {name} | {parent}: None
        for support in supports
        for name in sorted(support)
        for parent in bench.candidates[name].effect.parents
        if parent in bench.candidates and parent not in support
    }
    return [support for support in found if support not in supports]


def next_terms(bench: Bench, support: Support) -> list[str]:
    """Return the terms that explain most of what a support leaves of the regression, the first one first."""
    inside = [bench.candidates[name].column for name in sorted(support)]
    projected = replace(bench.projected, base=np.column_stack([bench.projected.base, *inside]))
    left = [name for name in bench.candidates if name not in support]
    shares = [projected.explained(bench.candidates[name].column[:, None])[1] for name in left]
    ranked = np.argsort(shares)[::-1][:_GROWTH]
    return [left[i] for rank, i in enumerate(ranked) if rank == 0 or shares[i] > _WORTH]

"""Certainty of the ranking: paired block bootstrap of the held-out errors, parsimony, tempered evidence, ambiguity."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rigsight.diagnose.fit_context import FittedModel
from rigsight.diagnose.noise.block_means import Blocks, squared_errors
from rigsight.diagnose.policy import VERDICT
from rigsight.diagnose.search.evidence_for_more import is_linear
from rigsight.effects.effect import Place
from rigsight.records.record import Floats


@dataclass(frozen=True)
class Grounds:
    """Basis of the probability of one model."""

    share: float  # of the ranking: held-out errors and evidence together
    held_out: float  # share of the resamplings of the held-out errors in which it is the simplest of the best
    # Logarithm of its evidence relative to the most probable model [nats]; None where its fit was not
    # finished.
    evidence: float | None


@dataclass(frozen=True)
class Ranking:
    """Scored models in order with their probabilities."""

    order: tuple[FittedModel, ...]  # models, the chosen one first, then by held-out error
    probabilities: tuple[float, ...]  # probability of each to be the cause among those tried
    # Models whose held-out error does not differ significantly from that of the chosen one.
    tied: tuple[FittedModel, ...]
    grounds: tuple[Grounds, ...]  # basis of each probability, in the same order
    # Error, on the stretches not drawn in a resampling, of the model with the best held-out errors in it, in
    # units of the noise floor; RMS over all resamplings. Evidence, which uses all records, does not affect
    # this selection. NaN if a model was selected by other means, or nothing was left out.
    error_of_choice: float = math.nan
    # Effects of models that cannot be the cause: of size zero, or slower or longer than the records show.
    impossible: frozenset[tuple[str, ...]] = frozenset()

    def with_model(self, model: FittedModel) -> Ranking:
        """Return the ranking with another fit of one of its models, which can be the cause."""
        order = tuple(model if m.names == model.names else m for m in self.order)
        return replace(self, order=order, impossible=self.impossible - {model.names})


def rank(
    models: Sequence[FittedModel],
    noise: Floats,
    rng: np.random.Generator,
    gap: float = 1.0,
    criterion: Callable[[FittedModel], float] | None = None,
    evidence_counts: bool = True,
) -> Ranking:
    """Rank models by held-out error and evidence; the simplest of those that tie with the best is chosen."""
    # Held-out errors are what an engineer sees, but they say little if noise or a disturbance force dominates the error of every
    # model. Then the spectrum of the residual says more.
    # H. R. Kuensch, Ann. Statist. 17 (1989) 1217, for the block bootstrap. B. Efron and R. Tibshirani, J. Am. Stat. Assoc. 92
    # (1997) 548, for errors on what was not drawn.
    usable = [m for m in models if m.residuals and np.isfinite(m.error_over_noise)]
    failed = [m for m in models if m not in usable]
    if not usable:
        return with_last(Ranking((), (), (), ()), models)
    squares = squared_errors([m.residuals for m in usable], noise)
    draws = squares.draws(rng)
    errors = np.sqrt(squares.mean)
    best = float(np.min(errors))
    inexact = (VERDICT.model_error * max(best - 1.0, 0.0) + VERDICT.inexact * gap) / best
    tolerance = np.hypot(VERDICT.tie, inexact)
    # Far above the floor no model is exact, and a small difference does not indicate the true one.
    fine = VERDICT.inexact + VERDICT.model_error * max(best - VERDICT.at_floor, 0.0) / best
    resampled = np.sqrt(squares.resampled(draws))
    floor = np.min(resampled, axis=1, keepdims=True)
    n_free = np.array([m.n_free for m in usable])
    prior = VERDICT.prior_per_effect ** np.array(
        [
            len(m.effects)
            + _likened(m, usable)
            + _unidentifiable_sensor_effect(m)
            + _beside_a_new_force(m, usable)
            for m in usable
        ]
    )
    # In each resample the models with the fewest numbers within the tolerance of the best share the win: a little of it by their
    # prior odds alone, most goes to those with the fewest effects of them that are lowest.
    within = resampled <= floor * (1.0 + tolerance)
    fewest = np.min(np.where(within, n_free, np.iinfo(np.int64).max), axis=1, keepdims=True)
    tie = within & (n_free == fewest)
    n_effects = np.array([len(m.effects) for m in usable])
    plainest = np.min(np.where(tie, n_effects, np.iinfo(np.int64).max), axis=1, keepdims=True)
    plain = tie & (n_effects == plainest)
    lowest = np.min(np.where(plain, resampled, np.inf), axis=1, keepdims=True)
    ahead = plain & (resampled <= lowest * (1.0 + fine))
    won = (1.0 - VERDICT.hint) * _shared(tie, prior) + VERDICT.hint * _shared(ahead, prior)
    wins = np.mean(won, axis=0)
    evidence = _evidence_of(usable, errors / best, criterion)
    weights = _tempered(evidence) if evidence_counts else np.ones(len(usable))
    likelihood = (wins + VERDICT.negligible * np.exp(-VERDICT.fall * (errors / best - 1.0))) * weights
    probabilities = likelihood / np.sum(likelihood)
    chosen = int(np.argmax(probabilities))
    ratio = resampled / resampled[:, chosen : chosen + 1]
    tied = [
        i
        for i in range(len(usable))
        if i != chosen
        and float(np.quantile(ratio[:, i], 0.05)) <= 1.0 + tolerance
        and weights[i] > VERDICT.negligible * weights[chosen]
    ]
    rest = sorted((i for i in range(len(usable)) if i != chosen), key=lambda i: errors[i])
    order = [chosen, *rest]
    ranking = Ranking(
        order=tuple(usable[i] for i in order),
        probabilities=tuple(float(probabilities[i]) for i in order),
        tied=tuple(usable[i] for i in sorted(tied, key=lambda i: errors[i])),
        grounds=tuple(Grounds(float(probabilities[i]), float(wins[i]), evidence[i]) for i in order),
        error_of_choice=_error_of_choice(squares, draws, np.argmax(won, axis=1)),
    )
    return with_last(ranking, failed)


def with_last(ranking: Ranking, models: Sequence[FittedModel]) -> Ranking:
    """Return a ranking with models at its end that cannot be the cause."""
    return replace(
        ranking,
        order=(*ranking.order, *models),
        probabilities=(*ranking.probabilities, *(0.0 for _ in models)),
        grounds=(*ranking.grounds, *(Grounds(0.0, 0.0, None) for _ in models)),
        impossible=frozenset(model.names for model in models),
    )


def _error_of_choice(squares: Blocks, draws: NDArray[np.int64], winners: NDArray[np.int64]) -> float:
    """Return the error of each resampling's winner on the blocks that are not in it, root mean square."""
    left_out = np.ones(draws.shape, dtype=bool)
    np.put_along_axis(left_out, draws, values=False, axis=1)
    if not left_out.any():
        return math.nan
    return float(np.sqrt(np.average(squares.means[:, winners].T, weights=left_out * squares.sizes)))


def _evidence_of(
    models: Sequence[FittedModel],
    errors: Floats,
    criterion: Callable[[FittedModel], float] | None,
) -> list[float | None]:
    """Return the log evidence of each model relative to the most probable one; None if not fitted to convergence."""
    if criterion is None:
        return [None] * len(models)
    reported = [
        -0.5 * criterion(m) if error <= VERDICT.comparable else None
        for m, error in zip(models, errors, strict=True)
    ]
    most = max(value for value in reported if value is not None)
    return [None if value is None else value - most for value in reported]


def _tempered(evidence: Sequence[float | None]) -> Floats:
    """Return the tempered evidence in units of the largest; models without one have the least of the others."""
    least = min((value for value in evidence if value is not None), default=0.0)
    return np.exp(VERDICT.temper * np.array([least if value is None else value for value in evidence]))


def _shared(winners: NDArray[np.bool_], prior: Floats) -> Floats:
    """Return the share of each model in each resample's win, shape (n_resamples, n_models)."""
    shares = np.where(winners, prior, 0.0)
    return np.asarray(shares / np.sum(shares, axis=1, keepdims=True))


def _likened(model: FittedModel, others: Sequence[FittedModel]) -> bool:
    """Return True if an effect of this model is only another form of one in a model with equally many parameters."""
    return any(
        other.n_free == model.n_free
        and len(other.effects) == len(model.effects)
        and any(set(effect.parents) & (set(other.names) - set(model.names)) for effect in model.effects)
        and not _beside_a_new_force(other, [model])
        for other in others
    )


def _beside_a_new_force(model: FittedModel, others: Sequence[FittedModel]) -> bool:
    """Return True if a model needs an unknown constant force that another model explains."""
    # Models whose mean force is not needed have been removed before, see `nested_models`.
    return any(
        other.n_free == model.n_free
        and len(other.effects) == len(model.effects)
        and any(
            effect.holds_constant_force and set(effect.parents) & set(model.names) for effect in other.effects
        )
        for other in others
    )


def _unidentifiable_sensor_effect(model: FittedModel) -> bool:
    """Return True for a linear effect of the sensor of a rig with one output: it is equivalent to one of the drive."""
    one_output = len(model.fit.structure.rig.outputs) == 1
    return one_output and any(effect.place is Place.SENSOR and is_linear(effect) for effect in model.effects)

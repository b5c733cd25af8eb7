"""Does sampling the likelihood say anything about close rivals that Schwarz's criterion does not?

    .venv/bin/python experiments/evidence/sampled_evidence.py CAMPAIGN [CAMPAIGN ...]

For the models that share the ranking of a diagnosis, the integral of the likelihood over their parameters is computed by
importance sampling around the likeliest ones. The prior is the unit information prior, whose Laplace approximation is Schwarz's
criterion. So the difference between the two is the effect of kinks, ridges and better parameters nearby. The noise has the
spectrum of the model's own residual, as in the criterion.

References
----------
R. E. Kass and A. E. Raftery, J. Am. Stat. Assoc. 90 (1995) 773, for the unit information prior and importance sampling.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.optimize import least_squares
from scipy.special import logsumexp
from scipy.stats import multivariate_t

import rigsight.diagnose.diagnosis as diagnosis
from rigsight.diagnose.examination import Examination, examine
from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.policy import VERDICT
from rigsight.workflow.diagnose import run_diagnose

Floats = NDArray[np.float64]

N_DRAWS = 300
DEGREES = 5
"""Degrees of freedom of the t distribution that is drawn from: tails heavier than those of the likelihood."""
STATES = 30
"""Evaluations in which initial states follow the parameters."""
SMOOTHED = 9
"""Lines over which the spectrum of a residual is averaged, as in the criterion."""
STEP, AWAY = 1.0, 100.0
"""Step of finite differences [standard errors], and where the optimizer sees zero, because its steps are relative."""
LEAST_SPREAD = 1e-6
"""Least variance of a combination of parameters, relative to their own variances."""
OUT_OF_BOUNDS = 1e6
"""Residual, in units of its spectrum, of parameters with which the model cannot be simulated."""
SHARE = 0.01
"""Share of the ranking from which a model is a rival."""


@dataclass(frozen=True)
class Sampled:
    """Log evidence by sampling, compared with the criterion [nats].

    Attributes
    ----------
    gained
        Gain of the likeliest parameters over the fitted ones.
    more, error
        Log evidence minus that of the criterion, and its standard error.
    effective
        Draws that count (Kish).
    """

    gained: float
    more: float
    error: float
    effective: float


def sampled(context: FitContext, model: FittedModel, seed: int = 0) -> Sampled:
    """Return the evidence of the estimation records by importance sampling."""
    whitened = _whitened(context, model)
    n = len(model.fit.free)
    at_fit = _deviance(whitened(np.zeros(n)))
    likeliest = least_squares(
        lambda x: whitened(x - AWAY), np.full(n, AWAY), diff_step=STEP / AWAY, max_nfev=20, ftol=1e-4
    )
    covariance = np.linalg.inv(likeliest.jac.T @ likeliest.jac)
    proposal = multivariate_t(likeliest.x - AWAY, covariance, df=DEGREES)
    drawn = proposal.rvs(N_DRAWS, random_state=np.random.default_rng(seed)).reshape(N_DRAWS, n)
    likelihood = at_fit - np.array([_deviance(whitened(own)) for own in drawn])
    logarithms = likelihood - proposal.logpdf(drawn)
    weights = np.exp(logarithms - np.max(logarithms))
    of_laplace = 0.5 * np.linalg.slogdet(2.0 * np.pi * covariance)[1]
    return Sampled(
        gained=at_fit - float(likeliest.cost),
        more=float(logsumexp(logarithms) - np.log(N_DRAWS) - of_laplace),
        error=float(np.std(weights) / np.mean(weights) / np.sqrt(N_DRAWS)),
        effective=float(np.sum(weights) ** 2 / np.sum(weights**2)),
    )


def _whitened(context: FitContext, model: FittedModel) -> Callable[[Floats], Floats]:
    """Return the residual's lines over its spectrum at the fit, as a function of parameters in standard errors from the fit."""
    problem, best = context.problem(model.fit.structure, context.estimation), model.fit
    center = np.array([best.values[name] for name in best.free])
    sizes = np.sqrt(np.diag(best.covariance))
    spread, axes = np.linalg.eigh(best.covariance / np.outer(sizes, sizes))
    unit = sizes[:, None] * axes * np.sqrt(np.maximum(spread, LEAST_SPREAD))

    def residuals(numbers: Floats) -> tuple[Floats, ...]:
        values = {**best.values, **dict(zip(best.free, center + unit @ numbers, strict=True))}
        return problem.fit(values, [], best.initial_states, STATES, substeps=best.substeps).residuals

    powers = [np.abs(_lines(own)) ** 2 for own in residuals(np.zeros(len(best.free)))]
    spectra = [uniform_filter1d(own, SMOOTHED, axis=0) + 1e-12 * np.mean(own) for own in powers]
    expected = np.sqrt(np.concatenate([own.ravel() for own in spectra]))

    def whitened(numbers: Floats) -> Floats:
        found = residuals(numbers)
        if not found:
            return np.full(2 * expected.size, OUT_OF_BOUNDS)
        lines = np.concatenate([_lines(own).ravel() for own in found]) / expected
        return np.sqrt(2.0) * np.concatenate([lines.real, lines.imag])

    return whitened


def _lines(residual: Floats) -> NDArray[np.complex128]:
    return np.asarray(np.fft.rfft(residual, axis=0)[1:] / np.sqrt(residual.shape[0]))


def _deviance(lines: Floats) -> float:
    return 0.5 * float(np.sum(lines**2))


def examined(campaign: Path) -> Examination:
    """Return what a diagnosis of a campaign examines."""
    kept: list[Examination] = []

    def keeping(*arguments, **named) -> Examination:
        kept.append(examine(*arguments, **named))
        return kept[-1]

    diagnosis.examine = keeping
    run_diagnose(campaign, n_jobs=1)
    return kept[-1]


def main() -> None:
    """Diagnose campaigns and compare both ways on the rivals of each."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("campaign", type=Path, nargs="+")
    columns = (
        "floors",
        "share",
        "log evidence",
        "refit gains",
        "sampled, more by",
        "effective draws",
        "seconds",
    )
    print(f"| trial | model | {' | '.join(columns)} |")
    print("|---|---|" + "---:|" * len(columns))
    for campaign in parser.parse_args().campaign:
        found = examined(campaign)
        for model, grounds in zip(found.ranking.order, found.ranking.grounds, strict=True):
            if grounds.share < SHARE or not model.residuals:
                continue
            begun = time.perf_counter()
            own = sampled(found.context, model)
            told = "" if grounds.evidence is None else f"{grounds.evidence:.1f}"
            print(
                f"| {'/'.join(campaign.parts[-3::2])} | {' + '.join(model.names)} | {model.error_over_noise:.4f} "
                f"| {grounds.share:.3f} | {told} | {own.gained:.1f} | {own.more:+.1f} ± {own.error:.1f} "
                f"| {own.effective:.0f} | {time.perf_counter() - begun:.0f} |",
                flush=True,
            )
    print(f"\nA nat of evidence changes log odds by {VERDICT.temper}.")


if __name__ == "__main__":
    main()

"""Does nested sampling say anything of close rivals that the Laplace approximation does not?

    .venv/bin/python -m pip install dynesty==3.1.0
    .venv/bin/python experiments/evidence/nested_sampling.py CAMPAIGN [--models 2]

For the nearest models of a diagnosis the evidence of the estimation records is computed twice: by the Laplace approximation about
the fit, and by nested sampling in a box of eight standard errors around it, in the coordinates in which the approximation is a
standard normal density. Both under the same likelihood, white noise of the size that the best model leaves. What they differ by is
what kinks, ridges and further modes near the fit do to the volume that the approximation takes for the likelihood's.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from pathlib import Path

import dynesty
import numpy as np

import rigsight.diagnose.diagnosis as diagnosis
from rigsight.diagnose.examination import Examination, examine
from rigsight.diagnose.fitting.fit_context import FitContext, Scored
from rigsight.workflow.diagnose import run_diagnose

WIDTH = 8.0
"""Half the box [standard errors]."""
N_LIVE = 60
STATES = 6
"""Evaluations in which initial states follow the parameters."""


def log_evidence(context: FitContext, model: Scored, variance: float, seed: int) -> tuple[float, float, int]:
    """Return by how much nested sampling exceeds the Laplace approximation, its standard error, and the evaluations [nats]."""
    own = context.problem(model.fit.structure, context.estimation)
    names, best = list(model.fit.free), model.fit
    center = np.array([best.values[name] for name in names])
    # The formula's covariance allows for colored residuals; under white noise it is the inverse of the normal matrix.
    root = np.linalg.cholesky(best.covariance)
    reference = own.fit(best.values, [], best.initial_states, STATES, finish=False, substeps=best.substeps).cost

    def log_likelihood(unit: np.ndarray) -> float:
        values = {**best.values, **dict(zip(names, center + root @ unit, strict=True))}
        found = own.fit(values, [], best.initial_states, STATES, finish=False, substeps=best.substeps).cost
        return -0.5 * (found - reference) / variance if np.isfinite(found) else -1e300

    curvature = _curvature(log_likelihood, len(names))
    sampler = dynesty.NestedSampler(
        log_likelihood,
        lambda cube: WIDTH * (2.0 * cube - 1.0),
        len(names),
        nlive=N_LIVE,
        rstate=np.random.default_rng(seed),
        sample="rwalk",
    )
    sampler.run_nested(dlogz=0.1, print_progress=False)
    found = sampler.results
    in_box = len(names) * np.log(2.0 * WIDTH)
    laplace = 0.5 * len(names) * np.log(2.0 * np.pi) - 0.5 * np.linalg.slogdet(curvature)[1] - in_box
    return float(found.logz[-1] - laplace), float(found.logzerr[-1]), int(np.sum(found.ncall))


def _curvature(log_likelihood, n: int, step: float = 0.5) -> np.ndarray:
    """Return the negative Hessian at the fit by central differences half a standard error wide."""
    unit = step * np.eye(n)
    own = np.array([log_likelihood(e) + log_likelihood(-e) for e in unit])
    found = np.diag(-own / step**2)
    for i in range(n):
        for j in range(i):
            crossed = (
                log_likelihood(unit[i] + unit[j])
                + log_likelihood(-unit[i] - unit[j])
                - log_likelihood(unit[i] - unit[j])
                - log_likelihood(unit[j] - unit[i])
            )
            found[i, j] = found[j, i] = -crossed / (4.0 * step**2)
    return found


def nearest(found: Examination, n_models: int) -> Sequence[Scored]:
    """Return the models that leave least of the held-out records."""
    return sorted(found.ranking.order, key=lambda model: model.error_over_noise)[:n_models]


def main() -> None:
    """Diagnose the campaign and compare both ways on its nearest models."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("campaign", type=Path)
    parser.add_argument("--models", type=int, default=2)
    given = parser.parse_args()
    kept: list[Examination] = []

    def examined(*arguments, **named) -> Examination:
        kept.append(examine(*arguments, **named))
        return kept[-1]

    diagnosis.examine = examined
    run_diagnose(given.campaign, n_jobs=1)
    found = kept[-1]
    chosen = nearest(found, given.models)
    variance = min(model.fit.cost / model.fit.n_samples for model in chosen)
    grounds = {m.names: g for m, g in zip(found.ranking.order, found.ranking.grounds, strict=True)}
    for model in chosen:
        begun = time.perf_counter()
        more, error, calls = log_evidence(found.context, model, variance, 0)
        told = grounds[model.names].evidence
        print(
            f"| {given.campaign.name} | {' + '.join(model.names)} | {model.error_over_noise:.4f} | "
            f"{'' if told is None else f'{told:.1f}'} | {more:+.1f} ± {error:.1f} | {calls} | {time.perf_counter() - begun:.0f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()

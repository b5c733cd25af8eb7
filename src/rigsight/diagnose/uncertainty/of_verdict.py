"""Standard errors of the diagnosed simulation: from the bootstrap if possible."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rigsight.diagnose.fitting.fit_context import FitContext, Scored
from rigsight.diagnose.result import Candidate, Diagnosis
from rigsight.diagnose.uncertainty.bootstrap import uncertainty_of

_STREAM = 1
"""Beside the seed: other draws of a diagnosis stay what they are without these."""


def with_own_errors(diagnosis: Diagnosis, context: FitContext, model: Scored, seed: int) -> Diagnosis:
    """Return a diagnosis whose named candidate has standard errors of the bootstrap."""
    found = uncertainty_of(context, model.fit, np.random.default_rng([seed, _STREAM]))

    def own(candidate: Candidate) -> Candidate:
        if candidate.effects != model.names:
            return candidate
        estimates = {
            name: replace(estimate, std=found.std[name]) for name, estimate in candidate.parameters.items()
        }
        return replace(candidate, parameters=estimates, std_method=found.method)

    return replace(diagnosis, candidates=tuple(map(own, diagnosis.candidates)))

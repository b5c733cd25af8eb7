"""Innovations of a residual: the part of each sample that cannot be predicted from the previous samples.

A disturbance force causes errors that are correlated over many samples, most at the resonance. After a whitening filter, errors
and responses are compared as if the errors were white.

References
----------
L. Ljung, *System Identification* (Prentice Hall 1999), section 7.2, for prefilters that make errors white. P. J. Brockwell and
R. A. Davis, *Time Series: Theory and Methods* (Springer 1991), section 8.1, for the equations of Yule and Walker. G. Schwarz,
Ann. Statist. 6 (1978) 461, for the order.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.signal import correlate, lfilter

from rigsight.diagnose.pushes.responses import Followed, Responses
from rigsight.records.record import Floats

_ORDERS = (0, 1, 2, 4, 8, 16, 32)
_WHITE = 1e-4
"""Share of the power that is taken to be white. What is far weaker is not lifted: simulations are no more exact there."""


def whitening_filter(parts: Sequence[Floats]) -> Floats:
    """Return the coefficients of the filter that leaves what is new at each sample, shape (1 + order,), the first is 1."""
    n_samples = sum(part.size for part in parts)
    most = min(_ORDERS[-1], min(part.size for part in parts) - 1)
    covariance = np.zeros(most + 1)
    for part in parts:
        covariance += correlate(part, part, method="auto")[part.size - 1 : part.size + most]
    if not covariance[0] > 0.0:
        return np.ones(1)
    covariance /= covariance[0]
    covariance[0] += _WHITE
    found, least = np.ones(1), np.log(covariance[0])
    for order in (order for order in _ORDERS[1:] if order <= most):
        own = solve_toeplitz(covariance[:order], covariance[1 : order + 1])
        remainder = covariance[0] - float(own @ covariance[1 : order + 1])
        reported = np.log(remainder) + order * np.log(n_samples) / n_samples
        if reported < least:
            found, least = np.append(1.0, -own), reported
    return found


class Innovations:
    """Responses and residuals after whitening filters for the residuals of fitted equations."""

    # `followed` is the subspace of innovations that parameters and initial states could compensate.

    def __init__(self, responses: Responses) -> None:
        n_outputs = len(responses.context.rig.outputs)
        self._spans = responses.spans
        remainder = [responses.seen_remainder[span].reshape(-1, n_outputs) for span in responses.spans]
        self._filters = [whitening_filter([own[:, i] for own in remainder]) for i in range(n_outputs)]
        by_state = [self._of_record(own) for own in responses.by_state]
        self.followed = Followed.of(responses.spans, by_state, self.of(responses.by_parameter))

    def of(self, columns: Floats) -> Floats:
        """Return the innovations of weighted and stacked readings, shape (n,) or (n, m)."""
        # Zero where a record has too few previous samples.
        return np.concatenate([self._of_record(columns[span]) for span in self._spans])

    def without_free(self, columns: Floats) -> Floats:
        """Return such columns less what parameters and initial states could compensate."""
        return self.followed.without(columns)

    def _of_record(self, columns: Floats) -> Floats:
        found = np.array(columns)
        if found.size == 0:
            return found
        n_outputs = len(self._filters)
        readings = found.reshape(columns.shape[0] // n_outputs, n_outputs, *columns.shape[1:])
        for output, own in enumerate(self._filters):
            readings[:, output] = lfilter(own, [1.0], readings[:, output], axis=0)
            readings[: own.size - 1, output] = 0.0
        return found

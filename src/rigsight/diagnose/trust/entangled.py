"""Which parameters are strongly correlated, so that one compensates for the other?"""

from __future__ import annotations

import itertools

import numpy as np

from rigsight.diagnose.policy import TRUST
from rigsight.diagnose.trust.result import Entangled
from rigsight.identify import FitResult


def entangled(fit: FitResult) -> tuple[Entangled, ...]:
    """Return the pairs of parameters with correlated errors, the highest correlation first."""
    found = []
    for i, j in itertools.combinations(range(len(fit.free)), 2):
        block = fit.covariance[np.ix_([i, j], [i, j])]
        if not (np.all(np.isfinite(block)) and np.all(np.diag(block) > 0.0)):
            continue
        correlation = float(block[0, 1] / np.sqrt(block[0, 0] * block[1, 1]))
        if abs(correlation) > TRUST.correlated:
            names = fit.free[i], fit.free[j]
            found.append(Entangled(names, correlation, _text(fit, names, block, correlation)))
    return tuple(sorted(found, key=lambda pair: -abs(pair.correlation)))


def _text(fit: FitResult, names: tuple[str, str], block: np.ndarray, correlation: float) -> str:
    first, second = names
    values = np.array([fit.values[name] for name in names])
    if np.all(values != 0.0):
        relative = block / np.outer(values, values)
        alone = np.sqrt(np.diag(relative))
        sign = float(np.sign(relative[0, 1]))
        if abs(alone[1] / alone[0] - 1.0) < TRUST.one_to_one:
            together = float(np.sqrt(max(relative[0, 0] + relative[1, 1] - 2.0 * sign * relative[0, 1], 0.0)))
            what = f"ratio {first}/{second}" if sign > 0.0 else f"product {first}*{second}"
            return (
                f"{first} and {second} are determined only as the {what} ({_percent(together)}); each alone only to "
                f"{_percent(float(max(alone)))}."
            )
    freer = 1.0 / np.sqrt(max(1.0 - correlation**2, 1e-12))
    return (
        f"{first} and {second} can hardly be separated (correlation {correlation:.4f}): if one were known, the standard error of "
        f"the other would be {freer:.2g} times smaller."
    )


def _percent(share: float) -> str:
    return f"{float(f'{100.0 * share:.2g}'):g} %"

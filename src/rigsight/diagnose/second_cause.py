"""Has a second effect evidence of its own, or does it only soak up what the first one's inexact form leaves?

No form is exact on a measured rig: a sign is rounded, a spring bends a little. What that leaves goes with the same signal as the
effect itself, and many a second effect takes it up as well as a truer form of the first would. So the gain of a pair is held
against that of any other law of the first effect's own signal at the first effect's place.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rigsight.diagnose.adequacy import law_columns
from rigsight.diagnose.candidates.one_law import is_one_law
from rigsight.diagnose.places.answers import Answers, orthonormal
from rigsight.diagnose.workbench import Scored, Workbench

Floats = NDArray[np.float64]

_OTHER_FORM = 0.5
"""Share of a pair's gain that another form of its first effect may take: from a half on, that form explains more than the second."""


def with_own_evidence(bench: Workbench, singles: Sequence[Scored], pairs: Sequence[Scored]) -> list[Scored]:
    """Return the pairs whose second effect explains more than a truer form of the first would.

    Parameters
    ----------
    bench
        Records, scales and noise.
    singles
        Every effect alone, fitted and scored.
    pairs
        Fitted and scored, with the effect first that explains more by itself.
    """
    alone = {model.names[0]: model for model in singles if model.residuals and np.isfinite(model.excess)}
    forms: dict[str, tuple[Answers, Floats]] = {}

    def stands(pair: Scored) -> bool:
        single = alone.get(pair.names[0])
        # Two effects that are one law are another form of each other; they are told apart by other means.
        if single is None or not pair.residuals or is_one_law(pair):
            return True
        if pair.names[0] not in forms:
            fit = bench.problem(single.fit.structure, bench.scoring).fit(single.fit.values, [])
            answers = Answers(bench, bench.scoring, fit, single.effects, single.fit.free)
            columns = law_columns(answers, single.effects[0])
            forms[pair.names[0]] = answers, orthonormal(answers.without_free(columns))
        answers, form = forms[pair.names[0]]
        gained = single.excess**2 - pair.excess**2
        by_form = float(np.sum((form.T @ answers.left) ** 2)) / answers.n_measured
        return by_form < _OTHER_FORM * gained

    return [pair for pair in pairs if stands(pair)]

"""Has a second effect evidence of its own, or does it only soak up what the first one's inexact form leaves?

No form is exact on a measured rig: a sign is rounded, a spring bends a little. What that leaves goes with the same signal as the
effect itself, and many a second effect takes it up as well as a truer form of the first would. So what a pair gains is held
against what any other law of the first effect's own signal, at the first effect's place, would gain.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigsight.diagnose.candidates.one_law import are_one_law, is_one_law
from rigsight.diagnose.evidence import Evidence
from rigsight.diagnose.places.alternatives import law_columns
from rigsight.diagnose.places.answers import Answers, orthonormal
from rigsight.diagnose.workbench import Scored, Workbench
from rigsight.effects import Effect

_OTHER_FORM = 0.5
"""Share of a gain that another form of the first effect may take: from a half on, it explains more than the second effect."""


class OtherForms:
    """What other forms of single effects would explain of what these leave, asked once of each.

    Parameters
    ----------
    bench
        Records, scales and noise.
    lower_bound
        True if the noise floor is only a lower bound, so that nothing of a remainder can be put down to noise beforehand.
    """

    def __init__(self, bench: Workbench, lower_bound: bool) -> None:
        self._bench = bench
        self._noise = 0.0 if lower_bound else 1.0
        self._known: dict[str, float] = {}

    def gain(self, single: Scored) -> float:
        """Return by how much the mean square error of a single effect, in units of the noise floor, falls with another form."""
        (name,) = single.names
        if name not in self._known:
            answers = Answers(
                self._bench, self._bench.scoring, single.held_out, single.effects, single.fit.free
            )
            form = orthonormal(answers.without_free(law_columns(answers, single.effects[0])))
            self._known[name] = float(np.sum((form.T @ answers.left) ** 2)) / answers.n_measured
        return self._known[name]

    def partners(self, single: Scored, effects: Sequence[Effect]) -> list[Effect]:
        """Return the effects that are worth trying beside a single one.

        Where another form of it would take most of what it leaves, only those are that make one law with it.
        """
        above_noise = max(single.excess**2 - self._noise, 0.0)
        if self.gain(single) < _OTHER_FORM * above_noise:
            return list(effects)
        return [e for e in effects if are_one_law((*single.effects, e), self._bench.rig)]

    def with_own_evidence(self, singles: Sequence[Scored], pairs: Sequence[Scored]) -> list[Scored]:
        """Return the pairs whose second effect explains more than another form of the first would.

        Parameters
        ----------
        singles
            Every effect alone, fitted and scored.
        pairs
            Fitted and scored, with the effect first that explains more by itself.
        """
        alone = {model.names[0]: model for model in singles if model.residuals and np.isfinite(model.excess)}

        def stands(pair: Scored) -> bool:
            single = alone.get(pair.names[0])
            # Two effects that are one law are another form of each other; they are told apart by other means.
            if single is None or not pair.residuals or is_one_law(pair):
                return True
            return self.gain(single) < _OTHER_FORM * (single.excess**2 - pair.excess**2)

        return [pair for pair in pairs if stands(pair)]


def beyond_disturbance(
    evidence: Evidence, singles: Sequence[Scored], pairs: Sequence[Scored]
) -> list[Scored]:
    """Return the pairs that explain more than any single effect does beside a disturbance, and make nothing worse.

    A disturbance swings a rig at its resonances, and a second effect with a motion of its own follows that in each record. Where
    the form of the first is not quite right, a second that shakes the rig may soak up a slow error and leaves a fast one instead.

    Parameters
    ----------
    evidence
        Of models of these records.
    singles, pairs
        Fitted and scored.
    """
    alone = {model.names[0]: model for model in singles if model.residuals}
    if not pairs or not alone:
        return list(pairs)
    least = min(evidence.criterion(model) for model in alone.values())

    def stands(pair: Scored) -> bool:
        parts = [alone[name] for name in pair.names if name in alone]
        return evidence.criterion(pair) < least and all(evidence.gain(pair, part) > 0.0 for part in parts)

    return [pair for pair in pairs if not pair.residuals or stands(pair)]

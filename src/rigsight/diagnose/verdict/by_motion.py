"""The verdict where simulations do not decide, but the motion shows the missing force.

An observer takes away what builds up slowly, and a free run drifts with any wrong force: so the best simulation need not be that
of the true cause. Where laws err more than sensors, the force that the equations leave along the motion says more. A family that
removes the larger part of it from stretches that it was not fitted to is named, unless a model reaches the noise.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rigsight.diagnose.fitting.fit_context import FittedModel
from rigsight.diagnose.policy import FAMILIES, VERDICT
from rigsight.diagnose.verdict.families import keys_of, main_causes
from rigsight.diagnose.verdict.judgement import Judgement
from rigsight.diagnose.verdict.plausibility import stands
from rigsight.diagnose.verdict.ranking import Ranking
from rigsight.inverse import Proposal
from rigsight.rigs import Rig


def is_exact(
    judgement: Judgement,
    best: FittedModel,
    allowed: float,
    is_adequate: Callable[[FittedModel], bool],
) -> bool:
    """Return True if no cause is needed, or the best model leaves no more than noise: the simulations decide."""
    if judgement.verdict in ("none", "parameters") or best.error_over_noise <= allowed:
        return True
    return judgement.verdict == "effect" and is_adequate(best)


def by_motion(
    judgement: Judgement,
    rig: Rig,
    reidentified: FittedModel,
    ranking: Ranking,
    noise: NDArray[np.float64],
    proposal: Proposal | None,
) -> Judgement:
    """Return the judgement with the most probable family, where it is another one.

    It is more probable than not, or explains the larger part of the missing force.
    """
    if proposal is None:
        return judgement
    shares = [grounds.share for grounds in ranking.grounds]
    main = main_causes(rig, reidentified, list(zip(ranking.order, shares, strict=True)), noise, proposal)
    key = max(main, key=lambda own: main[own], default=None)
    along = {(cause.family, cause.where): cause.share for cause in proposal.alone}
    share = 0.0 if key is None else along.get(key, 0.0)
    is_probable = key is not None and main[key] >= FAMILIES.probable and share > proposal.by_chance
    if key is None or not (is_probable or share >= VERDICT.larger_part):
        return judgement
    if judgement.verdict == "effect" and key in keys_of(rig, judgement.model.effects):
        return judgement
    forms = [
        model
        for model in ranking.order
        if model.residuals
        and keys_of(rig, model.effects) == (key,)
        and stands(model, reidentified, ranking.order)
    ]
    if not forms:
        return judgement
    of_rank = {model.names: share for model, share in zip(ranking.order, shares, strict=True)}
    form = max(forms, key=lambda model: (of_rank[model.names], -model.error_over_noise))
    simulated = form.error_over_noise / reidentified.error_over_noise
    return Judgement(
        "effect",
        form,
        f"{', '.join(form.names)} explains {along[key]:.0%} of the force that the equations leave along the measured motion, on "
        f"stretches that it was not fitted to. Simulated, it leaves {simulated:.0%} of the error of the equations.",
        by_motion=True,
    )

"""From scored models to a verdict: none, parameters, effect or unknown; by simulations, or by the missing force along the motion.

If models at other places explain the same part of the gap, such as a delayed drive and a delayed sensor, only the place of the
cause is open. What a main cause leaves is the remainder: on a measured rig no law is exact, so a remainder does not refute it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from rigsight.diagnose.fit_context import FittedModel
from rigsight.diagnose.noise.block_means import squared_errors
from rigsight.diagnose.policy import FAMILIES, VERDICT
from rigsight.diagnose.verdict.families import FamilyAtPlace, Key, keys_of, main_causes
from rigsight.diagnose.verdict.ranking import Ranking
from rigsight.effects import Effect
from rigsight.inverse import MissingForce, Proposal, ProposedStart
from rigsight.records.record import Floats
from rigsight.rigs import Rig


@dataclass(frozen=True)
class MainCause:
    """The share of the re-identified gap that a model explains."""

    share: float  # of the squared gap above the noise floor
    at_least: float  # lower limit of the share in 95 % of the resamplings of the records' stretches
    # Equally good models that act at other places and explain another part of the gap.
    contradicted_by: tuple[FittedModel, ...] = ()
    # Equally good models that act at other places but explain the same part.
    equalled_by: tuple[FittedModel, ...] = ()

    @property
    def clear(self) -> bool:
        """True if the model explains more than half."""
        return self.share > VERDICT.larger_part


def main_cause(
    rig: Rig,
    reidentified: FittedModel,
    best: FittedModel,
    tied: Sequence[FittedModel],
    noise: Floats,
    rng: np.random.Generator,
) -> MainCause:
    """Determine the share of the residual of the equations that a model explains."""
    squares = squared_errors([model.residuals for model in (reidentified, best)], noise)
    gap, remainder = squares.resampled(squares.draws(rng)).T
    share = _share_of_gap(*squares.mean)
    lowest = float(
        np.quantile([_share_of_gap(g, r) for g, r in zip(gap, remainder, strict=True)], VERDICT.surely)
    )
    places = {rig.acts_at(effect) for effect in best.effects}
    elsewhere = [m for m in tied if places.isdisjoint(rig.acts_at(effect) for effect in m.effects)]
    same = [m for m in elsewhere if _common_part(reidentified, best, m, noise) > VERDICT.larger_part]
    other = [m for m in elsewhere if m not in same]
    return MainCause(share, lowest, tuple(other), tuple(same))


def _common_part(reidentified: FittedModel, one: FittedModel, other: FittedModel, noise: Floats) -> float:
    """Return the share of the squared gap explained by one model that another explains too."""
    explained = differing = 0.0
    for gap, remainder, others_left in zip(
        reidentified.residuals, one.residuals, other.residuals, strict=True
    ):
        explained += float(np.nansum(((gap - remainder) / noise) ** 2))
        differing += float(np.nansum(((others_left - remainder) / noise) ** 2))
    return 1.0 - differing / explained if explained > 0.0 else 0.0


def _share_of_gap(gap: float, remainder: float) -> float:
    return float((gap - remainder) / (gap - 1.0)) if gap > 1.0 else 0.0


def traced_to(rig: Rig, forces: Sequence[MissingForce]) -> tuple[str, ...]:
    """Return the only joint at which a missing force explains the larger part, with the drives that act along its motion."""
    # Empty where no joint does, or several of them leave about as much.
    least = min((1.0 - force.share for force in forces), default=1.0)
    agreeing = [force for force in forces if 1.0 - force.share <= VERDICT.comparable**2 * least]
    if len(forces) < 2 or len(agreeing) != 1 or agreeing[0].share < VERDICT.larger_part:
        return ()
    joint = next(joint for joint in rig.mechanism.joints if joint.name == agreeing[0].where)
    return (joint.name, *(drive.name for drive in rig.mechanism.drives if drive.along == joint.motion))


Verdict = Literal["effect", "parameters", "none", "unknown"]


@dataclass(frozen=True)
class Judgement:
    """A verdict with the model that stands for it and the reason in words."""

    verdict: Verdict
    model: FittedModel
    reason: str
    by_motion: bool = False  # whether the missing force along the motion decides, not the simulations


def most_remainder(gap: float) -> float:
    """Return the error that a named cause may leave, in units of a measured noise floor, for a gap in the same units."""
    return min(
        max(VERDICT.least_remainder, 1.0 + VERDICT.remainder_of_gap * (gap - 1.0)), VERDICT.most_remainder
    )


def judge(
    error_before: float,
    reidentified: FittedModel,
    best: FittedModel,
    is_adequate: Callable[[FittedModel], bool],
    cause: Callable[[], MainCause],
    lower_bound: bool = False,
) -> Judgement:
    """Return the verdict on the held-out errors, all in units of the noise floor."""
    at_floor = VERDICT.at_lower_bound if lower_bound else VERDICT.at_floor
    helps = best.error_over_noise * VERDICT.worthwhile < reidentified.error_over_noise
    retuned = reidentified.error_over_noise * VERDICT.worthwhile < error_before
    needs_effect = helps and reidentified.error_over_noise > VERDICT.at_floor
    # Parameters fitted to a record similar to the held-out ones may fit these by chance although no parameters fit all records.
    if not needs_effect and (error_before <= VERDICT.at_floor or (error_before <= at_floor and not retuned)):
        return Judgement("none", reidentified, "The error of the given simulation is within the noise floor.")
    if not needs_effect and reidentified.error_over_noise <= at_floor:
        if retuned:
            return Judgement(
                "parameters",
                reidentified,
                "The same equations with refitted parameters reach the noise floor.",
            )
        return Judgement(
            "none", reidentified, "The gap is too small, compared with the noise floor, to find a cause."
        )
    if not helps:
        if not is_adequate(reidentified):
            return Judgement(
                "unknown", reidentified, "No effect of the catalogue lowers the validation error."
            )
        noisy = (
            f"The error of the equations, {reidentified.error_over_noise:.3g} times the noise floor, correlates with no signal "
            f"that was tested: the noise floor is too low."
        )
        if retuned:
            return Judgement(
                "parameters", reidentified, f"{noisy} Refitted parameters explain the rest of the gap."
            )
        return Judgement("none", reidentified, noisy)
    closed = (reidentified.error_over_noise - best.error_over_noise) / (reidentified.error_over_noise - 1.0)
    floor = "the lower bound of the noise floor" if lower_bound else "the noise floor"
    allowed = VERDICT.at_lower_bound if lower_bound else most_remainder(reidentified.error_over_noise)
    nearest = f"{', '.join(best.names)} closes {closed:.0%} of the re-identified gap"
    if best.error_over_noise <= VERDICT.at_floor:
        return Judgement("effect", best, "With the effect the simulation reaches the noise floor.")
    if best.error_over_noise <= allowed and closed >= VERDICT.larger_part:
        return Judgement("effect", best, f"{nearest} and leaves {best.error_over_noise:.3g} times {floor}.")
    if is_adequate(best):
        return Judgement(
            "effect",
            best,
            f"{nearest}; its error, {best.error_over_noise:.3g} times {floor}, correlates with no signal that was tested and "
            f"counts as noise and disturbance.",
        )
    taken = cause()
    if taken.clear:
        place = " at that place"
        if taken.equalled_by:
            place = f". Effects at other places explain the same part of it ({_listed(taken.equalled_by)})"
        if taken.contradicted_by:
            place = f". Effects at other places explain as much, but another part of it ({_listed(taken.contradicted_by)})"
        return Judgement(
            "effect",
            best,
            f"{nearest}: the main cause, or the most similar effect of the catalogue{place}. It leaves "
            f"{best.error_over_noise:.3g} times {floor}, and this error still correlates with a signal of the rig.",
        )
    return Judgement(
        "unknown",
        best,
        f"The best candidate, {', '.join(best.names)}, explains {taken.share:.0%} of the squared gap (at least "
        f"{taken.at_least:.0%} with 95 % confidence): a cause that is named explains more than half.",
    )


def _listed(models: Sequence[FittedModel]) -> str:
    return "; ".join(", ".join(model.names) for model in models[:3])


def forms_of(rig: Rig, ranking: Ranking, families: Iterable[Key]) -> list[FittedModel]:
    """Return the models of just these families that can be the cause, the one with the largest share of the ranking first."""
    wanted = frozenset(families)
    forms = [
        (grounds.share, model)
        for model, grounds in zip(ranking.order, ranking.grounds, strict=True)
        if model.residuals
        and model.names not in ranking.impossible
        and frozenset(keys_of(rig, model.effects)) == wanted
    ]
    return [model for _, model in sorted(forms, key=lambda form: -form[0])]


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


def with_unseen(
    rig: Rig,
    reidentified: FittedModel,
    ranking: Ranking,
    proposal: Proposal | None,
    as_along_motion: Callable[[FittedModel, ProposedStart], FittedModel],
) -> Ranking:
    """Return the ranking with families that the motion shows and simulations do not see, at their numbers along the motion.

    No fit of such a family lowers the error of the equations. At those numbers it does not raise it, as its force is too fast to
    move the rig; or it goes by a position from which the simulation is farther than its wave is long. What is late shifts the
    whole motion: simulations see it.
    """
    if proposal is None:
        return ranking
    for cause in proposal.alone:
        forms = _of_family(rig, ranking, (cause.family, cause.where))
        alone = [m for m in forms if len(m.effects) == 1 and m.names[0] in proposal.starts]
        starts = [(proposal.starts[m.names[0]], m) for m in alone]
        is_seen = any(
            m.error_over_noise <= reidentified.error_over_noise and m.names not in ranking.impossible
            for m in forms
        )
        is_shown = cause.effect.torque is not None and cause.interval[0] >= max(
            VERDICT.larger_part, proposal.by_chance
        )
        if is_seen or not starts or not is_shown:
            continue
        start, form = min(starts, key=lambda own: own[0].unexplained)
        model = as_along_motion(form, start)
        raises = model.error_over_noise > VERDICT.worthwhile * reidentified.error_over_noise
        if model.residuals and (not raises or _loses_phase(rig, reidentified, form.effects[0], start)):
            ranking = ranking.with_model(model)
    return ranking


def _loses_phase(rig: Rig, reidentified: FittedModel, effect: Effect, start: ProposedStart) -> bool:
    """Return whether the simulated positions are so far off that the phase of a wave over the position is lost."""
    if effect.wave_number is None:
        return False
    unit = rig.units_at(rig.acts_at(effect))["x"]
    residuals = np.concatenate(reidentified.residuals)[:, [s.unit == unit for s in rig.outputs]]
    errors = np.sqrt(np.nanmean(residuals**2, axis=0))
    return bool(errors.size) and bool(np.all(start.own[effect.wave_number] * errors > FAMILIES.lost_phase))


def _of_family(rig: Rig, ranking: Ranking, key: Key) -> list[FittedModel]:
    """Return the models of a ranking with effects of one family alone."""
    return [m for m in ranking.order if m.residuals and keys_of(rig, m.effects) == (key,)]


def by_motion(
    judgement: Judgement,
    rig: Rig,
    reidentified: FittedModel,
    ranking: Ranking,
    noise: Floats,
    proposal: Proposal | None,
) -> Judgement:
    """Return the judgement with the most probable family, where it is another one."""
    # It is more probable than not, or explains the larger part of the missing force.
    if proposal is None:
        return judgement
    shares = [grounds.share for grounds in ranking.grounds]
    candidates = list(zip(ranking.order, shares, strict=True))
    main = main_causes(rig, reidentified, candidates, noise, proposal, ranking.impossible)
    key = max(main, key=lambda own: main[own], default=None)
    along = {(cause.family, cause.where): cause.share for cause in proposal.alone}
    share = 0.0 if key is None else along.get(key, 0.0)
    is_probable = key is not None and main[key] >= FAMILIES.probable and share > proposal.by_chance
    if key is None or not (is_probable or share >= VERDICT.larger_part):
        return judgement
    if judgement.verdict == "effect" and key in keys_of(rig, judgement.model.effects):
        return judgement
    forms = forms_of(rig, ranking, [key])
    if not forms:
        return judgement
    form = max(forms, key=lambda own: own.along_motion)
    simulated = form.error_over_noise / reidentified.error_over_noise
    return Judgement(
        "effect",
        form,
        f"{', '.join(form.names)} explains {along[key]:.0%} of the force that the equations leave along the measured motion, on "
        f"stretches that it was not fitted to. Simulated, it leaves {simulated:.0%} of the error of the equations.",
        by_motion=True,
    )


def with_most_probable_family(
    judgement: Judgement, rig: Rig, ranking: Ranking, families: Sequence[FamilyAtPlace]
) -> Judgement:
    """Return the judgement with the most probable family named, where the ranking alone puts another one first."""
    own = keys_of(rig, judgement.model.effects)
    if judgement.verdict != "effect" or judgement.by_motion or len(own) != 1 or not families:
        return judgement
    most = max(families, key=lambda family: family.probability)
    forms = forms_of(rig, ranking, [(most.family, most.where)])
    if (most.family, most.where) in own or not forms:
        return judgement
    form = forms[0]
    return replace(
        judgement,
        model=form,
        reason=f"{', '.join(form.names)} leaves {form.error_over_noise:.3g} times the noise floor, "
        f"{', '.join(judgement.model.names)} {judgement.model.error_over_noise:.3g} times; by the force along the motion the "
        f"former is more probable.",
    )

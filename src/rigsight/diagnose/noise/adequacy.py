"""Is the residual of a model noise and disturbance, or is it correlated with motion, drive, reading, time or record?

The residual is correlated with the responses of the outputs to small perturbations that depend on one of these: a force as a
function of a joint's velocity or position, a drive as another function of its signal, a parameter that changes with time or from
record to record. For noise and disturbance the sign of this correlation is random in every stretch, so the signs of the residual
may be flipped stretch by stretch: the p-value is the share of flips that correlate as well (randomization test). The innovations
(`innovations.py`) are used instead of the residuals, because a disturbance remains correlated for as long as the rig rings. The
perturbations follow the simulated motion, because the measured one is correlated with the disturbance itself. No noise floor is
needed, and the noise may be colored and vary in size. A second test asks whether the size of the residual depends on the motion:
an effect that no perturbation resembles, such as a varying stiffness, leaves more where there is more motion; sensor noise does
not.

References
----------
E. Flachaire, Comput. Stat. Data Anal. 49 (2005) 361, for flipping signs (the wild bootstrap with Rademacher weights). R. De
Santis, J. J. Goeman, J. Hemerik, S. Davenport and L. Finos, J. Am. Stat. Assoc. (2025), doi 10.1080/01621459.2025.2491775, for
sign flips with fitted parameters. P. H. Westfall and S. S. Young, *Resampling-Based Multiple Testing* (Wiley 1993), for the
smallest of several p-values. T. S. Breusch and A. R. Pagan, Econometrica 47 (1979) 1287, for the dependence of the size of a
residual on a variable; here by ranks.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.noise.innovations import Innovations
from rigsight.diagnose.policy import VERDICT
from rigsight.diagnose.pushes.alternatives import BY_RECORD, alternatives, slopes
from rigsight.diagnose.pushes.probes import motion_columns, signal_columns
from rigsight.diagnose.pushes.responses import Followed, Responses, orthonormal
from rigsight.records.record import Floats

_TURNS = 9999
_PORTIONS = 10
"""Turns are counted a tenth at a time, so that they need no more than some ten megabytes."""
_SINGULAR = 1e-9
"""Keeps a turn that parameters could follow whole from a division by zero."""
CONCENTRATED = "a few stretches of the records"
"""Where a residual is found that correlates with nothing and yet is not noise."""
_TOO_FAST = "motion that is too fast for the sample time"
"""What a model is blamed for whose steps between samples cannot be as short as its motion needs: nothing can be compared."""


@dataclass(frozen=True)
class Agreement:
    """Correlation of the residual of a model with one signal or cause."""

    what: str  # in words, such as ``"velocity of load_bearing"``
    place: str  # joint, drive or sensor; empty for what has no place
    p_value: float  # probability of such a correlation by chance, tested alone
    share: float  # share of the squared residual that it explains beyond chance


@dataclass(frozen=True)
class Adequacy:
    """Is the residual of a model noise and disturbance?"""

    # Probability that noise and disturbance alone correlate this well with anything that was tested.
    p_value: float
    # Signals with which it correlates, significant ones first and by decreasing share.
    agreements: tuple[Agreement, ...]
    is_spread: bool = True  # false if it is concentrated in a few stretches of the records, unlike noise
    significance: float = VERDICT.significance  # p-value below which it is not adequate

    @property
    def adequate(self) -> bool:
        """True if nothing contradicts that the residual is only noise and disturbance."""
        return self.is_spread and self.p_value >= self.significance

    @property
    def goes_with(self) -> str:
        """What the largest part of it correlates with; empty where it is adequate."""
        if self.adequate:
            return ""
        if self.p_value >= self.significance:
            return CONCENTRATED
        return self.agreements[0].what

    @property
    def place(self) -> str:
        """Joint, drive or sensor of that signal; empty where it has none."""
        return "" if self.p_value >= self.significance else self.agreements[0].place


def adequacy(
    context: FitContext,
    model: FittedModel,
    rng: np.random.Generator,
    significance: float = VERDICT.significance,
    of_steady_size: bool = False,
) -> Adequacy:
    """Test whether the residual of a model on all records is correlated with anything."""
    # Fitted records are included, because their other amplitudes show a law with a slightly wrong form. Parameters that the fit
    # distorted to compensate are free in the test, so that they do not hide it.
    records = context.records
    responses = Responses(context, records, context.on_all_records(model), model.effects, model.fit.free)
    if not responses.can_be_compared:
        return Adequacy(0.0, (Agreement(_TOO_FAST, "", 0.0, 1.0),), significance=significance)
    innovations = Innovations(responses)
    seen_remainder, new = (
        responses.seen_remainder,
        innovations.without_free(innovations.of(responses.seen_remainder)),
    )
    stretches = _stretches(responses, VERDICT.stretches)
    signs = rng.choice([-1.0, 1.0], size=(_TURNS, len(stretches)))
    found: list[tuple[Agreement, _Turned]] = []
    for what, place, columns in alternatives(responses):
        fresh = innovations.without_free(innovations.of(columns))
        reported = _turned(fresh, new, stretches, signs, innovations.followed)
        if reported is None:
            continue
        # The size is computed in the readings themselves; innovations only decide whether it is significant.
        seen = _turned(responses.without_free(columns), seen_remainder, stretches, signs)
        share = (
            0.0
            if seen is None
            else max(0.0, seen.reached - seen.mean) / float(responses.remainder @ responses.remainder)
        )
        found.append((Agreement(what, place, reported.p_value, share), reported))
    grown = _growth(responses, stretches) if of_steady_size else None
    agreements = [agreement for agreement, _ in found] + ([grown] if grown is not None else [])
    p_values = [_smallest([reported for _, reported in found])] if found else [1.0]
    p_values += [grown.p_value] if grown is not None else []
    ordered = tuple(sorted(agreements, key=lambda a: (a.p_value >= significance, -a.share)))
    return Adequacy(min(p_values), ordered, _is_spread(responses), significance)


class Checks:
    """Whether the residual of each model is noise and disturbance, tested once for each."""

    # If the equations without an effect leave more than `at_floor`, the dependence of the residual's size on the motion is
    # tested. A model that leaves more than `allowed` has the floor as evidence against it. Both are in units of the floor.

    def __init__(
        self, context: FitContext, rng: np.random.Generator, at_floor: float, allowed: float
    ) -> None:
        self._context = context
        self._at_floor = at_floor
        self._allowed = allowed
        self._rng = rng
        self._known: dict[tuple[tuple[str, ...], float], Adequacy] = {}

    def of(self, model: FittedModel) -> Adequacy:
        """Return the adequacy of a model."""
        # A model may be fitted further and then has another residual.
        own = model.names, model.fit.cost
        if own not in self._known:
            significance = (
                VERDICT.significance if model.error_over_noise <= self._allowed else VERDICT.against_a_floor
            )
            # Noise that occurs only in motion does not show that nothing is missing.
            steady = not model.effects and model.error_over_noise > self._at_floor
            self._known[own] = adequacy(self._context, model, self._rng, significance, steady)
        return self._known[own]

    def is_adequate(self, model: FittedModel) -> bool:
        """Return True if nothing contradicts that its residual is noise and disturbance."""
        return self.of(model).adequate


@dataclass(frozen=True)
class _Turned:
    """Part of the residual explained by some columns, and the same after the signs of its stretches are flipped."""

    reached: float
    by_chance: Floats

    @property
    def mean(self) -> float:
        return float(np.mean(self.by_chance))

    @property
    def p_value(self) -> float:
        return float((1.0 + np.sum(self.by_chance >= self.reached)) / (1.0 + self.by_chance.size))


def _turned(
    columns: Floats,
    remainder: Floats,
    stretches: Sequence[slice],
    signs: Floats,
    followed: Followed | None = None,
) -> _Turned | None:
    """Return how much is explained by columns after projecting out the parameters; None if none remain."""
    # The part of the residual absorbed by parameters and initial states is missing after signs are flipped, which would
    # underestimate chance: with `followed` each flip is normalized by its expected value.
    basis = orthonormal(columns)
    if basis.shape[1] == 0:
        return None
    # Their sum is that of what no parameter follows; each alone is whole, as chance would have it.
    along = np.array([remainder[part] @ basis[part] for part in stretches])
    turned = signs @ along
    sizes = np.sum(turned**2, axis=1)
    if followed is not None:
        shared = followed.along(basis, stretches)
        for some in np.array_split(np.arange(len(signs)), _PORTIONS):
            taken = np.tensordot(signs[some], shared, axes=1)
            expected = (1.0 + _SINGULAR) * np.eye(basis.shape[1]) - taken @ taken.transpose(0, 2, 1)
            whole = np.linalg.solve(expected, turned[some, :, None])[:, :, 0]
            sizes[some] = np.einsum("ij,ij->i", turned[some], whole)
    return _Turned(float(np.sum(np.sum(along, axis=0) ** 2)), sizes)


def _smallest(found: Sequence[_Turned]) -> float:
    """Return the probability that chance makes any of several p-values as small as the smallest one here."""
    table = np.array([reported.by_chance for reported in found])
    ranks = (table.shape[1] - np.argsort(np.argsort(table, axis=1), axis=1)) / (1.0 + table.shape[1])
    seen = min(reported.p_value for reported in found)
    by_chance = np.min(ranks, axis=0)
    return float((1.0 + np.sum(by_chance <= seen)) / (1.0 + by_chance.size))


def _is_spread(responses: Responses) -> bool:
    stretches = _stretches(responses, VERDICT.stretches // 2)
    powers = np.array([_power_left(responses, part) for part in _measured_in(responses, stretches)])
    return float(np.sum(powers)) ** 2 / float(np.sum(powers**2)) >= VERDICT.least_spread * powers.size


def _growth(responses: Responses, stretches: Sequence[slice]) -> Agreement | None:
    """Return the dependence of the size of the residual on the size of the motion: the most significant of several."""
    stretches = _measured_in(responses, stretches)
    remainder = [_power_left(responses, part) for part in stretches]
    rig = responses.context.rig
    moving: list[tuple[str, str, Sequence[Floats]]] = []
    for joint in motion_columns(rig):
        moving.append((f"how far {joint} moves", joint, responses.simulated(joint)))
        moving.append((f"how fast {joint} moves", joint, slopes(responses, joint)))
    for drive in signal_columns(rig):
        moving.append((f"how much {drive} drives", drive, responses.simulated(drive)))
    reported = [
        (float(spearmanr(remainder, powers, alternative="greater").pvalue), what, place)
        for what, place, signals in moving
        if np.ptp(powers := _powers(responses, signals, stretches)) > 0.0
    ]
    if not reported:
        return None
    p_value, what, place = min(reported)
    return Agreement(what, place, min(1.0, len(reported) * p_value), 1.0)


def _measured_in(responses: Responses, stretches: Sequence[slice]) -> list[slice]:
    """Return the stretches in which a sensor was recorded."""
    return [part for part in stretches if np.any(responses.is_measured[part])]


def _power_left(responses: Responses, part: slice) -> float:
    """Return the mean square of the residual of the readings that were measured."""
    return float(np.mean(responses.seen_remainder[part][responses.is_measured[part]] ** 2))


def _powers(responses: Responses, signals: Sequence[Floats], stretches: Sequence[slice]) -> list[float]:
    """Return the mean square of a signal, counted from its median, in each stretch of the stacked readings."""
    n_outputs, middle = len(responses.context.rig.outputs), float(np.median(np.concatenate(signals)))
    stacked = np.concatenate([np.repeat((signal - middle) ** 2, n_outputs) for signal in signals])
    return [float(np.mean(stacked[part])) for part in stretches]


def _stretches(responses: Responses, most: int) -> list[slice]:
    """Return stretches of about equal length that cover all records, none of which reaches from one record into the next."""
    length = max(1.0, responses.spans[-1].stop / most)
    found = []
    for part in responses.spans:
        count = max(1, round((part.stop - part.start) / length))
        edges = np.linspace(part.start, part.stop, count + 1).astype(int)
        found += [slice(int(a), int(b)) for a, b in itertools.pairwise(edges)]
    return found


@dataclass(frozen=True)
class Remainder:
    """Error of the diagnosed model above noise and disturbance."""

    # Of the squared gap of the re-identified equations; 0 where it correlates with nothing and so counts as
    # noise and disturbance.
    share: float
    # Joint, drive or sensor at which it arises; empty where it correlates with nothing, or with no place.
    where: tuple[str, ...]
    # Signal, time or record with which it correlates, or that it is concentrated in a few stretches; empty
    # where there is none.
    goes_with: str
    # Probability that noise and disturbance alone correlate this well with anything that was tested.
    p_value: float
    # True if the share is of the part that correlates: where the noise is not known, the rest may be noise.
    is_part: bool = False
    # True if the verdict names a cause: then the remaining error is in addition to it.
    beside_a_cause: bool = True

    @property
    def text(self) -> str:
        """The same in one sentence."""
        if not self.goes_with:
            return (
                f"The remaining error correlates with no motion, drive, reading, time or record that was tested (p = "
                f"{self.p_value:.2g}): it counts as noise and disturbance."
            )
        if self.share == 0.0:
            within_noise = "The remaining error is within the noise floor, but it"
            error = "A very small part of the remaining error" if self.is_part else within_noise
            return (
                f"{error} still correlates with {_in_words(self.goes_with)} (p = {self.p_value:.2g}): parameters may be off by "
                "more than their standard errors."
            )
        percent = float(f"{100.0 * self.share:.2g}")
        of_error = "A part of the remaining error" if self.is_part else "The remaining error"
        reported = f"{of_error}, {percent:g} % of the squared gap,"
        remainder = (
            f"{reported} is concentrated in {CONCENTRATED}, unlike noise"
            if self.goes_with == CONCENTRATED
            else f"{reported} still correlates with {_in_words(self.goes_with)} (p = {self.p_value:.2g})"
        )
        if self.share > VERDICT.larger_part:
            return f"{remainder}: more than half of the gap is not explained."
        if not self.beside_a_cause:
            return f"{remainder}."
        return f"{remainder}: a smaller effect is missing too, or the equation does not quite fit the rig."

    def to_json(self) -> dict[str, Any]:
        """Return the entry ``remainder`` of ``diagnosis.json``."""
        return {
            "share": self.share,
            "where": list(self.where),
            "goes_with": self.goes_with or None,
            "p_value": self.p_value,
            "text": self.text,
        }


def _in_words(goes_with: str) -> str:
    """Return the correlated signal as part of a sentence."""
    kind, _, what = goes_with.partition(BY_RECORD)
    return goes_with if kind else f"the record: {what} differs from record to record"


def remainder_of(
    reidentified: FittedModel, model: FittedModel, found: Adequacy, lower_bound: bool, beside_a_cause: bool
) -> Remainder:
    """Return the remaining error of a model."""
    if found.adequate:
        return Remainder(0.0, (), "", found.p_value, False, beside_a_cause)
    # What is concentrated in a few stretches remains whole, whatever small part correlates with something by chance.
    share = 1.0 if found.goes_with == CONCENTRATED or not found.agreements else found.agreements[0].share
    above = share * model.error_over_noise**2 if lower_bound else max(model.error_over_noise**2 - 1.0, 0.0)
    whole = (
        reidentified.error_over_noise**2
        if lower_bound
        else max(reidentified.error_over_noise**2 - 1.0, 1e-300)
    )
    where = (found.place,) if found.place else ()
    is_part = lower_bound and share < 1.0
    return Remainder(min(1.0, above / whole), where, found.goes_with, found.p_value, is_part, beside_a_cause)

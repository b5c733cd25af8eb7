"""The models between which the records do not decide: fitted again, with what the records say of their numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigsight.campaign import Campaign, with_weighed_spring
from rigsight.diagnose.fit_context import FitContext, fit_context_of, start_values_of
from rigsight.diagnose.noise.detection import noise_floors
from rigsight.diagnose.policy import FAMILIES
from rigsight.diagnose.search.horizon import restores, windowing_of
from rigsight.diagnose.search.single_effects import fit_candidate, reidentify
from rigsight.effects import Effect
from rigsight.errors import SimulationError
from rigsight.identify import Coordinates, FitResult, GreyBoxFit, IdleThreads
from rigsight.identify.fit.windows import Windowing, liveliest
from rigsight.records import Floats, Record

OLD = 8000
"""Samples of the most excited stretches of all records together that rivals are fitted to again and again. Fewer than there are
leave the rivals more freedom, so that a plan promises less."""

REACH = 0.3
"""Largest standard deviation of a drawn coordinate: a factor of 1.35 for a positive number."""


@dataclass(frozen=True)
class Named:
    """A rival as it is named: its effects, and what a diagnosis says of it."""

    effects: tuple[Effect, ...]
    probability: float | None = None
    values: Mapping[str, float] | None = None

    @property
    def label(self) -> str:
        """Names of the effects."""
        return " and ".join(effect.name for effect in self.effects) or "no effect"


@dataclass(frozen=True)
class Rival:
    """A model that was fitted to the records."""

    label: str
    fit: FitResult
    probability: float  # given the records, among the rivals
    information: Floats  # of the records on the coordinates of its free numbers; samples that repeat each other count once

    def drawn(self, scales: Mapping[str, float], rng: np.random.Generator) -> Rival:
        """Return the same with numbers drawn as far from the fitted ones as the records allow."""
        coordinates = Coordinates.of(self.fit.structure, self.fit.free, self.fit.values, scales)
        eigenvalues, vectors = np.linalg.eigh(self.information)
        # Directions that the records leave open are drawn within reach of the fit.
        spread = 1.0 / np.sqrt(np.maximum(eigenvalues, 1.0 / REACH**2))
        place = coordinates.from_values(self.fit.values) + vectors @ (
            spread * rng.standard_normal(spread.size)
        )
        p = coordinates.to_parameters(np.clip(place, coordinates.lower, coordinates.upper))
        numbers = {name: float(p[i]) for name, i in zip(self.fit.free, coordinates.index, strict=True)}
        return replace(self, fit=replace(self.fit, values={**self.fit.values, **numbers}))


@dataclass(frozen=True)
class Remainder:
    """What the best model leaves of the readings: the unit in which rivals differ."""

    floors: Mapping[str, float]
    # By output: what is left above the floor, of the standard deviation of the reading.
    shares: Mapping[str, float]
    independence: float  # samples per independent one
    samples: Floats  # the remainder in units of its RMS, shape (n_samples, n_outputs)

    def errors(self, record: Record) -> dict[str, float]:
        """Return the error to be expected of the readings in a record: laws err in proportion to the motion."""
        return {
            name: float(np.hypot(floor, self.shares[name] * np.std(record[name])))
            if name in record
            else floor
            for name, floor in self.floors.items()
        }

    def drawn(self, n_samples: int, rng: np.random.Generator) -> Floats:
        """Return noise with the spectrum of the remainder and random phases, shape (n_samples, n_outputs)."""
        # J. Theiler et al., Physica D 58 (1992) 77.
        spectrum = np.abs(np.fft.rfft(self.samples, axis=0))
        old, new = np.linspace(0.0, 1.0, spectrum.shape[0]), np.linspace(0.0, 1.0, n_samples // 2 + 1)
        lines = np.column_stack([np.interp(new, old, column) for column in spectrum.T])
        drawn = np.fft.irfft(lines * np.exp(2j * np.pi * rng.uniform(size=lines.shape)), n_samples, axis=0)
        size = np.std(drawn, axis=0)
        return np.asarray(drawn / np.where(size > 0.0, size, 1.0))


@dataclass(frozen=True)
class Contest:
    """The rivals, most probable first, with the records that they were fitted to; without any where these do not count."""

    context: FitContext
    windowing: Windowing
    records: tuple[Record, ...]
    errors: Mapping[str, float]  # of each output in these records
    remainder: Remainder
    rivals: tuple[Rival, ...]


@dataclass(frozen=True)
class Truth:
    """A rival that is taken for the truth, and the contest that its records leave."""

    contest: Contest
    rival: Rival
    weight: float  # how often it is the truth

    @property
    def index(self) -> int:
        """Its place in the contest."""
        return [one.label for one in self.contest.rivals].index(self.rival.label)

    def drawn(self, rng: np.random.Generator) -> Truth:
        """Return the same with drawn numbers."""
        rival = self.rival.drawn(self.contest.context.scales, rng)
        if self.contest.records:
            return replace(self, rival=rival)
        # Without earlier fits the numbers of the rig are where those of a first identification would be.
        numbers = {p.name: rival.fit.values[p.name] for p in self.contest.context.rig.parameters}
        rivals = [
            replace(one, fit=replace(one.fit, values={**one.fit.values, **numbers}))
            for one in self.contest.rivals
        ]
        return replace(self, rival=rival, contest=replace(self.contest, rivals=tuple(rivals)))


def prepared(campaign: Campaign) -> tuple[FitContext, Windowing]:
    """Return what rivals are fitted with, and how records are cut."""
    campaign = with_weighed_spring(campaign)
    start = start_values_of(campaign)
    drifts = campaign.drifts or not restores(campaign)
    floors = {f.output: f.std for f in noise_floors(campaign.rig, campaign.records, drifts)}
    windowing = windowing_of(campaign, floors, 1, start)[0] if drifts else Windowing()
    context = fit_context_of(campaign, floors, windowing, None, IdleThreads(1), start)
    if windowing.length is None:
        records = liveliest(context.estimation, campaign.rig, OLD)
        context = replace(context, estimation=records, scoring=records)
    return context, windowing


def contest_of(
    campaign: Campaign,
    named: Sequence[Named],
    say: Callable[[str], None],
    remainder: Remainder | None = None,
) -> Contest:
    """Fit rivals to the estimation records of a campaign; `remainder` is what the best model leaves if these do not show it."""
    context, windowing = prepared(campaign)
    alone = reidentify(context, context.start)
    fits = []
    for one in named:
        fits.append(_fit(context, one, alone.fit))
        say(one.label)
    if not all(fit.residuals for fit in fits):
        failed = next(one.label for one, fit in zip(named, fits, strict=True) if not fit.residuals)
        raise SimulationError(
            f"The rival '{failed}' cannot be simulated near the records; leave it out with --rivals."
        )
    left = _remainder(context, min(fits, key=lambda fit: fit.cost)) if remainder is None else remainder
    return _weighed(context, windowing, named, fits, left)


def _fit(context: FitContext, one: Named, alone: FitResult) -> FitResult:
    if not one.effects:
        return alone
    found = fit_candidate(context, one.effects, alone).fit
    if one.values:
        structure = found.structure
        values = {**found.values, **{n: v for n, v in one.values.items() if n in structure.names}}
        again = context.problem(structure, context.estimation).fit(values, found.free)
        found = min((found, again), key=lambda fit: fit.cost if fit.residuals else np.inf)
    return found


def _weighed(
    context: FitContext,
    windowing: Windowing,
    named: Sequence[Named],
    fits: Sequence[FitResult],
    remainder: Remainder,
) -> Contest:
    """Return the contest, with all fits in units of what the best of them leaves."""
    given = all(one.probability is not None for one in named)
    costs = [fit.cost for fit in fits]
    first = int(np.argmax([one.probability or 0.0 for one in named]) if given else np.argmin(costs))
    errors = {
        name: float(np.hypot(floor, remainder.shares[name] * np.std(_readings(context, name))))
        for name, floor in remainder.floors.items()
    }
    rivals = []
    for one, fit in zip(named, fits, strict=True):
        problem = GreyBoxFit(fit.structure, context.estimation, context.scales, errors)
        again = problem.fit(fit.values, fit.free, initial_states=fit.initial_states)
        again = again if again.residuals else fit
        normal = problem.normal_equations(again.values, again.free, again.initial_states).normal
        rivals.append(
            Rival(one.label, again, one.probability or 0.0, np.nan_to_num(normal) / remainder.independence)
        )
    if not given:
        # Schwarz's criterion; samples that repeat each other count once.
        tau, n = remainder.independence, rivals[0].fit.n_samples
        logs = np.array([-0.5 * r.fit.cost / tau - 0.5 * len(r.fit.free) * np.log(n / tau) for r in rivals])
        weights = np.exp(logs - np.max(logs))
        rivals = [replace(r, probability=float(w)) for r, w in zip(rivals, weights, strict=True)]
        first = int(np.argmax(weights))
    total = sum(rival.probability for rival in rivals)
    # The evidence itself may fail, whatever it says.
    shares = [min(max(r.probability / total, FAMILIES.failing), 1.0 - FAMILIES.failing) for r in rivals]
    rivals = [replace(r, probability=s / sum(shares)) for r, s in zip(rivals, shares, strict=True)]
    ordered = (rivals[first], *(rival for i, rival in enumerate(rivals) if i != first))
    return Contest(context, windowing, context.estimation, errors, remainder, ordered)


def _remainder(context: FitContext, fit: FitResult) -> Remainder:
    names = [signal.name for signal in context.rig.outputs]
    left = np.nan_to_num(np.concatenate(fit.residuals))
    shares = {}
    for i, name in enumerate(names):
        if name in context.noise:
            above = max(float(np.mean(left[:, i] ** 2)) - context.noise[name] ** 2, 0.0)
            shares[name] = float(np.sqrt(above) / (np.std(_readings(context, name)) or 1.0))
    size = np.std(left, axis=0)
    samples = (left - np.mean(left, axis=0)) / np.where(size > 0.0, size, 1.0)
    # The output that repeats itself most decides.
    independence = max(_independence(column) for column in samples.T)
    return Remainder({n: context.noise[n] for n in shares}, shares, independence, samples)


def _readings(context: FitContext, name: str) -> Floats:
    return np.concatenate([r[name] for r in context.estimation if name in r] or [np.zeros(1)])


def _independence(samples: Floats) -> float:
    """Return the samples per independent one: the sum of the correlations up to the first that is negative."""
    n = samples.size
    spectrum = np.abs(np.fft.rfft(samples, 2 * n)) ** 2
    correlation = np.fft.irfft(spectrum)[:n]
    if correlation[0] <= 0.0:
        return 1.0
    correlation = correlation / correlation[0]
    below = np.flatnonzero(correlation < 0.0)
    return float(max(1.0, 2.0 * np.sum(correlation[: below[0] if below.size else n]) - 1.0))

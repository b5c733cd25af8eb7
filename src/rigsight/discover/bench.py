"""What does a support of terms explain? It is polished by output error and scored by free runs of records it has not seen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from rigsight.discover.hysteresis import is_loop
from rigsight.discover.library import Candidate
from rigsight.discover.regression import Projected
from rigsight.errors import SimulationError
from rigsight.identify import DEFAULT_ACCURACY, FitResult, GreyBoxFit
from rigsight.records.record import Record
from rigsight.rigs import Rig
from rigsight.simulate import (
    Structure,
    carried_over,
    compose,
    parameter_vector,
    record_input,
    simulate_outputs,
)

Support = frozenset[str]
_EVALUATIONS = 40
_FIRST_EVALUATIONS = 12
_HOPELESS = 10.0
"""Factor over the best RMS so far at which a support is given up after the first evaluations."""
_COARSEST = 1e-2
"""Accuracy of the simulations that a polish starts with, relative to the motion: a start is further off than that."""
_UNSEEN = 0.03
"""Error of the simulations as a share of what a fit leaves: as power, a thousandth."""
_NEAR = 10.0
"""Noise floors left below which simulations are as accurate as in any other fit: terms are decided there."""
_FINER = 0.5
"""Factor by which the accuracy must fall behind what a fit leaves for the fit to go on with finer steps."""
_TOLERANCE_OF_ACCURACY = 0.1
"""Relative change of the cost at which a fit stops, per accuracy of its simulations: a smaller gain is within their error."""
_SMALL = 1e-3
_HARDLY = 1e-2
"""Share of what the regression gives a term with which the term is hardly there, and yet larger than rounding."""


@dataclass(frozen=True, eq=False)
class Trial:
    """One polished support with its held-out score.

    Attributes
    ----------
    support
        Names of the effects.
    fit
        Output-error fit to the estimation records.
    excess
        RMS of the first output's held-out free-run error in units of the noise floor.
    residuals
        Held-out errors of the first output in units of the noise floor, all records one after the other.
    """

    support: Support
    fit: FitResult
    excess: float
    residuals: NDArray[np.float64]

    @property
    def n_free(self) -> int:
        """Number of fitted parameters."""
        return len(self.fit.free)


@dataclass(frozen=True, eq=False)
class Bench:
    """What every support is polished and scored with.

    Attributes
    ----------
    rig
        The rig.
    estimation, held_out
        Records to fit and records to score.
    values
        Constants, and linear parameters as start values.
    scales, noise
        Size of each base quantity, noise floor of each output.
    held
        Parameters of the rig that no fit moves.
    candidates
        The library, by name.
    projected
        The regression.
    own_terms
        Columns of the rig's own terms that compete (full form), by parameter.
    trials
        What has been polished.
    """

    rig: Rig
    estimation: tuple[Record, ...]
    held_out: tuple[Record, ...]
    values: Mapping[str, float]
    scales: Mapping[str, float]
    noise: Mapping[str, float]
    held: frozenset[str]
    candidates: Mapping[str, Candidate]
    projected: Projected
    own_terms: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    trials: dict[tuple[Support, Support, Support], Trial] = field(default_factory=dict)

    @property
    def sparse(self) -> Projected:
        """The regression with nothing projected out that competes."""
        if not self.own_terms:
            return self.projected
        kept = [
            i
            for i in range(self.projected.base.shape[1])
            if not any(
                np.array_equal(self.projected.base[:, i], column) for column in self.own_terms.values()
            )
        ]
        return replace(self.projected, base=self.projected.base[:, kept])

    def column(self, name: str) -> NDArray[np.float64]:
        """Return the column of a term, one of the library or of the rig's own."""
        return self.own_terms[name] if name in self.own_terms else self.candidates[name].column

    def structure(self, support: Support, release: frozenset[str] = frozenset()) -> Structure:
        """Return the equations of a support; special values of its effects are written in unless released."""
        effects = [self.candidates[name].effect for name in sorted(support)]
        fixed = {
            name: value
            for effect in effects
            for name, value in effect.special_cases.items()
            if name not in release and self.candidates[effect.name].inner.get(name, value) == value
        }
        return compose(self.rig, effects, fixed)

    def free_parameters(self, structure: Structure, held: frozenset[str] = frozenset()) -> list[str]:
        """Return what a fit of a structure moves."""
        fixed = dict(structure.fixed)
        names = {p.name for p in self.rig.parameters} - self.held - held
        for effect in structure.effects:
            for parameter in effect.parameters:
                name = structure.parameter_name(effect, parameter.name)
                if parameter.fitted and name not in fixed:
                    names.add(name)
        return [name for name in structure.names if name in names]

    def start(self, structure: Structure, support: Support) -> dict[str, float]:
        """Return the values that the regression gives a support, in SI."""
        chosen = [self.candidates[name] for name in sorted(support)]
        columns = (
            np.column_stack([c.column for c in chosen])
            if chosen
            else np.zeros((self.projected.target.size, 0))
        )
        solution, _ = self.projected.solved(columns)
        values, force = _rig_values(self.rig, self.values, solution[: self.projected.base.shape[1]])
        for candidate, coefficient in zip(
            chosen, solution[self.projected.base.shape[1] :] * force, strict=True
        ):
            values |= self._effect_values(structure, candidate, float(coefficient), values)
        bounds = {p.name: p for p in structure.parameters}
        return {
            name: float(np.clip(value, bounds[name].lower, bounds[name].upper))
            for name, value in values.items()
            if name in bounds
        }

    def _effect_values(
        self, structure: Structure, candidate: Candidate, coefficient: float, values: Mapping[str, float]
    ) -> dict[str, float]:
        effect = candidate.effect
        own = {p.name: p.default for p in effect.parameters if p.default is not None}
        own |= candidate.inner
        own |= {name: share * coefficient for name, share in candidate.linear.items()}
        found: dict[str, float] = {}
        if is_loop(effect):
            assert effect.elastic_share is not None
            stiffness = self.rig.motion.stiffness.name
            without = max(values[stiffness], _SMALL * coefficient)
            total = without + max(coefficient, _SMALL * without)
            found[stiffness] = total
            own[effect.elastic_share] = without / total
        for parameter in effect.parameters:
            if parameter.name in candidate.linear and parameter.lower == 0.0:
                # A resisting force that the regression turns round is one that is hardly there.
                own[parameter.name] = max(own[parameter.name], _SMALL * abs(own[parameter.name]))
            if parameter.name in own:
                found[structure.parameter_name(effect, parameter.name)] = own[parameter.name]
        return found

    def trial(
        self,
        support: Support,
        release: Support = frozenset(),
        start: Mapping[str, float] | None = None,
        left_out: Support = frozenset(),
    ) -> Trial:
        """Polish a support and score it; what has been done is not done again.

        Parameters
        ----------
        support
            Names of the effects.
        release
            Parameters that are not to be held at their special values.
        start
            Values to start from; default are those of the regression.
        left_out
            Rig parameters that stay where `start` has them.
        """
        key = support, release, left_out
        if key not in self.trials:
            structure = self.structure(support, release)
            values = self.start(structure, support) if start is None else start
            self.trials[key] = self._polished(support, structure, [values], left_out)
        return self.trials[key]

    def trial_near(self, support: Support, neighbor: Trial) -> Trial:
        """Polish a support from where one with a term more or less ended, and from the regression's values if never done so.

        The regression's values may lie far off the motion as soon as terms are alike; those of a neighbor do not.
        """
        own = {name for n in support & neighbor.support for name in self.candidates[n].effect.special_cases}
        release = frozenset(own - {name for name, _ in neighbor.fit.structure.fixed})
        key = support, release, frozenset[str]()
        before = self.trials.get(key)
        structure = self.structure(support, release)
        values = self.start(structure, support)
        starts = [_beside(structure, values, neighbor), *([values] if before is None else [])]
        again = self._polished(support, structure, starts, frozenset())
        if before is None or again.excess < before.excess:
            self.trials[key] = again
        return self.trials[key]

    def hopeless(self, fit: FitResult) -> bool:
        """Return True for a fit so much worse than the best so far that more evaluations or a parameter more cannot make up."""
        best = min((trial.fit.cost for trial in self.trials.values()), default=float("inf"))
        return not fit.cost < _HOPELESS**2 * best

    def _polished(
        self, support: Support, structure: Structure, starts: Sequence[Mapping[str, float]], left_out: Support
    ) -> Trial:
        fit = self._fitted(structure, starts, self.free_parameters(structure, left_out))
        return self.scored(support, fit, self._unseen(fit))

    def _fitted(
        self, structure: Structure, starts: Sequence[Mapping[str, float]], free: list[str]
    ) -> FitResult:
        """Fit the estimation records from the better start, with steps as coarse as what is still left allows."""

        def go_on(
            values: Mapping[str, float],
            states: tuple[NDArray[np.float64], ...] | None,
            error: float,
            evaluations: int,
        ) -> FitResult:
            accuracy = self._accuracies(self.estimation, error)
            return GreyBoxFit(structure, self.estimation, self.scales, self.noise, accuracy).fit(
                values,
                free,
                states,
                max_evaluations=evaluations,
                tolerance=_TOLERANCE_OF_ACCURACY * min(accuracy),
                finish=False,
            )

        # Where a start is near already, coarse steps would lead away from it: sliders let go at other turns of the motion.
        errors = [self._unseen(go_on(start, None, float("inf"), 1)) for start in starts]
        first = [
            go_on(start, None, error, _FIRST_EVALUATIONS) for start, error in zip(starts, errors, strict=True)
        ]
        best = int(np.argmin([found.cost for found in first]))
        fit, error = first[best], errors[best]
        left = _EVALUATIONS - _FIRST_EVALUATIONS
        while left > 0 and not self.hopeless(fit):
            finer = self._unseen(fit)
            before, after = (min(self._accuracies(self.estimation, e)) for e in (error, finer))
            if fit.success and after > _FINER * before:
                break
            error = min(error, finer)
            fit = go_on(fit.values, fit.initial_states, error, left)
            left -= fit.n_evaluations
        return fit

    def _unseen(self, fit: FitResult) -> float:
        """Return the error of the first output that is lost in what a fit leaves, none near the noise."""
        left = float(np.sqrt(fit.cost / fit.n_samples))
        return _UNSEEN * left * self.noise[self.rig.outputs[0].name] if left > _NEAR else 0.0

    def _accuracies(self, records: Sequence[Record], error: float) -> list[float]:
        """Return the accuracies, relative to the motion of each record, with which simulations err by no more than this."""
        sizes = [float(np.std(record[self.rig.outputs[0].name])) or 1.0 for record in records]
        return [float(np.clip(error / size, DEFAULT_ACCURACY, _COARSEST)) for size in sizes]

    def scored(self, support: Support, fit: FitResult, error: float = 0.0) -> Trial:
        """Simulate the held-out records with a fit; only their initial states are estimated, by simulations that may err."""
        failed = Trial(support, fit, float("inf"), np.zeros(0))
        if not np.isfinite(fit.cost):
            return failed
        accuracy = self._accuracies(self.held_out, error)
        score = GreyBoxFit(fit.structure, self.held_out, self.scales, self.noise, accuracy).fit(
            fit.values, [], tolerance=_TOLERANCE_OF_ACCURACY * min(accuracy), finish=False
        )
        if not np.isfinite(score.cost):
            return failed
        try:
            simulated = [
                self._simulated(score, record, state)
                for record, state in zip(self.held_out, score.initial_states, strict=True)
            ]
        except SimulationError:
            return failed
        output = self.rig.outputs[0].name
        measured = np.concatenate([record[output] for record in self.held_out])
        errors = (measured - np.concatenate(simulated)) / self.noise[output]
        return Trial(support, fit, float(np.sqrt(np.mean(errors**2))), errors)

    def _simulated(self, fit: FitResult, record: Record, state: NDArray[np.float64]) -> NDArray[np.float64]:
        p = parameter_vector(fit.structure, fit.values)
        held = record_input(fit.structure, record)
        return simulate_outputs(fit.structure, held, p, state, record.n_samples, DEFAULT_ACCURACY)[:, 0]


def _beside(structure: Structure, values: Mapping[str, float], neighbor: Trial) -> dict[str, float]:
    """Return the values of a neighbor; terms that it lacks have those given, moved to where they almost vanish."""
    found = {**values, **carried_over(neighbor.fit.values, neighbor.fit.structure, structure)}
    for effect in structure.effects:
        if effect.name not in neighbor.support:
            for parameter in effect.parameters:
                name = structure.parameter_name(effect, parameter.name)
                if parameter.null is not None and name in found:
                    found[name] = parameter.null + _HARDLY * (values[name] - parameter.null)
    return found


def _rig_values(
    rig: Rig, known: Mapping[str, float], base: NDArray[np.float64]
) -> tuple[dict[str, float], float]:
    """Return the rig's parameters from the coefficients of its own terms, and the force per unit of the others'."""
    values = dict(known)
    motion = rig.motion
    if not rig.is_driven:
        values |= {motion.damping.name: base[0], motion.stiffness.name: base[1], motion.bias.name: base[2]}
        return values, 1.0
    gain = float(motion.drive_gain.subs({s: known[s.name] for s in motion.drive_gain.free_symbols}))
    assert motion.inertia is not None
    inertia = gain / base[0] if base[0] * gain > 0.0 else known[motion.inertia.name]
    values[motion.inertia.name] = inertia
    values[motion.damping.name] = max(base[1] * inertia, 1e-4 * known[motion.damping.name])
    if len(base) == 4:
        stiffness = max(base[2] * inertia, 1e-3 * known[motion.stiffness.name])
        values[motion.stiffness.name] = stiffness
        values[motion.rest.name] = known[motion.rest.name] + base[3] * inertia / stiffness
    else:
        for symbol in motion.bias.free_symbols:
            values[symbol.name] = base[2] * inertia
    return values, inertia

"""Screening: how much of the residual of the equations would each effect at each place explain?

Each effect is simulated alone, from each of its declared starts, along the measured motion. The resulting force, drive or reading
is applied to the re-identified equations at its place as a known perturbation. Those that correlate best with the residual, to
first order, are fitted; only their size, the parameters of the rig and the initial states are free. A single kernel serves all
candidates; only the law of each effect itself is compiled.

References
----------
L. Ljung, *System Identification* (Prentice Hall 1999), section 16.4, for judging extensions of a model by what goes with its
residual.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.policy import SEARCH, VERDICT
from rigsight.diagnose.pushes.probes import (
    PUSH_SIZE,
    STIFFNESS,
    alone,
    controller_columns,
    load_columns,
    motion_columns,
    push,
    sees_load,
    way_columns,
    with_probes,
)
from rigsight.diagnose.pushes.responses import Responses
from rigsight.diagnose.search.starts import start_values
from rigsight.effects import Effect, Place, kind_of, placed_dimension
from rigsight.effects import symbols as canonical
from rigsight.identify import FitResult
from rigsight.inverse.controller_output import ControllerSignals, changed_output, limits_of
from rigsight.records.record import Floats, Record
from rigsight.rigs import Rig, evaluated, joint_of
from rigsight.simulate import Structure, Substeps, compose, record_input, simulate_sets
from rigsight.simulate.prescribed_motion import smooth_motion
from rigsight.units import characteristic_value

_SMALL = 0.1
"""Size of a push whose answer is taken to be proportional to it, in units of what the effect itself would be."""
_TOLERANCE = 1e-3


@dataclass(frozen=True)
class Suspect:
    """An effect at a place, and the share of the squared residual that a push of its form explains."""

    effect: Effect
    share: float  # share explained by the best of its pushes
    # Values of its own parameters for a push of that form and size; empty where there are none.
    values: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Response:
    """Change of all readings with an effect, to first order."""

    effect: Effect
    values: Mapping[str, float]  # values of its own parameters
    # Change of the readings, weighted and stacked, after projecting out parameters and initial states, shape
    # (n,).
    column: Floats


@dataclass(frozen=True)
class _Push:
    """A force, drive signal or reading of the form that an effect has at one of its starts."""

    own: Mapping[str, float]  # values of the effect's own parameters
    signals: Sequence[Floats]  # along each record
    factor: float  # by which it explains most
    explained: float  # squared residual that it explains then, to first order

    def values_of(self, effect: Effect) -> dict[str, float]:
        """Return the values of the effect's own parameters at that size."""
        return scaled(effect, self.own, self.factor) or _fitted_values(effect, self.own)


class Shortlist:
    """The re-identified equations along the records, or along their liveliest stretches, and their responses to pushes."""

    def __init__(self, context: FitContext, model: FittedModel, liveliest: bool = False) -> None:
        records, fit = context.estimation, model.fit
        if liveliest:
            in_stretches = context.problem(fit.structure, context.look).fit(fit.values, [])
            if in_stretches.residuals:
                records, fit = context.look, in_stretches
        self._free = model.fit.free
        self._responses = Responses(context, records, fit, model.effects, self._free)
        self._context = replace(self._responses.context, scales=self._responses.scales)
        self._fit = fit
        self._cost = fit.cost
        if liveliest:
            # Parameters fitted to all records need not fit stretches of them: the gain of refitting must not count for a push.
            self._cost = min(self._cost, self._pushed(self._responses.records, self._free, 0.0).cost)
        # Known before threads ask for them side by side.
        _ = self._responses.remainder, self._responses.motions

    def suspects(self, effects: Sequence[Effect]) -> list[Suspect]:
        """Return the share that each effect explains, in their order."""
        if not self._responses.can_be_compared:
            return [Suspect(effect, 0.0) for effect in effects]
        # To first order; for those near the best, pushes are fitted.
        pushes = list(self._context.threads.side_by_side(self._pushes, list(effects)))
        whole = max(float(self._responses.remainder @ self._responses.remainder), np.finfo(np.float64).tiny)
        shares = [max((push.explained for push in own), default=0.0) / whole for own in pushes]
        enough = VERDICT.larger_part * max(shares, default=0.0)

        def one(i: int) -> Suspect:
            if shares[i] >= enough:
                return self._suspect(effects[i], pushes[i])
            return Suspect(effects[i], shares[i], pushes[i][0].values_of(effects[i]) if pushes[i] else {})

        return list(self._context.threads.side_by_side(one, range(len(effects))))

    @property
    def remainder(self) -> Floats:
        """Residual of the equations, weighted and stacked, after projecting out parameters and initial states, shape (n,)."""
        return self._responses.remainder

    def responses(self, effects: Sequence[Effect]) -> list[Response]:
        """Return the response to each effect from each of its starts; those that are not finite or zero are left out."""

        def of_effect(effect: Effect) -> list[Response]:
            if not effect.is_push:
                formed, columns = self._starts(effect), self._in_the_equations(effect)
            else:
                signals, columns = self._pushed_columns(effect)
                formed = [own for own, _ in signals]
            return [
                Response(effect, own, column)
                for own, column in zip(formed, columns.T, strict=True)
                if np.all(np.isfinite(column)) and np.any(column)
            ]

        found = self._context.threads.side_by_side(of_effect, list(effects))
        return list(itertools.chain.from_iterable(found))

    def _in_the_equations(self, effect: Effect) -> Floats:
        """Return the response to an effect that no push represents, from each of its starts, shape (n, n_starts)."""
        columns = []
        for own in self._starts(effect):
            small = {p.name: p.grown(own[p.name], _SMALL) for p in effect.parameters}
            columns.append(self._responses.to_effect(effect, small) / _SMALL)
        return self._responses.without_free(np.column_stack(columns))

    def _pushed_columns(self, effect: Effect) -> tuple[list[tuple[dict[str, float], list[Floats]]], Floats]:
        """Return the pushes of an effect from its starts, and the responses to them, shape (n, n_starts)."""
        place = self._context.rig.acts_at(effect)
        formed = [
            (own, [self._signed(place, signal) for signal in signals])
            for own, signals in self._signals(effect)
        ]
        columns = [self._responses.to_push(place, signals, _SMALL) for _, signals in formed]
        return formed, self._responses.without_free(np.column_stack(columns)) if columns else np.zeros((1, 0))

    def _pushes(self, effect: Effect) -> list[_Push]:
        """Return the pushes of an effect that explain most of the residual to first order, best first."""
        formed, columns = self._pushed_columns(effect)
        size = np.einsum("ij,ij->j", columns, columns)
        usable = np.flatnonzero(np.isfinite(size) & (size > 0.0))
        along = {int(i): float(columns[:, i] @ self._responses.remainder) for i in usable}
        found = [_Push(*formed[i], along[i] / size[i], along[i] ** 2 / size[i]) for i in along]
        return sorted(found, key=lambda push: -push.explained)[: SEARCH.fitted_pushes]

    def _suspect(self, effect: Effect, pushes: Sequence[_Push]) -> Suspect:
        place = self._context.rig.acts_at(effect)
        found = [(*self._fitted_share(place, push.signals, push.factor), push) for push in pushes]
        if not found:
            return Suspect(effect, 0.0)
        share, factor, push = max(found, key=lambda one: one[0])
        return Suspect(effect, share, replace(push, factor=factor).values_of(effect))

    def _fitted_share(self, place: str, signals: Sequence[Floats], push_size: float) -> tuple[float, float]:
        """Return the reduction of the cost when a push of this form, the parameters and the initial states are fitted."""
        # With it the size of the push.
        records = [
            record.with_signals(**{push(place): signal})
            for record, signal in zip(self._responses.records, signals, strict=True)
        ]
        fit = self._pushed(records, [*self._free, PUSH_SIZE], push_size)
        share = max(0.0, 1.0 - fit.cost / self._cost) if np.isfinite(fit.cost) else 0.0
        return share, fit.values[PUSH_SIZE]

    def _pushed(self, records: Sequence[Record], free: Sequence[str], push_size: float) -> FitResult:
        return self._context.problem(self._responses.structure, records).fit(
            {**self._responses.values, PUSH_SIZE: push_size},
            free,
            self._responses.fitted_states,
            SEARCH.push_evaluations,
            _TOLERANCE,
            False,
            self._fit.substeps,
        )

    def _signals(self, effect: Effect) -> list[tuple[dict[str, float], list[Floats]]]:
        """Return the signal that an effect alone adds along each record, from each of its starts, with its own values there."""
        place = self._context.rig.acts_at(effect)
        if _is_late(effect):
            (delay,) = effect.parameters
            return [({delay.name: time}, self._late(place, time)) for time in self._times(effect)]
        if effect.place is Place.CONTROLLER:
            return [(own, self._controlled(effect, own)) for own in self._starts(effect)]
        structure, column = alone(effect)
        of_joint = STIFFNESS in structure.names
        starts = self._starts(effect)
        p = np.array([[start[name] for name in structure.names] for start in starts]).T
        x0 = np.zeros((max(1, len(structure.states)), p.shape[1]))
        found: list[list[Floats]] = [[] for _ in starts]
        for i, (record, seen) in enumerate(
            zip(self._responses.records, self._responses.seen(place), strict=True)
        ):
            signals = (seen, *self._beside(place, effect, i))
            named = dict(zip((source.name for source in structure.rig.inputs), signals, strict=True))
            moved = Record(record.name, record.dt, named, {}, hold=record.hold)
            held = record_input(structure, moved)
            with np.errstate(all="ignore"):
                out = simulate_sets(structure, held, p, x0, record.n_samples, Substeps(SEARCH.push_substeps))[
                    :, column
                ]
            without = (
                smooth_motion(seen, record.dt)[0][:, None] * p[structure.names.index(STIFFNESS)]
                if of_joint
                else seen[:, None]
            )
            for own, added in zip(found, (out - without).T, strict=True):
                own.append(added)
        return [
            (own, signals)
            for own, signals in zip(starts, found, strict=True)
            if all(np.all(np.isfinite(added)) for added in signals)
        ]

    def _controlled(self, effect: Effect, own: Mapping[str, float]) -> list[Floats]:
        """Return what an effect of a controller adds to the signal of its drive along each record."""
        rig, found = self._context.rig, []
        drive = rig.acts_at(effect)
        numbers = {p.name: own[p.name] for p in effect.parameters}
        for record, out in zip(self._responses.records, self._responses.calm_outputs, strict=True):
            signals = ControllerSignals(*out[:, list(controller_columns(rig)[drive])].T)
            limits = limits_of(rig.controllers[drive], {**self._responses.values, **record.constants})
            changed = changed_output(effect, numbers, signals, record.dt)
            found.append(limits(changed) - limits(signals.output))
        return found

    def _beside(self, place: str, effect: Effect, index: int) -> list[Floats]:
        """Return what else an effect sees: the load of its joint, the way along which its drive pushes."""
        rig, out = self._context.rig, self._responses.calm_outputs[index]
        if effect.place is Place.ACTUATOR and effect.reads(canonical.v):
            return [out[:, way_columns(rig)[place]]]
        return [out[:, load_columns(rig)[place]]] if sees_load(effect) else []

    def _starts(self, effect: Effect) -> list[dict[str, float]]:
        """Return start values of the effect's own parameters, with the stiffness of its joint."""
        context = self._context
        composed = context.simplest((effect,))
        declared = [
            composed.values_of(effect, start)
            for start in start_values(context, composed, effect, self._fit, {})
        ]
        stiffness = evaluated(joint_of(context.rig, effect).stiffness, self._responses.values)
        inner = [p.name for p in effect.parameters if p.fitted and p.null is None]
        return [
            {
                **own,
                **effect.special_cases,
                **{n: factor * own[n] for n in inner if n in own},
                STIFFNESS: stiffness,
            }
            for own in declared
            for factor in (SEARCH.wider_starts if inner and len(declared) <= SEARCH.few_starts else (1.0,))
        ]

    def _times(self, effect: Effect) -> list[float]:
        (delay,) = effect.parameters
        size = characteristic_value(placed_dimension(effect, delay.dimension), self._context.scales)
        return [size * start for start in delay.starts]

    def _late(self, place: str, time: float) -> list[Floats]:
        found = []
        for record, seen in zip(self._responses.records, self._responses.seen(place), strict=True):
            t = record.dt * np.arange(record.n_samples)
            found.append(np.interp(t - time, t, seen) - seen)
        return found

    def _signed(self, place: str, signal: Floats) -> Floats:
        """Return a signal as a push: what an effect adds at a joint resists the motion."""
        return -signal if place in motion_columns(self._context.rig) else signal


def scaled(effect: Effect, own: Mapping[str, float], factor: float) -> dict[str, float]:
    """Return own values of an effect with a push scaled by a factor; empty if the effect cannot have that size."""
    # Where an effect is absent at a value of a parameter, its force grows with the distance from there. A push the other way is
    # the same effect only where its parameters may have that sign: a spring may soften, a friction cannot drive.
    if factor == 0.0:
        return {}
    values = _fitted_values(effect, own)
    fitted = [p for p in effect.parameters if p.name in values]
    grown = {p.name: p.grown(values[p.name], factor) for p in fitted}
    return grown if all(p.lower <= grown[p.name] <= p.upper for p in fitted) else {}


def _fitted_values(effect: Effect, own: Mapping[str, float]) -> dict[str, float]:
    return {p.name: own[p.name] for p in effect.parameters if p.fitted and p.name in own}


def structures_of_shortlist(
    rig: Rig, effects: Iterable[Effect], modelled: tuple[Effect, ...] = ()
) -> list[Structure]:
    """Return the structures that are simulated to find the place of an effect, each once.

    Parameters
    ----------
    rig
        The rig.
    effects
        Candidates at their places.
    modelled
        Effects that the simulation has already.
    """
    by_themselves = {
        kind_of(effect.name): alone(effect)[0]
        for effect in effects
        if effect.pulsation is None
        and effect.wave_number is None
        and effect.is_push
        and effect.place is not Place.CONTROLLER
        and not _is_late(effect)
    }
    return [compose(with_probes(rig), modelled), *by_themselves.values()]


def _is_late(effect: Effect) -> bool:
    return effect.delay is not None or effect.reading_delay is not None

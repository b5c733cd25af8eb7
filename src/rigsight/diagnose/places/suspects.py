"""Where, before which: how much of what the equations leave would each effect at each place take away?

Each effect is simulated by itself, from each of its declared starts, along the motion that the records show. The force, the drive
or the reading that comes out is a known push on the re-identified equations at its place. Of these pushes those that go best with
what the equations leave, to first order, are fitted: their size, the rig's parameters and the initial states move, no more. One
kernel serves all of them, and nothing of a candidate but its law alone is compiled.

References
----------
L. Ljung, *System Identification* (Prentice Hall 1999), section 16.4, for judging extensions of a model by what goes with its
residual.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rigsight.diagnose.candidates.starts import start_values
from rigsight.diagnose.places.measured_motion import Corrections
from rigsight.diagnose.places.probes import (
    PUSH_SIZE,
    STIFFNESS,
    alone,
    motion_columns,
    push,
    signal_columns,
    with_probes,
)
from rigsight.diagnose.workbench import Scored, Workbench
from rigsight.effects import Effect, Place, kind_of, placed_dimension
from rigsight.records.record import Record
from rigsight.rigs import Rig, evaluated, joint_of
from rigsight.simulate import Structure, Substeps, compose, record_input, simulate_sets
from rigsight.simulate.prescribed_motion import smooth_motion
from rigsight.units import characteristic_value

Floats = NDArray[np.float64]

_SMALL = 0.1
"""Size of a push whose answer is taken to be proportional to it, in units of what the effect itself would be."""
_STEP = 1e-3
"""Relative change of a parameter whose answer is taken by differences."""
_WIDER = (1.0 / 3.0, 1.0, 3.0)
"""Factors on an effect's inner numbers beside its declared starts: a fit would move on from these, a push cannot."""
_FEW = 4
"""Declared starts up to which the wider ones are tried: more of them span their range by themselves."""
_FITTED = 2
"""Pushes of each effect that are fitted, of all its starts."""
_EVALUATIONS = 6
_TOLERANCE = 1e-3
_SUBSTEPS = 4
_DEPENDENT = 1e-9


@dataclass(frozen=True)
class Suspect:
    """An effect at a place, and the share of the squared residual that a push of its form takes away."""

    effect: Effect
    share: float


class Lineup:
    """The re-identified equations along the records, and what pushes at every place do to them.

    Parameters
    ----------
    bench
        Records, scales and noise.
    model
        The equations that leave something, fitted.
    """

    def __init__(self, bench: Workbench, model: Scored) -> None:
        self._bench = replace(bench, memory=None)
        self._fit = model.fit
        rig = bench.rig
        self._structure = compose(with_probes(rig), (*bench.modelled, *model.effects))
        self._values = {**model.fit.values, **dict(model.fit.structure.fixed), PUSH_SIZE: 1.0}
        self._p = np.array([self._values[name] for name in self._structure.names])
        own = model.fit.structure.states
        order = [own.index(state) for state in self._structure.states]
        self._first = [state[order] for state in model.fit.initial_states]
        self._n_outputs = len(rig.outputs)
        self._records = [self._calm(record) for record in bench.estimation]
        self._calm_outputs = [self._outputs(i, record) for i, record in enumerate(self._records)]
        outputs = [signal.name for signal in rig.outputs]
        self._weights = [
            np.array([1.0 / bench.noise[name] if name in record else 0.0 for name in outputs])
            for record in bench.estimation
        ]
        self._residuals = [np.nan_to_num(residual) for residual in model.fit.residuals]
        self._motions = self._joint_motions()
        self._free = _basis(np.column_stack([self._stacked(column) for column in self._free_answers()]))
        self._left = self._without_free(self._stacked(self._residuals))

    def suspects(self, effects: Sequence[Effect]) -> list[Suspect]:
        """Return what each effect takes away, in their order."""
        return list(self._bench.threads.side_by_side(self._suspect, list(effects)))

    def _suspect(self, effect: Effect) -> Suspect:
        place = self._bench.rig.acts_at(effect)
        pushes = [[self._signed(place, signal) for signal in signals] for signals in self._signals(effect)]
        answers = [self._answer(place, signals) for signals in pushes]
        columns = self._without_free(np.column_stack(answers)) if answers else np.zeros((1, 0))
        size = np.einsum("ij,ij->j", columns, columns)
        usable = np.flatnonzero(np.isfinite(size) & (size > 0.0))
        along = {int(i): float(columns[:, i] @ self._left) for i in usable}
        best = sorted(along, key=lambda i: -(along[i] ** 2) / size[i])[:_FITTED]
        shares = [self._fitted_share(place, pushes[i], along[i] / size[i]) for i in best]
        return Suspect(effect, max(shares, default=0.0))

    def _fitted_share(self, place: str, signals: Sequence[Floats], push_size: float) -> float:
        """Return the share of the cost that goes when a push of this form, the parameters and the initial states are fitted."""
        records = [
            record.with_signals(**{push(place): signal})
            for record, signal in zip(self._records, signals, strict=True)
        ]
        start = {**self._values, PUSH_SIZE: push_size}
        fit = self._bench.problem(self._structure, records).fit(
            start,
            [*self._fit.free, PUSH_SIZE],
            self._first,
            _EVALUATIONS,
            _TOLERANCE,
            False,
            self._fit.substeps,
        )
        return max(0.0, 1.0 - fit.cost / self._fit.cost) if np.isfinite(fit.cost) else 0.0

    def _signals(self, effect: Effect) -> list[list[Floats]]:
        """Return what an effect by itself adds along each record, from each of its starts."""
        place = self._bench.rig.acts_at(effect)
        if _is_late(effect):
            return [self._late(place, effect, time) for time in self._times(effect)]
        structure, column = alone(effect)
        of_joint = STIFFNESS in structure.names
        starts = self._starts(effect)
        p = np.array([[start[name] for name in structure.names] for start in starts]).T
        x0 = np.zeros((max(1, len(structure.states)), p.shape[1]))
        found: list[list[Floats]] = [[] for _ in starts]
        for i, record in enumerate(self._records):
            seen = self._seen(place, effect, i)
            moved = Record(record.name, record.dt, {structure.rig.inputs[0].name: seen}, {}, hold=record.hold)
            held = record_input(structure, moved)
            with np.errstate(all="ignore"):
                out = simulate_sets(structure, held, p, x0, record.n_samples, Substeps(_SUBSTEPS))[:, column]
            without = (
                smooth_motion(seen, record.dt)[0][:, None] * p[structure.names.index(STIFFNESS)]
                if of_joint
                else seen[:, None]
            )
            for own, added in zip(found, (out - without).T, strict=True):
                own.append(added)
        return [own for own in found if all(np.all(np.isfinite(added)) for added in own)]

    def _seen(self, place: str, effect: Effect, index: int) -> Floats:
        """Return the motion, drive signal or reading along a record that an effect at a place sees."""
        if effect.place is Place.ACTUATOR:
            return self._calm_outputs[index][:, signal_columns(self._bench.rig)[place]]
        if effect.place is Place.SENSOR:
            names = [signal.name for signal in self._bench.rig.outputs]
            return self._calm_outputs[index][:, names.index(place)]
        return self._motions[index][place]

    def _joint_motions(self) -> list[dict[str, Floats]]:
        """Return each joint's motion along each record: simulated, and corrected where the sensors tell."""
        rig, found = self._bench.rig, []
        corrections, columns = Corrections(rig), motion_columns(rig)
        for record, out, residual in zip(self._records, self._calm_outputs, self._residuals, strict=True):
            motions = {}
            for joint, column in columns.items():
                beside = corrections.of_joint(joint, residual, set(record.signals))
                motions[joint] = out[:, column] + (0.0 if beside is None else beside)
            found.append(motions)
        return found

    def _starts(self, effect: Effect) -> list[dict[str, float]]:
        """Return values of the effect's own parameters from which it is worth trying, with the stiffness of its joint."""
        bench = self._bench
        composed = bench.composed((effect,), effect.special_cases)
        declared = [
            composed.values_of(effect, start)
            for start in start_values(bench, composed, effect, self._fit, {})
        ]
        stiffness = evaluated(joint_of(bench.rig, effect).stiffness, self._values)
        inner = [p.name for p in effect.parameters if p.fitted and p.null is None]
        return [
            {
                **own,
                **effect.special_cases,
                **{n: factor * own[n] for n in inner if n in own},
                STIFFNESS: stiffness,
            }
            for own in declared
            for factor in (_WIDER if inner and len(declared) <= _FEW else (1.0,))
        ]

    def _times(self, effect: Effect) -> list[float]:
        (delay,) = effect.parameters
        size = characteristic_value(placed_dimension(effect, delay.dimension), self._bench.scales)
        return [size * start for start in delay.starts]

    def _late(self, place: str, effect: Effect, time: float) -> list[Floats]:
        found = []
        for i, record in enumerate(self._records):
            seen, t = self._seen(place, effect, i), record.dt * np.arange(record.n_samples)
            found.append(np.interp(t - time, t, seen) - seen)
        return found

    def _signed(self, place: str, signal: Floats) -> Floats:
        """Return a signal as a push: what an effect adds at a joint resists the motion."""
        return -signal if place in motion_columns(self._bench.rig) else signal

    def _answer(self, place: str, signals: Sequence[Floats]) -> Floats:
        """Return the change of all readings, weighted and stacked, per size of a push; not finite where it cannot be followed."""
        changes = []
        for i, (record, signal) in enumerate(zip(self._records, signals, strict=True)):
            out = self._outputs(i, record.with_signals(**{push(place): _SMALL * signal}))
            changes.append((out - self._calm_outputs[i])[:, : self._n_outputs] / _SMALL)
        return self._stacked(changes)

    def _calm(self, record: Record) -> Record:
        rest = np.zeros(record.n_samples)
        pushes = self._structure.rig.inputs[len(self._bench.rig.inputs) :]
        return record.with_signals(**{signal.name: rest for signal in pushes})

    def _outputs(
        self, index: int, record: Record, p: Floats | None = None, x0: Floats | None = None
    ) -> Floats:
        """Return the outputs along a record, shape (n_samples, n_outputs), with sets behind where `p` and `x0` have several."""
        sets = self._with_own_constants(record, self._p[:, None] if p is None else p)
        states = self._first[index][:, None] if x0 is None else x0
        held = record_input(self._structure, record)
        with np.errstate(all="ignore"):
            out = simulate_sets(
                self._structure, held, sets, states, record.n_samples, self._fit.substeps[index]
            )
        return out[:, :, 0] if p is None else out

    def _with_own_constants(self, record: Record, p: Floats) -> Floats:
        """Return parameter sets, shape (n_parameters, n_sets), with the constants that a record has of its own."""
        own = p.copy()
        for name, value in record.constants.items():
            own[self._structure.names.index(name)] = value
        return own

    def _free_answers(self) -> list[list[Floats]]:
        """Return the answers to small changes of the free parameters, and of each record's initial states."""
        names, n_states = self._structure.names, len(self._structure.states)
        free = [names.index(name) for name in self._fit.free]
        sizes = [
            abs(self._p[i])
            or characteristic_value(self._structure.parameters[i].dimension, self._bench.scales)
            for i in free
        ]
        p = np.repeat(self._p[:, None], len(free) + n_states, axis=1)
        p[free, np.arange(len(free))] += _STEP * np.array(sizes)
        state_sizes = np.array(
            [characteristic_value(d, self._bench.scales) for d in self._structure.state_dimensions]
        )
        changes = []
        for index, record in enumerate(self._records):
            x0 = np.repeat(self._first[index][:, None], p.shape[1], axis=1)
            x0[np.arange(n_states), len(free) + np.arange(n_states)] += _STEP * state_sizes
            out = self._outputs(index, record, p, x0)
            changes.append((out - self._calm_outputs[index][:, :, None])[:, : self._n_outputs])
        columns = [[change[:, :, column] for change in changes] for column in range(len(free))]
        for index in range(len(self._records)):
            for state in range(len(free), len(free) + n_states):
                columns.append(
                    [
                        change[:, :, state] if i == index else np.zeros(change.shape[:2])
                        for i, change in enumerate(changes)
                    ]
                )
        return columns

    def _stacked(self, parts: Sequence[Floats]) -> Floats:
        return np.concatenate([(part * w).ravel() for part, w in zip(parts, self._weights, strict=True)])

    def _without_free(self, columns: Floats) -> Floats:
        """Return what is left of columns, shape (n,) or (n, m), when parameters and initial states follow."""
        return np.asarray(columns - self._free @ (self._free.T @ columns))


def structures_of_lineup(
    rig: Rig, effects: Iterable[Effect], modelled: tuple[Effect, ...] = ()
) -> list[Structure]:
    """Return what is simulated to find the place of an effect, each once.

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
        if effect.pulsation is None and not _is_late(effect)
    }
    return [compose(with_probes(rig), modelled), *by_themselves.values()]


def _is_late(effect: Effect) -> bool:
    return effect.delay is not None or effect.measured_late is not None


def _basis(columns: Floats) -> Floats:
    """Return an orthonormal basis of finite columns, dependent ones left out."""
    columns = columns[:, np.all(np.isfinite(columns), axis=0)]
    size = np.linalg.norm(columns, axis=0)
    columns = columns[:, size > 0.0] / size[size > 0.0]
    base, singular, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(base[:, singular > _DEPENDENT * singular[0]])

"""Where, before which: what would each effect at each place take away of what the equations leave, before any of them is fitted?

Along the motion that the records show, each effect is simulated by itself, from each of its declared starts. The force, the drive
or the reading that comes out pushes the re-identified equations at its place, and the answer of the sensors is laid beside what
those equations leave: the share of it that goes away, with the size of the push, the rig's parameters and the initial states
free, is what the place and the effect explain to first order. It takes one simulation per start and no fit.

References
----------
L. Ljung, *System Identification* (Prentice Hall 1999), section 16.4, for judging model extensions by their correlation with the
residual.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigsight.diagnose.probes import STIFFNESS, alone, motion_columns, push, signal_columns, with_probes
from rigsight.diagnose.starts import start_values
from rigsight.diagnose.workbench import Scored, Workbench
from rigsight.effects import Effect, Place, placed_dimension
from rigsight.records.record import Record
from rigsight.rigs import evaluated, joint_of
from rigsight.simulate import Structure, Substeps, compose, record_input, simulate_sets
from rigsight.simulate.prescribed_motion import smooth_motion
from rigsight.units import characteristic_value

_SHARE = 0.1
"""Size of a push in units of what the effect itself would be: small enough for the answer to be proportional to it."""
_STEP = 1e-3
"""Relative change of a parameter whose answer is taken by differences."""
_WIDER = (1.0 / 3.0, 1.0, 3.0)
"""Factors on an effect's inner numbers beside its declared starts: they are starts of a fit, which moves on from there."""
_SUBSTEPS = 4
_DEPENDENT = 1e-9


@dataclass(frozen=True)
class Suspect:
    """An effect at a place, and the share of the squared residual that it explains to first order."""

    effect: Effect
    share: float


class Lineup:
    """The re-identified equations along the records, and the answers to pushes at every place.

    Parameters
    ----------
    bench
        Records, scales and noise.
    linear
        The re-identified equations.
    """

    def __init__(self, bench: Workbench, linear: Scored) -> None:
        self._bench = bench
        self._linear = linear
        rig = bench.rig
        self._structure = _with_modelled(bench)
        self._values = linear.fit.values
        self._p = np.array([self._values[name] for name in self._structure.names])
        own = linear.fit.structure.states
        self._order = [own.index(state) for state in self._structure.states]
        self._joints = motion_columns(rig, [joint.name for joint in rig.mechanism.joints])
        self._drives = signal_columns(rig)
        self._n_outputs = len(rig.outputs)
        self._records = [self._calm(record) for record in bench.estimation]
        self._calm_outputs = [self._outputs(i, record) for i, record in enumerate(self._records)]
        self._weights = self._noise_weights()
        free = np.column_stack([self._stacked(column) for column in self._free_answers()])
        self._free = _basis(free)
        self._left = self._without_free(self._stacked([np.nan_to_num(r) for r in linear.fit.residuals]))
        self._total = float(self._left @ self._left) or 1.0

    def suspects(self, effects: Sequence[Effect]) -> list[Suspect]:
        """Return what each effect explains, the best start of each."""
        return list(self._bench.threads.side_by_side(self._suspect, list(effects)))

    def _suspect(self, effect: Effect) -> Suspect:
        place = self._bench.rig.acts_at(effect)
        answers = [
            answer
            for signals in self._signals(effect)
            if (answer := self._answer(place, signals)) is not None
        ]
        if not answers:
            return Suspect(effect, 0.0)
        columns = self._without_free(np.column_stack(answers))
        size = np.einsum("ij,ij->j", columns, columns)
        explained = np.where(size > 0.0, (self._left @ columns) ** 2 / np.where(size > 0.0, size, 1.0), 0.0)
        return Suspect(effect, float(np.max(explained)) / self._total)

    def _signals(self, effect: Effect) -> list[list[NDArray[np.float64]]]:
        """Return what an effect by itself adds along each record, from each of its starts."""
        place = self._bench.rig.acts_at(effect)
        if effect.delay is not None or effect.measured_late is not None:
            return [self._late(place, effect, time) for time in self._times(effect)]
        structure, column = alone(effect)
        starts = self._starts(effect, structure)
        p = np.array([[start[name] for name in structure.names] for start in starts]).T
        x0 = np.zeros((max(1, len(structure.states)), p.shape[1]))
        found: list[list[NDArray[np.float64]]] = [[] for _ in starts]
        for i, record in enumerate(self._records):
            seen = self._seen(place, effect, i)
            name = structure.rig.inputs[0].name
            moved = Record(record.name, record.dt, {name: seen}, {}, hold=record.hold)
            with np.errstate(all="ignore"):
                out = simulate_sets(
                    structure, record_input(structure, moved), p, x0, record.n_samples, Substeps(_SUBSTEPS)
                )[:, column]
            without = p[structure.names.index(STIFFNESS)] if STIFFNESS in structure.names else 1.0
            base = smooth_motion(seen, record.dt)[0] if STIFFNESS in structure.names else seen
            for own, added in zip(found, (out - base[:, None] * without).T, strict=True):
                own.append(added)
        return [own for own in found if all(np.all(np.isfinite(added)) for added in own)]

    def _seen(self, place: str, effect: Effect, index: int) -> NDArray[np.float64]:
        """Return the motion, drive signal or reading along a record that an effect at a place sees."""
        out = self._calm_outputs[index]
        if effect.place is Place.ACTUATOR:
            return out[:, self._drives[place]]
        if effect.place is Place.SENSOR:
            names = [signal.name for signal in self._bench.rig.outputs]
            return out[:, names.index(place)]
        return out[:, self._joints[place]]

    def _starts(self, effect: Effect, structure: Structure) -> list[dict[str, float]]:
        bench = self._bench
        composed = bench.composed((effect,), effect.special_cases)
        declared = [
            composed.values_of(effect, start)
            for start in start_values(bench, composed, effect, self._linear.fit, {})
        ]
        inner = [p.name for p in effect.parameters if p.fitted and p.null is None]
        starts = []
        for own in declared:
            for factor in _WIDER if inner else (1.0,):
                starts.append(
                    {**own, **effect.special_cases, **{n: factor * own[n] for n in inner if n in own}}
                )
        stiffness = evaluated(joint_of(bench.rig, effect).stiffness, self._values)
        return [
            {**start, STIFFNESS: stiffness} if STIFFNESS in structure.names else start for start in starts
        ]

    def _times(self, effect: Effect) -> list[float]:
        (delay,) = effect.parameters
        size = characteristic_value(placed_dimension(effect, delay.dimension), self._bench.scales)
        return [size * start for start in delay.starts]

    def _late(self, place: str, effect: Effect, time: float) -> list[NDArray[np.float64]]:
        found = []
        for i, record in enumerate(self._records):
            seen, t = self._seen(place, effect, i), record.dt * np.arange(record.n_samples)
            found.append(np.interp(t - time, t, seen) - seen)
        return found

    def _answer(self, place: str, signals: Sequence[NDArray[np.float64]]) -> NDArray[np.float64] | None:
        """Return the change of all readings, weighted and stacked, when a place is pushed; a force resists the motion."""
        of_joint = place in self._joints
        changes = []
        for i, (record, signal) in enumerate(zip(self._records, signals, strict=True)):
            pushed = record.with_signals(**{push(place): (-_SHARE if of_joint else _SHARE) * signal})
            out = self._outputs(i, pushed)
            changes.append((out - self._calm_outputs[i])[:, : self._n_outputs] / _SHARE)
        answer = self._stacked(changes)
        return answer if np.all(np.isfinite(answer)) else None

    def _calm(self, record: Record) -> Record:
        rest = np.zeros(record.n_samples)
        probes = self._structure.rig.inputs[len(self._bench.rig.inputs) :]
        return record.with_signals(**{signal.name: rest for signal in probes})

    def _outputs(
        self,
        index: int,
        record: Record,
        p: NDArray[np.float64] | None = None,
        x0: NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """Return the outputs along a record, shape (n_samples, n_outputs) or with sets behind."""
        sets = (self._p if p is None else p).reshape(self._p.size, -1)
        first = self._linear.fit.initial_states[index][self._order]
        states = first[:, None] if x0 is None else x0
        states = np.repeat(states, sets.shape[1], axis=1) if states.shape[1] == 1 else states
        with np.errstate(all="ignore"):
            out = simulate_sets(
                self._structure,
                record_input(self._structure, record),
                sets,
                states,
                record.n_samples,
                Substeps(self._linear.fit.substeps[index]),
            )
        return out[:, :, 0] if p is None else out

    def _free_answers(self) -> list[list[NDArray[np.float64]]]:
        """Return the answers to small changes of the free parameters, and of each record's initial states."""
        names = self._structure.names
        free = [names.index(name) for name in self._linear.fit.free]
        scale = {p.name: self._bench.scales.get(f"size@{p.name}", 1.0) for p in self._structure.parameters}
        steps = [_STEP * (abs(self._p[i]) or scale[names[i]]) for i in free]
        n_states = len(self._structure.states)
        p = np.repeat(self._p[:, None], len(free) + n_states, axis=1)
        for column, (i, step) in enumerate(zip(free, steps, strict=True)):
            p[i, column] += step
        columns: list[list[NDArray[np.float64]]] = []
        changes = []
        for index, record in enumerate(self._records):
            first = self._linear.fit.initial_states[index][self._order]
            x0 = np.repeat(first[:, None], p.shape[1], axis=1)
            sizes = np.maximum(np.abs(first), 1e-3 * np.max(np.abs(first), initial=1e-9))
            x0[np.arange(n_states), len(free) + np.arange(n_states)] += _STEP * sizes
            out = self._outputs(index, record, p, x0)
            changes.append((out - self._calm_outputs[index][:, :, None])[:, : self._n_outputs])
        for column in range(len(free)):
            columns.append([change[:, :, column] for change in changes])
        for index in range(len(self._records)):
            for state in range(n_states):
                columns.append(
                    [
                        change[:, :, len(free) + state] if i == index else np.zeros(change.shape[:2])
                        for i, change in enumerate(changes)
                    ]
                )
        return columns

    def _noise_weights(self) -> list[NDArray[np.float64]]:
        outputs = [signal.name for signal in self._bench.rig.outputs]
        return [
            np.array([1.0 / self._bench.noise[name] if name in record else 0.0 for name in outputs])
            for record in self._bench.estimation
        ]

    def _stacked(self, parts: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
        return np.concatenate([(part * w).ravel() for part, w in zip(parts, self._weights, strict=True)])

    def _without_free(self, columns: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what is left of columns, shape (n,) or (n, m), when parameters and initial states follow."""
        return np.asarray(columns - self._free @ (self._free.T @ columns))


def _with_modelled(bench: Workbench) -> Structure:
    return compose(with_probes(bench.rig), bench.modelled)


def _basis(columns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return an orthonormal basis of finite columns, dependent ones left out."""
    columns = columns[:, np.all(np.isfinite(columns), axis=0)]
    size = np.linalg.norm(columns, axis=0)
    columns = columns[:, size > 0.0] / size[size > 0.0]
    base, singular, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(base[:, singular > _DEPENDENT * singular[0]])


def strongest_first(suspects: Sequence[Suspect]) -> list[Suspect]:
    """Return suspects by what they explain."""
    return sorted(suspects, key=lambda suspect: -suspect.share)

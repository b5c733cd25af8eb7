"""Responses of fitted equations to a small perturbation, less what parameters and initial states could compensate.

References
----------
L. Ljung, *System Identification* (Prentice Hall 1999), section 16.4, for judging extensions of a model by their correlation with
its residual.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.diagnose.fit_context import FitContext
from rigsight.diagnose.pushes.probes import PUSH_SIZE, motion_columns, push, signal_columns, with_probes
from rigsight.effects import Effect
from rigsight.effects.symbols import derivative
from rigsight.identify import FitResult
from rigsight.identify.fit.covariance import symmetric_eigen
from rigsight.identify.fit.windows import observed_sensors
from rigsight.identify.start.scales import scales_at_places
from rigsight.records.record import Floats, Record
from rigsight.rigs import Rig
from rigsight.simulate import compose, parameter_vector, record_input, record_values, simulate_sets
from rigsight.simulate.input_hold import HeldInput, hold_input, hold_motion
from rigsight.units import characteristic_value

_DETERMINED = 1e-6
"""Smallest singular value, relative to the largest, from which the coordinates count as shown by the sensors."""


class Corrections:
    """Difference of each joint's motion from a simulation, computed from the differences of the sensor readings."""

    # Only sensors that read a sum of coordinates are used, and only if together they determine all degrees of freedom.

    def __init__(self, rig: Rig) -> None:
        mechanism = rig.mechanism
        coordinates = [coordinate.symbol for coordinate in mechanism.free]
        numbers = {sp.Symbol(p.name, real=True) for p in (*rig.constants, *rig.parameters)}
        self._joints = {joint.name: _slopes(joint.motion, coordinates, numbers) for joint in mechanism.joints}
        self._sensors = {
            sensor.name: _slopes(sensor.reads, coordinates, numbers) for sensor in mechanism.sensors
        }
        self._names = [sensor.name for sensor in mechanism.sensors]
        self._n = len(coordinates)

    def of_joint(self, name: str, differences: Floats, measured: set[str]) -> Floats | None:
        """Return the correction of a joint's motion, shape (n_samples,); None where the sensors do not tell."""
        slopes = self._joints[name]
        asked = [i for i, n in enumerate(self._names) if n in measured and self._sensors[n] is not None]
        if slopes is None or not asked:
            return None
        shown = np.array([self._sensors[self._names[i]] for i in asked])
        singular = np.linalg.svd(shown, compute_uv=False)
        if singular.size < self._n or singular[-1] <= _DETERMINED * singular[0]:
            return None
        return np.asarray(differences[:, asked] @ np.linalg.pinv(shown).T @ slopes)


def _slopes(expression: sp.Expr, coordinates: list[sp.Symbol], numbers: set[sp.Symbol]) -> Floats | None:
    """Return the derivatives by each coordinate of a sum of multiples of them and numbers; None for any other expression."""
    slopes = [derivative(expression, coordinate) for coordinate in coordinates]
    if any(not slope.is_number for slope in slopes) or not any(slopes):
        return None
    rest = sp.expand(expression - sum(s * c for s, c in zip(slopes, coordinates, strict=True)))
    return np.array(slopes, dtype=np.float64) if rest.free_symbols <= numbers else None


_STEP = 1e-3
"""Relative change of a parameter whose answer is taken by differences."""
_ROUNDED_COLUMN = 1e-7
"""Part of a column outside the others below which it depends on them: squares are accurate to 1e-16."""


@dataclass(frozen=True)
class Followed:
    """Subspace that parameters and initial states could compensate."""

    spans: tuple[slice, ...]  # where each record stands in a column of all readings
    # Basis of the subspace of the initial states of each record, shape (n_own, n_columns) each.
    of_states: tuple[Floats, ...]
    of_parameters: Floats  # basis of the additional subspace of the parameters, shape (n, n_columns)

    @classmethod
    def of(cls, spans: Sequence[slice], by_state: Sequence[Floats], by_parameter: Floats) -> Followed:
        """Return the bases of given answers."""
        states = cls(tuple(spans), tuple(map(orthonormal, by_state)), np.zeros((by_parameter.shape[0], 0)))
        return replace(states, of_parameters=orthonormal(states.without(by_parameter)))

    def without(self, columns: Floats) -> Floats:
        """Return columns, shape (n,) or (n, m), after projecting out parameters and initial states."""
        remainder = np.array(columns, dtype=np.float64)
        for span, basis in zip(self.spans, self.of_states, strict=True):
            remainder[span] -= basis @ (basis.T @ remainder[span])
        return np.asarray(remainder - self.of_parameters @ (self.of_parameters.T @ remainder))

    def along(self, basis: Floats, stretches: Sequence[slice]) -> Floats:
        """Return what a basis and these share in stretches, none of which reaches from one record into the next."""
        widths = [own.shape[1] for own in self.of_states]
        columns = [slice(int(b) - w, int(b)) for w, b in zip(widths, np.cumsum(widths), strict=True)]
        products = np.zeros((len(stretches), basis.shape[1], sum(widths) + self.of_parameters.shape[1]))
        for product, part in zip(products, stretches, strict=True):
            product[:, sum(widths) :] = basis[part].T @ self.of_parameters[part]
            for span, own, column in zip(self.spans, self.of_states, columns, strict=True):
                if span.start <= part.start < span.stop:
                    inside = slice(part.start - span.start, part.stop - span.start)
                    product[:, column] = basis[part].T @ own[inside]
        return products


class Responses:
    """Fitted equations along records, with a push at every place."""

    # The context gives scales and noise, its memory is not used. The fit is one to these records, or one with only their initial
    # states fitted; `effects` are those that the equations hold beside the modelled ones, `free` the parameters that are
    # projected out of the response to a push.

    def __init__(
        self,
        context: FitContext,
        records: Sequence[Record],
        fit: FitResult,
        effects: tuple[Effect, ...],
        free: Sequence[str],
    ) -> None:
        self.context = replace(context, memory=None)
        self.fit = fit
        self.free = tuple(free)
        rig = context.rig
        self.structure = compose(
            with_probes(rig), (*context.modelled, *effects), observed=observed_sensors(records)
        )
        self.values = {**fit.all_values, PUSH_SIZE: 1.0}
        self._p = parameter_vector(self.structure, self.values)
        own = fit.structure.states
        order = [own.index(state) for state in self.structure.states]
        self.initial_states = [state[order] for state in fit.rig_states]
        offsets = [list(fit.offsets(index).values()) for index in range(len(records))]
        self.fitted_states = [np.append(*own) for own in zip(self.initial_states, offsets, strict=True)]
        self._n_outputs = len(rig.outputs)
        # A rig with one motion is searched in sizes of its own kind; a push needs those of its place.
        self.scales = scales_at_places(rig, records, self.values) if rig.has_one_motion else context.scales
        self.records = [self._calm(record) for record in records]
        self._held = [record_input(self.structure, record) for record in self.records]
        self.calm_outputs = [self._outputs(i, held) for i, held in enumerate(self._held)]
        outputs = [signal.name for signal in rig.outputs]
        self._weights = [
            np.array([1.0 / context.noise[name] if name in record else 0.0 for name in outputs])
            for record in records
        ]
        self._residuals = [np.nan_to_num(residual) for residual in fit.residuals]
        edges = np.cumsum([0, *(record.n_samples * self._n_outputs for record in self.records)])
        self.spans = tuple(slice(int(a), int(b)) for a, b in itertools.pairwise(edges))

    @property
    def can_be_compared(self) -> bool:
        """False where the equations are too stiff for the steps of a fit, so that the response to a push is unknown."""
        return all(bool(np.all(np.isfinite(out))) for out in self.calm_outputs)

    @cached_property
    def seen_remainder(self) -> Floats:
        """Residuals of the equations, weighted and stacked."""
        return self.stacked(self._residuals)

    @cached_property
    def remainder(self) -> Floats:
        """The same after projecting out parameters and initial states."""
        return self.without_free(self.seen_remainder)

    @cached_property
    def motions(self) -> list[dict[str, Floats]]:
        """Each joint's motion along each record: simulated, and corrected where the sensors tell."""
        rig, found = self.context.rig, []
        corrections, columns = Corrections(rig), motion_columns(rig)
        for record, out, residual in zip(self.records, self.calm_outputs, self._residuals, strict=True):
            motions = {}
            for joint, column in columns.items():
                beside = corrections.of_joint(joint, residual, set(record.signals))
                motions[joint] = out[:, column] + (0.0 if beside is None else beside)
            found.append(motions)
        return found

    def seen(self, place: str) -> list[Floats]:
        """Return the signal that an effect at a place reads along each record: motion, drive signal or reading."""
        # A joint's motion is the measured one where the sensors tell it. An observer follows that by itself, and its velocity is
        # that of the equations: between the steps of an encoder a measured one is not known.
        if place in motion_columns(self.context.rig) and not self.structure.observed:
            return [motion[place] for motion in self.motions]
        return self.simulated(place)

    def simulated(self, place: str) -> list[Floats]:
        """Return the same from the equations alone, without disturbances and sensor noise."""
        rig = self.context.rig
        columns = {
            **{signal.name: i for i, signal in enumerate(rig.outputs)},
            **signal_columns(rig),
            **motion_columns(rig),
        }
        return [out[:, columns[place]] for out in self.calm_outputs]

    def to_push(self, place: str, signals: Sequence[Floats], size: float) -> Floats:
        """Return the change of all readings, weighted and stacked, per size of a push; not finite where it cannot be followed."""
        column = self.structure.rig.mechanism.inputs.index(push(place))
        is_drive = place in signal_columns(self.context.rig)
        changes = []
        for i, (record, signal) in enumerate(zip(self.records, signals, strict=True)):
            pushed = self._held[i].with_input(column, _between_samples(size * signal, record, is_drive))
            changes.append((self._outputs(i, pushed) - self.calm_outputs[i])[:, : self._n_outputs] / size)
        return self.stacked(changes)

    def to_effect(self, effect: Effect, own: Mapping[str, float]) -> Floats:
        """Return the change of all readings, weighted and stacked, with one more effect in the equations."""
        structure = compose(
            with_probes(self.context.rig),
            (*self.structure.effects, effect),
            observed=observed_sensors(self.records),
        )
        named = {structure.parameter_name(effect, name): value for name, value in own.items()}
        values, states = {**self.values, **named}, self.structure.states
        changes = []
        for i, record in enumerate(self.records):
            p = parameter_vector(structure, {**values, **record_values(structure, {}, record)})[:, None]
            known = dict(zip(states, self.initial_states[i], strict=True))
            x0 = np.array([[known.get(state, 0.0)] for state in structure.states])
            held = record_input(structure, record)
            with np.errstate(all="ignore"):
                out = simulate_sets(structure, held, p, x0, record.n_samples, self.fit.substeps[i])[:, :, 0]
            changes.append((out - self.calm_outputs[i])[:, : self._n_outputs])
        return self.stacked(changes)

    def to_parameter(self, name: str) -> list[Floats]:
        """Return the change of the readings of each record with a free parameter, shape (n_samples, n_outputs) each."""
        return self._of_parameters[self.free.index(name)]

    def stacked(self, parts: Sequence[Floats]) -> Floats:
        """Return readings of all records in one column, in units of their noise."""
        return np.concatenate([(part * w).ravel() for part, w in zip(parts, self._weights, strict=True)])

    @cached_property
    def is_measured(self) -> NDArray[np.bool_]:
        """Which of the stacked readings were measured: the others stand as zeros, shape (n,)."""
        return self.stacked([np.ones_like(residual) for residual in self._residuals]) > 0.0

    @property
    def n_measured(self) -> int:
        """Number of readings that were measured."""
        return int(np.count_nonzero(self.is_measured))

    def without_free(self, columns: Floats) -> Floats:
        """Return columns, shape (n,) or (n, m), after projecting out parameters and initial states."""
        return self._followed.without(columns)

    @cached_property
    def _followed(self) -> Followed:
        return Followed.of(self.spans, self.by_state, self.by_parameter)

    @cached_property
    def by_parameter(self) -> Floats:
        """The changes of all readings with the free parameters, weighted and stacked, shape (n, n_free)."""
        columns = [self.stacked(changes) for changes in self._of_parameters]
        return np.column_stack(columns) if columns else np.zeros((self.spans[-1].stop, 0))

    @cached_property
    def by_state(self) -> list[Floats]:
        """The changes of each record's readings with its initial states and offsets, weighted and stacked."""
        found = []
        for change, weights in zip(self._changes, self._weights, strict=True):
            by_state = change[:, :, len(self.free) :] * weights[None, :, None]
            shifts = np.zeros((change.shape[0], self._n_outputs, len(self.fit.offset_names)))
            for column, name in enumerate(self.fit.offset_names):
                place = [signal.name for signal in self.context.rig.outputs].index(name)
                shifts[:, place, column] = weights[place]
            own = np.concatenate([by_state, shifts], axis=2)
            found.append(own.reshape(change.shape[0] * change.shape[1], own.shape[2]))
        return found

    @cached_property
    def _of_parameters(self) -> list[list[Floats]]:
        return [[change[:, :, column] for change in self._changes] for column in range(len(self.free))]

    @cached_property
    def _changes(self) -> list[Floats]:
        """Answers to small changes of the free parameters and then of the initial states, per record."""
        names, n_states = self.structure.names, len(self.structure.states)
        free = [names.index(name) for name in self.free]
        sizes = [
            abs(self._p[i]) or characteristic_value(self.structure.parameters[i].dimension, self.scales)
            for i in free
        ]
        p = np.repeat(self._p[:, None], len(free) + n_states, axis=1)
        p[free, np.arange(len(free))] += _STEP * np.array(sizes)
        state_sizes = np.array(
            [characteristic_value(d, self.scales) for d in self.structure.state_dimensions]
        )
        changes = []
        for index, held in enumerate(self._held):
            x0 = np.repeat(self.initial_states[index][:, None], p.shape[1], axis=1)
            x0[np.arange(n_states), len(free) + np.arange(n_states)] += _STEP * state_sizes
            out = self._outputs(index, held, p, x0)
            changes.append((out - self.calm_outputs[index][:, :, None])[:, : self._n_outputs])
        return changes

    def _calm(self, record: Record) -> Record:
        rest = np.zeros(record.n_samples)
        pushes = self.structure.rig.inputs[len(self.context.rig.inputs) :]
        return record.with_signals(**{signal.name: rest for signal in pushes})

    def _outputs(
        self, index: int, held: HeldInput, p: Floats | None = None, x0: Floats | None = None
    ) -> Floats:
        """Return the outputs along a record, shape (n_samples, n_outputs), with sets behind where `p` and `x0` have several."""
        record = self.records[index]
        sets = self._with_own_constants(record, self._p[:, None] if p is None else p)
        states = self.initial_states[index][:, None] if x0 is None else x0
        with np.errstate(all="ignore"):
            out = simulate_sets(
                self.structure, held, sets, states, record.n_samples, self.fit.substeps[index]
            )
        return out[:, :, 0] if p is None else out

    def _with_own_constants(self, record: Record, p: Floats) -> Floats:
        """Return parameter sets, shape (n_parameters, n_sets), with the constants that a record has of its own."""
        own = p.copy()
        for name, value in record_values(self.structure, {}, record).items():
            own[self.structure.names.index(name)] = value
        return own


def _between_samples(signal: Floats, record: Record, is_drive: bool) -> HeldInput:
    """Return a push between its samples: that at a drive jumps as its input does, any other follows a motion, which is smooth."""
    if is_drive and record.hold == "zoh":
        return hold_input(signal, record.dt, "zoh")
    return hold_motion(signal, np.gradient(signal, record.dt), record.dt)


def orthonormal(columns: Floats) -> Floats:
    """Return an orthonormal basis of finite columns, shape (n, m), dependent ones left out."""
    columns = columns[:, np.all(np.isfinite(columns), axis=0)]
    size = np.linalg.norm(columns, axis=0)
    columns = columns[:, size > 0.0] / size[size > 0.0]
    if columns.shape[1] == 0:
        return np.zeros((columns.shape[0], 0))
    # From the squares, which takes a quarter of the time of a singular value decomposition of these tall columns; done twice,
    # the basis is orthonormal to rounding.
    for _ in range(2):
        squares, directions = symmetric_eigen(columns.T @ columns)
        kept = squares > _ROUNDED_COLUMN**2 * squares[-1]
        columns = columns @ (directions[:, kept] / np.sqrt(squares[kept]))
    return columns

"""Which change of one number does a record ask for? Of a parameter, or of the gain or zero of a sensor, while all others stay.

`own_numbers` takes one Gauss-Newton step from the model, with initial states and offsets projected out. A change that is far too
small to raise the gap shows there, because the residual is compared with what exactly this change would cause.

Where a model leaves more on a record than usual, `suspects` fits each number to the record alone, beside its initial state. More
than that is not told: what acts at the same place with the same phase, such as dry friction beside damping, changes the same
number.

References
----------
C. R. Rao, Proc. Camb. Phil. Soc. 44 (1948) 50, for score tests. L. Ljung, *System Identification* (Prentice Hall 1999), chapter
9, for the variance beside colored residuals.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rigsight.compare.on_one_record import FreeRun
from rigsight.compare.usual_gap import Prediction
from rigsight.identify import (
    DEFAULT_ACCURACY,
    GreyBoxFit,
    RecordDerivatives,
    characteristic_scales,
    derivatives,
    free_names,
    spectral_product,
)
from rigsight.identify.fit.derivatives import orthonormal_basis
from rigsight.records import Floats, Record
from rigsight.simulate import Model, Structure

_ROUNDED = 1e-7
"""Part of a column outside the initial states below which it depends on them."""
_ACCURACY, _TOLERANCE, _EVALUATIONS = 1e-3, 1e-3, 12
"""Of fits that only rank: their errors stay below a hundredth of the gap."""
_FARTHER = (0.8, 1.25)
"""Factors on a number from which it is fitted once more where no number explains the larger part of the gap."""
_EXPLAINED = 0.5
_NAMED = 0.005
"""Share of a squared gap from which a number is suspected: less is 0 %."""
_MOVED = 2.0
"""RMS of a sensor in noise floors up to which it shows noise alone. What motion is fitted to noise says nothing of a number."""
_FAINT = 10.0
"""Factor on the standard error of known records from which a record does not determine what it cannot tell from zero either."""


@dataclass(frozen=True)
class OwnNumber:
    """The change of one number that one record asks for."""

    name: str  # of a parameter, or ``"gain of psi"``
    value: float  # in the model
    unit: str
    change: float
    information: float  # of the record on it, in units of the noise floors
    noise: float  # variance of the change, times the information

    @property
    def variance(self) -> float:
        """Variance of the change, with the accuracy of the simulations."""
        return self.noise / self.information + (DEFAULT_ACCURACY * self.value) ** 2


@dataclass(frozen=True)
class NumberCheck:
    """A number of one record beside those of the records for which the model is known to hold."""

    record: str
    number: OwnNumber
    usual: float  # change in the known records, on average
    allowed: float  # difference from it that a further record rarely exceeds
    p_value: float  # probability of such a change if the model holds

    @property
    def excess(self) -> float:
        """The difference from the usual change in units of the allowed one."""
        return abs(self.number.change - self.usual) / self.allowed

    @property
    def closed(self) -> bool:
        """True if it exceeds that."""
        return self.excess > 1.0


def is_at_rest(windows: Sequence[Record], noise: Mapping[str, float]) -> bool:
    """Return whether no sensor of a record moves more than its noise."""
    held = {name: [window[name] for window in windows if name in window] for name in noise}
    return all(np.std(np.concatenate(own)) <= _MOVED * noise[name] for name, own in held.items() if own)


def own_numbers(model: Model, windows: Sequence[Record], noise: Mapping[str, float]) -> list[OwnNumber]:
    """Return the change of each number that a record asks for; those on which it holds nothing are left out."""
    structure, rig = model.structure, model.structure.rig
    if is_at_rest(windows, noise):
        return []
    scales = characteristic_scales(rig, windows, model.values)
    problem = GreyBoxFit(structure, windows, scales, noise)
    fit = problem.fit(model.values, [], finish=False)
    if not np.isfinite(fit.cost):
        return []
    free = free_names(structure, {p.name for p in rig.parameters})
    found = derivatives(problem, fit, free)
    to_values = np.linalg.pinv(found.coordinates.jacobian(found.place))
    outputs = [signal.name for signal in rig.outputs]
    sensors = [name for name in outputs if all(name in window for window in windows)]
    parts = []
    for window, own in zip(windows, found.records, strict=True):
        gains = _gains(own, [name for name in outputs if name in window], window, noise, sensors)
        parts.append(_Part.of(own, np.column_stack([own.by_coordinate @ to_values, gains])))
    units = {p.name: p.unit for p in structure.parameters}
    named = [(name, model.values[name], units[name]) for name in free]
    named += [(f"gain of {name}", 1.0, "1") for name in sensors]
    numbers = [_number(parts, i, *own) for i, own in enumerate(named)]
    return [number for number in numbers if number is not None]


def check_numbers(
    record: str, own: Sequence[OwnNumber], known: Sequence[Sequence[OwnNumber]], false_alarms: float
) -> list[NumberCheck]:
    """Hold the numbers that a record determines against those of known records, each with this probability of a false alarm."""
    found = []
    for number in own:
        alike = [other for numbers in known for other in numbers if other.name == number.name]
        if len(alike) < len(known):
            continue
        # The residual of a changed rig is no measure of its noise.
        noise = float(np.mean([other.noise for other in alike]))
        unknown = noise / number.information
        known_at_least = _FAINT**2 * max(other.noise / other.information for other in alike)
        if unknown > max(number.value**2, known_at_least):
            continue
        usual = Prediction.of(np.array([o.change for o in alike]), np.array([o.variance for o in alike]))
        variance = unknown + (DEFAULT_ACCURACY * number.value) ** 2
        away = abs(number.change - usual.mean)
        allowed = usual.quantile(0.5 * false_alarms, variance) - usual.mean
        p_value = 2.0 * usual.exceeded(usual.mean + away, variance)
        found.append(NumberCheck(record, number, usual.mean, allowed, p_value))
    return found


@dataclass(frozen=True)
class _Part:
    """A window: residual and columns after projecting out its initial state."""

    residual: Floats  # shape (n_measured * n_samples,)
    columns: Floats  # shape (n_measured * n_samples, n_numbers)
    whole: Floats  # squares of the columns before the projection, shape (n_numbers,)
    n_measured: int

    @classmethod
    def of(cls, own: RecordDerivatives, columns: Floats) -> _Part:
        """Return the part of a window."""
        basis = orthonormal_basis(own.by_state, _ROUNDED)
        return cls(
            own.residuals - basis @ (basis.T @ own.residuals),
            columns - basis @ (basis.T @ columns),
            np.sum(columns**2, axis=0),
            own.n_measured,
        )


def _gains(
    own: RecordDerivatives,
    held: Sequence[str],
    window: Record,
    noise: Mapping[str, float],
    sensors: Sequence[str],
) -> Floats:
    """Return the derivatives of residuals by the gains of sensors, shape (n_measured * n_samples, n_sensors)."""
    columns = np.zeros((own.residuals.size, len(sensors)))
    blocks = own.residuals.reshape(own.n_measured, -1)
    for name, residual, block in zip(held, blocks, np.split(columns, own.n_measured), strict=True):
        if name in sensors:
            simulated = window[name] / noise[name] - residual
            block[:, sensors.index(name)] = np.mean(simulated) - simulated
    return columns


def _number(parts: Sequence[_Part], index: int, name: str, value: float, unit: str) -> OwnNumber | None:
    columns = [part.columns[:, index] for part in parts]
    information = sum(float(column @ column) for column in columns)
    if not information > _ROUNDED**2 * sum(float(part.whole[index]) for part in parts):
        return None
    pairs = list(zip(columns, parts, strict=True))
    change = -sum(float(column @ part.residual) for column, part in pairs) / information
    filling = sum(
        float(spectral_product(part.residual + column * change, column[:, None], part.n_measured)[0, 0])
        for column, part in pairs
    )
    return OwnNumber(name, value, unit, change, information, filling / information)


@dataclass(frozen=True)
class Suspect:
    """A number whose change explains a part of a gap."""

    what: str  # such as ``"k_c"`` or ``"gain of psi"``
    where: str  # joint, drive or sensor; empty for a number of several
    share: float  # of the squared gap, in units of the noise floors
    unit: str
    before: float  # its value in the model
    after: float  # the value that explains most


def suspects(
    model: Model, windows: Sequence[Record], run: FreeRun, noise: Mapping[str, float]
) -> list[Suspect]:
    """Return the numbers whose change explains a part of the gap, the one that explains most first."""
    found = [*_of_sensors(model, windows, run, noise), *_of_equations(model, windows, noise)]
    return sorted((one for one in found if one.share >= _NAMED), key=lambda one: -one.share)


def place_of(structure: Structure, name: str) -> str:
    """Return the joint, drive, sensor or state in whose equation alone a parameter stands; empty if there is none."""
    mechanism = structure.rig.mechanism
    for effect in structure.effects:
        if name in {structure.parameter_name(effect, p.name) for p in effect.parameters}:
            return structure.rig.where(effect)
    places = {
        **{
            j.name: (j.stiffness, j.damping, j.rest, j.force, *([] if j.inertia is None else [j.inertia]))
            for j in mechanism.joints
        },
        **{d.name: (d.signal, d.force) for d in mechanism.drives},
        **{s.name: (s.reads,) for s in mechanism.sensors},
        **{str(s.symbol): (s.rate,) for s in mechanism.states},
    }
    holding = [
        place
        for place, expressions in places.items()
        if any(name in {symbol.name for symbol in e.free_symbols} for e in expressions)
    ]
    if not holding and len(mechanism.joints) == 1:
        return mechanism.joints[0].name
    return holding[0] if len(holding) == 1 else ""


def _of_equations(model: Model, windows: Sequence[Record], noise: Mapping[str, float]) -> Iterator[Suspect]:
    structure = model.structure
    scales = characteristic_scales(structure.rig, windows, model.values)
    problem = GreyBoxFit(structure, windows, scales, noise, _ACCURACY)

    def fitted(free: Sequence[str], factor: float = 1.0) -> tuple[float, dict[str, float]]:
        start = {**model.values, **{name: factor * model.values[name] for name in free}}
        result = problem.fit(start, free, None, _EVALUATIONS, _TOLERANCE, finish=False)
        return result.cost if np.isfinite(result.cost) else np.inf, result.values

    before, _ = fitted([])
    if not 0.0 < before < np.inf:
        return
    names = [parameter.name for parameter in structure.parameters]
    found = {name: fitted([name]) for name in names}
    if min(cost for cost, _ in found.values()) > _EXPLAINED * before:
        # Where motion jumps to another branch, a fit does not find the way there by itself.
        for name in names:
            tried = [found[name], *(fitted([name], factor) for factor in _FARTHER)]
            found[name] = min(tried, key=lambda outcome: outcome[0])
    for parameter in structure.parameters:
        cost, values = found[parameter.name]
        if cost < np.inf:
            yield Suspect(
                parameter.name,
                place_of(structure, parameter.name),
                1.0 - cost / before,
                parameter.unit,
                model.values[parameter.name],
                values[parameter.name],
            )


def _of_sensors(
    model: Model, windows: Sequence[Record], run: FreeRun, noise: Mapping[str, float]
) -> Iterator[Suspect]:
    """Yield another gain and another zero of each sensor, beside a simulation that stays as it is."""
    weighed = {name: residual / noise[name] for name, residual in run.residuals.items()}
    whole = sum(float(own @ own) for own in weighed.values())
    for name, residual in run.residuals.items():
        simulated = np.concatenate([window[name] for window in windows]) - residual
        simulated = simulated - np.mean(simulated)
        size, zero = float(simulated @ simulated), float(np.mean(residual))
        slope = float(simulated @ residual) / size if size > 0.0 else 0.0
        scale = noise[name] ** 2 * whole
        if scale > 0.0:
            unit = model.structure.rig.signal_units[name]
            yield Suspect(f"gain of {name}", name, slope**2 * size / scale, "1", 1.0, 1.0 + slope)
            yield Suspect(f"zero of {name}", name, zero**2 * residual.size / scale, unit, 0.0, zero)

"""Which change of one number does a record ask for? Of a parameter or of the gain of a sensor, while all others stay.

A change that is far too small to raise the gap shows here, because the residual is compared with what exactly this change would
cause. One Gauss-Newton step from the model; initial states and offsets are projected out.

References
----------
C. R. Rao, Proc. Camb. Phil. Soc. 44 (1948) 50, for score tests. L. Ljung, *System Identification* (Prentice Hall 1999), chapter
9, for the variance beside colored residuals.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rigsight.compare.usual_gap import Prediction
from rigsight.identify import (
    DEFAULT_ACCURACY,
    GreyBoxFit,
    RecordDerivatives,
    characteristic_scales,
    derivatives,
    spectral_product,
)
from rigsight.identify.fit.fit_data import free_names
from rigsight.records import Record
from rigsight.records.record import Floats
from rigsight.simulate.model import Model

_ROUNDED = 1e-7
"""Part of a column outside the initial states below which it depends on them."""


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


def own_numbers(model: Model, windows: Sequence[Record], noise: Mapping[str, float]) -> list[OwnNumber]:
    """Return the change of each number that a record asks for; those on which it holds nothing are left out."""
    structure, rig = model.structure, model.structure.rig
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
    """Hold the numbers of a record against those of known records; the probability of a false alarm is that of each."""
    found = []
    for number in own:
        alike = [other for numbers in known for other in numbers if other.name == number.name]
        if len(alike) < len(known):
            continue
        usual = Prediction.of(np.array([o.change for o in alike]), np.array([o.variance for o in alike]))
        # The residual of a changed rig is no measure of its noise.
        noise = float(np.mean([other.noise for other in alike]))
        variance = noise / number.information + (DEFAULT_ACCURACY * number.value) ** 2
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
        basis = _orthonormal(own.by_state)
        return cls(
            own.residuals - basis @ (basis.T @ own.residuals),
            columns - basis @ (basis.T @ columns),
            np.sum(columns**2, axis=0),
            own.n_measured,
        )


def _orthonormal(columns: Floats) -> Floats:
    size = np.linalg.norm(columns, axis=0)
    base, singular, _ = np.linalg.svd(columns[:, size > 0.0] / size[size > 0.0], full_matrices=False)
    return np.asarray(base[:, singular > _ROUNDED * np.max(singular, initial=0.0)])


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

"""Poles and frequency responses of a fitted rig linearized at equilibrium, with uncertainty, and the measured responses."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigsight.frequency import ResponsesOfInputs, responses_of_inputs
from rigsight.identify.fit.first_states import rig_state
from rigsight.identify.information import POORLY_KNOWN, Information
from rigsight.identify.rig_equations import equations_of
from rigsight.identify.transfer.record_response import Method
from rigsight.records.record import Floats, Record
from rigsight.records.signals import is_constant
from rigsight.rigs import Rig
from rigsight.simulate import Structure
from rigsight.simulate.linearization import Linearization, linearize

_STEP = 1e-4
"""Relative change of a parameter for a difference: rounding and curvature both contribute an error of 1e-8."""
_ROUNDING = 1e-9
_GROWTHS = 3.0
"""Longest free run of an unstable rig in time constants of its growth: errors of the initial state grow twentyfold."""
_IMAGES = 50
"""Number of multiples of the sampling frequency: for a response that falls as 1/f, the rest is 1 % of their contribution."""
_POLES = {"local_rational": 2, "local_polynomial": 0}


@dataclass(frozen=True)
class Mode:
    """One pole, or a pair of conjugate ones."""

    pole: complex  # the pole, of a pair that with positive imaginary part [1/s]
    # Its size [rad/s], and its damping ratio; NaN for a pole at zero.
    natural_frequency: float
    damping_ratio: float
    # Their standard errors.
    frequency_std: float
    damping_std: float


@dataclass(frozen=True, eq=False)
class LinearView:
    """A fitted rig linearized at equilibrium, for records with the same constants."""

    constants: dict[str, float]  # the records' own constants
    records: tuple[str, ...]
    linearization: Linearization  # about the equilibrium under the mean inputs of these records
    modes: tuple[Mode, ...]  # its poles by their size, with standard errors
    # Frequency responses of these records together; None if no input moves.
    measured: ResponsesOfInputs | None
    # The linearized response at the measured frequencies with its standard error, shape (n,) each, by (source, response).
    model: Mapping[tuple[str, str], tuple[NDArray[np.complex128], Floats]]
    # Contribution of a held input to the measured response, shape (n,), by (source, response); none for a prescribed motion.
    images: Mapping[tuple[str, str], NDArray[np.complex128]]

    @property
    def constants_text(self) -> str:
        """The constants on a line: ``"m = 2, v = 1"``."""
        return ", ".join(f"{name} = {value:g}" for name, value in self.constants.items())

    @property
    def has_responses(self) -> bool:
        """True if there is a measured frequency response; steps give none."""
        return self.measured is not None and bool(self.measured.found)

    def misfit(self, source: str, response: str) -> float:
        """Return the difference between model and measured response relative to the noise; 1 if noise explains it."""
        # This is the median over frequencies, because values at the ends of a band may be far off.
        assert self.measured is not None
        curve, (values, std) = self.measured.found[source, response], self.model[source, response]
        assert curve.variance is not None
        expected = values + self.images.get((source, response), 0.0)
        relative = np.abs(curve.values - expected) ** 2 / (curve.variance + std**2)
        # A squared complex error has an exponential distribution.
        return float(np.sqrt(np.median(relative) / np.log(2.0)))


def measured_responses(
    records: Sequence[Record], rig: Rig, method: Method, resolution: float | None
) -> ResponsesOfInputs | None:
    """Return the frequency responses of all sensors to all inputs, None if no input moves."""
    if all(is_constant(record[signal.name]) for record in records for signal in rig.inputs):
        return None
    return responses_of_inputs(
        records,
        [signal.name for signal in rig.inputs],
        [signal.name for signal in rig.outputs],
        poles=_POLES[method],
        resolution=resolution,
        # They were measured, and have no content above the Nyquist frequency.
        smooth=sorted(rig.mechanism.prescribing),
    )


def longest_free_run(poles: NDArray[np.complex128], records: Sequence[Record]) -> float | None:
    """Return how long a rig can run free before errors of its initial state hide the motion [s]; None for whole records."""
    growth = float(np.max(poles.real, initial=0.0))
    longest = max(record.n_samples * record.dt for record in records)
    return _GROWTHS / growth if growth * longest > _GROWTHS else None


def by_constants(records: Sequence[Record]) -> list[list[Record]]:
    """Return records in groups with the same own constants."""
    groups: dict[tuple[tuple[str, float], ...], list[Record]] = {}
    for record in records:
        groups.setdefault(tuple(sorted(record.constants.items())), []).append(record)
    return list(groups.values())


def near_rest(structure: Structure, values: Mapping[str, float], records: Sequence[Record]) -> Linearization:
    """Return the linearization about the equilibrium under the mean inputs that is closest to the mean sensor readings."""
    # If the records are close to different equilibria, the most stable one is used, because a rig stays only at a stable one.
    inputs = {
        signal.name: _mean([record[signal.name] for record in records]) for signal in structure.rig.inputs
    }
    equations = equations_of(structure.rig)
    found = []
    for record in records:
        near = rig_state(equations, record, values, resting=record.n_samples)
        # The states of effects follow those of the rig, and are zero where they are at rest.
        near = np.pad(near, (0, len(structure.states) - near.size))
        found.append(linearize(structure, values, inputs, near=near))
    return min(found, key=lambda linear: float(np.max(linear.poles.real, initial=-np.inf)))


def linear_view(
    structure: Structure,
    values: Mapping[str, float],
    records: Sequence[Record],
    measured: ResponsesOfInputs | None,
    known: Information,
) -> LinearView:
    """Return a fitted rig, linearized at its equilibrium in some records."""
    constants = dict(records[0].constants)
    found = near_rest(structure, {**values, **constants}, records)
    inputs = dict(zip(found.inputs, map(float, found.at_inputs), strict=True))

    def at(moved: Mapping[str, float]) -> Linearization:
        return linearize(structure, {**values, **constants, **moved}, inputs, near=found.at_state)

    neighbors = list(_neighbors(known, at))
    model, images = {}, {}
    for (source, response), curve in (measured.found if measured is not None else {}).items():
        column, row = found.inputs.index(source), found.outputs.index(response)
        changes = [
            change.factor
            * (change.ahead.frequency_response(curve.omega) - change.behind.frequency_response(curve.omega))
            for change in neighbors
        ]
        spread = np.sqrt(
            np.sum(np.abs([np.zeros_like(curve.values), *(c[:, row, column] for c in changes)]) ** 2, axis=0)
        )
        model[source, response] = (found.frequency_response(curve.omega)[:, row, column], np.asarray(spread))
        if source not in structure.rig.mechanism.prescribing:
            images[source, response] = images_of_held_input(found, curve.omega, records)[:, row, column]
    return LinearView(
        constants=constants,
        records=tuple(record.name for record in records),
        linearization=found,
        modes=tuple(_mode(pole, neighbors) for pole in found.poles if pole.imag >= 0.0),
        measured=measured,
        model=model,
        images=images,
    )


def images_of_held_input(
    linear: Linearization, omega: Floats, records: Sequence[Record]
) -> NDArray[np.complex128]:
    """Return the contribution of a held input to measured responses from around the multiples of the sampling frequency."""
    # The steps or lines of a hold have a spectrum there. In samples of a response that falls off slowly, such as that of a
    # pressure or a speed, it appears at low frequencies (K. J. Astrom and B. Wittenmark, *Computer-Controlled Systems*, Prentice
    # Hall 1997). Zero if the records differ in sample time or hold, or the input has no content there.
    none = np.zeros((omega.size, len(linear.outputs), len(linear.inputs)), dtype=np.complex128)
    holds, times = {record.hold for record in records}, [record.dt for record in records]
    power = {"zoh": 1, "foh": 2}.get(holds.pop() if len(holds) == 1 else "band_limited")
    if power is None or np.ptp(times) > _ROUNDING * times[0]:
        return none
    found = none
    for multiple in (m for size in range(1, _IMAGES + 1) for m in (-size, size)):
        around = omega + multiple * 2.0 * np.pi / times[0]
        found = found + linear.frequency_response(around) * ((omega / around) ** power)[:, None, None]
    return found


def _mean(samples: Sequence[Floats]) -> float:
    """Return the mean of an input, zero if it is only rounding error of an excitation."""
    mean = float(np.mean([np.mean(own) for own in samples]))
    return mean if abs(mean) > _ROUNDING * max(float(np.max(np.abs(own))) for own in samples) else 0.0


@dataclass(frozen=True, eq=False)
class _Change:
    """Two linearizations, and the factor by which their difference is one standard error of a direction of the parameters."""

    ahead: Linearization
    behind: Linearization
    factor: float


def _neighbors(known: Information, at: Callable[[Mapping[str, float]], Linearization]) -> Iterator[_Change]:
    """Yield a change for each determined direction; along the others the measured outputs do not change."""
    _, singular, right = np.linalg.svd(known.root, full_matrices=False)
    for size, direction in zip(singular, right, strict=True):
        if size * POORLY_KNOWN <= 1.0:
            continue
        step = _STEP * known.sizes * direction
        ahead, behind = (
            at(dict(zip(known.names, map(float, known.values + side * step), strict=True)))
            for side in (1.0, -1.0)
        )
        yield _Change(ahead, behind, 1.0 / (2.0 * _STEP * float(size)))


def _mode(pole: complex, neighbors: Sequence[_Change]) -> Mode:
    frequency, damping = [0.0], [0.0]
    for change in neighbors:
        ahead, behind = (
            complex(linear.poles[np.argmin(np.abs(linear.poles - pole))])
            for linear in (change.ahead, change.behind)
        )
        frequency.append(change.factor * (abs(ahead) - abs(behind)))
        damping.append(change.factor * (_damping(ahead) - _damping(behind)))
    return Mode(
        pole=complex(pole),
        natural_frequency=abs(pole),
        damping_ratio=_damping(pole),
        frequency_std=float(np.linalg.norm(frequency)),
        damping_std=float(np.linalg.norm(damping)),
    )


def _damping(pole: complex) -> float:
    return -pole.real / abs(pole) if pole != 0.0 else float("nan")

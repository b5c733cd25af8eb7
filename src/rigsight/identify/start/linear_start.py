"""Linear parameters directly from the spectra of the records, as start values of a grey-box fit.

For a driven rig with one motion; for other rigs see `any_rig_start`. The method is iterated linear least squares on the equation
of motion in the frequency domain, weighted by the inverse of the current denominator so that the equation error approaches the
output error; a polynomial per record represents the transients. It has no local minima and needs no simulation.

References
----------
C. K. Sanathanan and J. Koerner, "Transfer function synthesis as a ratio of two complex polynomials", IEEE Trans. Automatic
Control (1963). R. Pintelon and J. Schoukens, *System Identification: A Frequency Domain Approach* (Wiley 2012), chapter 9.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.identify.start.any_rig_start import any_rig_start
from rigsight.identify.start.linearized_responses import USABLE_BAND, response_of_hold
from rigsight.identify.start.measured_states import SIGNIFICANT_POWER
from rigsight.records.record import Floats, Record
from rigsight.records.signals import is_constant
from rigsight.rigs import Follower, Rig, evaluated
from rigsight.simulate.prescribed_motion import smooth_motion

_UNKNOWN = 1.0
"""Value of a parameter that the records do not determine."""
_STILL = 1e-12
"""Range of a signal relative to its size that counts as rounding error."""
_ITERATIONS = 20
_TRANSIENT_ORDER = 2
_EXCITED = 1e-3
_MIN_LINES = 20
_LEFT = 0.5
"""Share of a response that equations leave below which they explain the larger part of it."""
Term = tuple[int, NDArray[np.complex128]]
"""Power of j omega and the spectrum that it multiplies."""


def linear_start(
    rig: Rig, records: Sequence[Record], constants: Mapping[str, float], known: Mapping[str, float]
) -> dict[str, float]:
    """Return a value for every parameter of the rig without effects.

    Parameters
    ----------
    rig
        The rig.
    records
        Estimation records.
    constants
        The rig's constants by name.
    known
        Parameters that are held at their value.

    Raises
    ------
    InputError
        If the records do not move the rig.
    """
    if not rig.has_one_motion:
        return any_rig_start(rig, records, constants, known)
    gain = {symbol.name for symbol in rig.motion.drive_gain.free_symbols}
    if rig.is_driven and not gain <= {*constants, *known}:
        return any_rig_start(rig, records, constants, known)
    driven = [record for record in records if not is_constant(record[rig.inputs[0].name])]
    if rig.is_driven and not driven:
        # A free decay consists only of end terms, which this method treats as transients to be removed.
        # A constant force is equivalent to a free rest position.
        bias = rig.motion.bias.free_symbols if rig.motion.rest.free_symbols else ()
        return any_rig_start(rig, records, constants, {**dict.fromkeys(map(str, bias), 0.0), **known})
    found = (_driven if rig.is_driven else _prescribed)(rig, driven, constants, known)
    if rig.follower is not None:
        found |= _followed(rig, rig.follower, driven, constants, found)
    bounds = {p.name: (p.lower, p.upper) for p in rig.parameters}
    return {**{name: float(np.clip(value, *bounds[name])) for name, value in found.items()}, **known}


def _driven(
    rig: Rig, records: Sequence[Record], constants: Mapping[str, float], known: Mapping[str, float]
) -> dict[str, float]:
    motion, source, response = rig.motion, rig.inputs[0].name, rig.outputs[0].name
    gain = evaluated(motion.drive_gain, {**constants, **known})
    has_stiffness = known.get(str(motion.stiffness)) != 0.0
    inertia, damping, stiffness = second_order(
        records,
        source,
        response,
        gain,
        has_stiffness,
        any_damping=_may_be_negative(rig, motion.damping),
        any_stiffness=_may_be_negative(rig, motion.stiffness),
    )
    offset = _mean(records, response) - gain * _mean(records, source) / stiffness if has_stiffness else 0.0
    assert motion.inertia is not None
    numbers = ((motion.inertia, inertia), (motion.damping, damping), (motion.stiffness, stiffness))
    found: dict[str, float] = {}
    for expression, value in (*numbers, (motion.rest, offset), (motion.bias, 0.0)):
        found |= _solved(expression, value, {**constants, **found})
    return found


def _may_be_negative(rig: Rig, expression: sp.Expr) -> bool:
    """Return True if the bounds of its parameters leave a negative value to a stiffness or a damping: the rig may be unstable."""
    own = {symbol.name for symbol in expression.free_symbols}
    return any(p.lower < 0.0 for p in rig.parameters if p.name in own)


def _followed(
    rig: Rig,
    follower: Follower,
    records: Sequence[Record],
    constants: Mapping[str, float],
    found: Mapping[str, float],
) -> dict[str, float]:
    """Return the parameters of the state that follows the motion."""
    motion, name = rig.outputs[0].name, follower.symbol.name
    own = {symbol.name for symbol in (follower.gain * follower.creepage).free_symbols}
    own -= {*constants, *found, rig.motion.displacement.name, name}
    seen = [record for record in records if name in record]
    if not seen:
        return {p: 0.0 if p in _offsets(follower) else _UNKNOWN for p in own}
    # The hold is that of the rig's input; a measured output that drives a later stage has no content above Nyquist.
    smooth = [replace(record, hold="band_limited") for record in seen]
    # ``y' = slope x - rate y``, written as ``tau y' + unity y = x``.
    tau, unity = _equation_error(smooth, motion, name, (1, 0), 1.0)
    slope, rate = float(abs(1.0 / tau)), float(abs(unity / tau) or 1.0)
    solved = _solved(follower.gain, slope, constants)
    solved |= _solved(follower.feedback, rate / slope, {**constants, **solved})
    static = evaluated(follower.static_gain, {**constants, **solved})
    return solved | dict.fromkeys(_offsets(follower), _mean(seen, name) - static * _mean(seen, motion))


def _offsets(follower: Follower) -> set[str]:
    return {symbol.name for symbol in follower.displacement.free_symbols if symbol != follower.symbol}


def _solved(expression: sp.Expr, value: float, known: Mapping[str, float]) -> dict[str, float]:
    """Return the unknown parameter with which an expression has a given value; several unknown ones are assumed to be equal."""
    given = {symbol: known[symbol.name] for symbol in expression.free_symbols if symbol.name in known}
    lacking = sorted(expression.free_symbols - given.keys(), key=str)
    if not lacking:
        return {}
    unknown = sp.Symbol("unknown", real=True)
    equation = expression.subs(given).subs(dict.fromkeys(lacking, unknown))
    solutions = [s for s in sp.solve(equation - value, unknown) if s.is_real]
    return {symbol.name: float(solutions[-1]) if solutions else _UNKNOWN for symbol in lacking}


def _mean(records: Sequence[Record], name: str) -> float:
    return float(np.mean([np.mean(record[name]) for record in records]))


def _prescribed(
    rig: Rig, records: Sequence[Record], constants: Mapping[str, float], known: Mapping[str, float]
) -> dict[str, float]:
    motion, source, response = rig.motion, rig.inputs[0].name, rig.outputs[0].name
    for name in (source, response):
        _check_moves(records, name)
    rows, forces = [], []
    for record in records:
        x, v = smooth_motion(record[source], record.dt)
        rows.append(np.column_stack([v, x, np.ones_like(x)]))
        forces.append(record[response])
    solution = np.linalg.lstsq(np.concatenate(rows), np.concatenate(forces), rcond=None)[0]
    damping, stiffness, force = map(float, solution)
    numbers, found = {**constants, **known}, dict[str, float]()
    for expression, value in (
        (motion.damping, damping),
        (motion.stiffness, stiffness),
        (motion.bias, force),
        # What no constant force explains is a spring that rests elsewhere; with both, one is enough.
        (motion.rest, _rest(motion.bias, force, stiffness, numbers)),
    ):
        if not expression.is_Symbol:
            found |= _solved(expression, value, {**numbers, **found})
        elif expression.name not in constants:
            found[expression.name] = value
    return found


def _rest(bias: sp.Expr, force: float, stiffness: float, numbers: Mapping[str, float]) -> float:
    """Return the rest position of a spring whose force is `force` at zero deflection, beside a constant force that is known."""
    if stiffness == 0.0 or any(symbol.name not in numbers for symbol in bias.free_symbols):
        return 0.0
    return (evaluated(bias, numbers) - force) / stiffness


def _check_moves(records: Sequence[Record], name: str) -> None:
    # The mean of a constant differs from it by rounding, so the comparison needs a scale.
    if all(np.ptp(r[name]) <= _STILL * np.max(np.abs(r[name])) for r in records):
        raise InputError(
            f"Signal '{name}' does not move in any estimation record; nothing can be identified."
        )


def second_order(
    records: Sequence[Record],
    source: str,
    response: str,
    gain: float,
    has_stiffness: bool = True,
    *,
    any_damping: bool = False,
    any_stiffness: bool = False,
) -> tuple[float, float, float]:
    """Return the best-fitting inertia, damping and stiffness of ``m x'' + d x' + k x = gain u``."""
    orders = (2, 1, 0) if has_stiffness else (2, 1)
    inertia, damping, *rest = _equation_error(records, source, response, orders, gain)
    stiffness = rest[0] if has_stiffness else 0.0
    turned = inertia <= 0.0
    inertia = abs(inertia) or 1.0
    if has_stiffness and (turned or (stiffness <= 0.0 and not any_stiffness)):
        stiffness = abs(stiffness) or 1.0
    if turned or not any_damping:
        damping = max(damping, 1e-4 * np.sqrt(stiffness * inertia) if stiffness > 0.0 else 0.0)
    return float(inertia), float(damping), float(stiffness)


def moves_against(record: Record, source: str, response: str, gain: float, has_stiffness: bool) -> bool:
    """Return True if a record fits ``m x'' + d x' + k x = gain u`` with negative numbers: one signal has the opposite sign."""
    block = spectra_of(record, source, response)
    numbers = _equation_error([record], source, response, (2, 1, 0) if has_stiffness else (2, 1), gain)
    # An unstable rig has a negative stiffness or damping, but never all. A controller that rejects disturbances looks like a
    # negative spring and damper: the inertia must count within the band.
    inertia, *others = numbers
    if not (
        np.all(numbers < 0.0) and abs(inertia) * np.max(block.omega) ** 2 > abs(others[-1]) * has_stiffness
    ):
        return False
    s = 1j * block.omega
    moved = gain * block.drive / (inertia * s**2 + others[0] * s + (others[1] if has_stiffness else 0.0))
    return bool(np.sum(np.abs(block.response - moved) ** 2) < _LEFT * np.sum(np.abs(block.response) ** 2))


def _equation_error(
    records: Sequence[Record], source: str, response: str, orders: tuple[int, ...], gain: float
) -> Floats:
    """Solve ``sum_i a_i (j omega)^order_i X = gain U + transient`` for the a_i."""
    for name in (source, response):
        _check_moves(records, name)
    blocks = [spectra_of(record, source, response) for record in records]
    terms = [[(order, block.response) for order in orders] for block in blocks]
    return solve_in_frequency(blocks, terms, [gain * block.drive for block in blocks])


@dataclass(frozen=True)
class Spectra:
    """Spectra of one record on its informative lines, shape (n_lines,) each."""

    omega: Floats  # angular frequencies [rad/s]
    lines: NDArray[np.intp]  # indices of the lines in the full spectrum
    hold: NDArray[np.complex128]  # frequency response of the hold
    drive: NDArray[np.complex128]  # input, multiplied by the response of the hold
    response: NDArray[np.complex128]  # output


def spectra_of(record: Record, source: str, response: str) -> Spectra:
    """Return the spectra of a record on the lines on which input and response exceed the noise."""
    u = record[source] - np.mean(record[source])
    x = record[response] - np.mean(record[response])
    omega: Floats = 2.0 * np.pi * np.asarray(np.fft.rfftfreq(u.size, record.dt)[1:], dtype=np.float64)
    drive, spectrum = np.fft.rfft(u)[1:] / u.size, np.fft.rfft(x)[1:] / u.size
    hold = response_of_hold(record, omega)
    power = np.abs(spectrum) ** 2
    floor = np.median(power[int(0.9 * power.size) :])
    significant = (power > SIGNIFICANT_POWER * floor) & (omega < USABLE_BAND * np.pi / record.dt)
    excited = np.abs(drive) > _EXCITED * np.max(np.abs(drive))
    keep = significant & excited
    if np.count_nonzero(keep) < _MIN_LINES:
        keep = excited
    lines = np.flatnonzero(keep) + 1
    return Spectra(omega[keep], lines, hold[keep], (drive * hold)[keep], spectrum[keep])


def solve_in_frequency(
    blocks: Sequence[Spectra],
    terms: Sequence[Sequence[Term]],
    targets: Sequence[NDArray[np.complex128]],
) -> Floats:
    """Solve ``sum_i a_i (j omega)^order_i F_i = target + transient`` over all records for the real a_i."""
    top = max(float(np.max(block.omega)) for block in blocks)
    n_terms = len(terms[0])
    weights = [np.ones_like(block.response) for block in blocks]
    solution = np.zeros(n_terms)
    for _ in range(_ITERATIONS):
        previous, solution = solution, _weighted_solution(blocks, terms, targets, weights, top)
        if np.allclose(solution[:n_terms], previous[:n_terms], rtol=1e-6):
            break
        weights = [_own_denominator(*own, solution, top) for own in zip(blocks, terms, strict=True)]
    return np.asarray(solution[:n_terms] / top ** np.array([order for order, _ in terms[0]]))


def _weighted_solution(
    blocks: Sequence[Spectra],
    terms: Sequence[Sequence[Term]],
    targets: Sequence[NDArray[np.complex128]],
    weights: Sequence[NDArray[np.complex128]],
    top: float,
) -> Floats:
    n_terms, n_transient = len(terms[0]), _TRANSIENT_ORDER + 1
    n_columns = n_terms + n_transient * len(blocks)
    normal, right = np.zeros((n_columns, n_columns)), np.zeros(n_columns)
    for index, (block, own, target, weight) in enumerate(zip(blocks, terms, targets, weights, strict=True)):
        s = 1j * block.omega / top
        columns = np.zeros((block.omega.size, n_columns), dtype=np.complex128)
        for i, (order, spectrum) in enumerate(own):
            columns[:, i] = s**order * spectrum
        first = n_terms + index * n_transient
        for power in range(n_transient):
            columns[:, first + power] = -(s**power)
        weighted, goal = columns / weight[:, None], target / weight
        normal += np.real(weighted.conj().T @ weighted)
        right += np.real(weighted.conj().T @ goal)
    # A term that is zero in all records, such as a stop that is never reached, has no scale, and gets no coefficient.
    size = np.sqrt(np.where(np.diag(normal) > 0.0, np.diag(normal), 1.0))
    return np.asarray(np.linalg.lstsq(normal / np.outer(size, size), right / size, rcond=1e-14)[0] / size)


def _own_denominator(
    block: Spectra, terms: Sequence[Term], solution: Floats, top: float
) -> NDArray[np.complex128]:
    s = 1j * block.omega / top
    value = np.zeros_like(block.response)
    for i, (order, spectrum) in enumerate(terms):
        if spectrum is block.response:
            value = value + solution[i] * s**order
    return np.where(np.abs(value) > 0.0, value, 1.0)

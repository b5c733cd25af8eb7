"""Linear parameters straight from the spectra of the records, as start values of a grey-box fit.

Iterated linear least squares on the equation of motion in the frequency domain, weighted by the inverse of the current
denominator so that the equation error approaches the output error; a polynomial per record takes up the transients.

References
----------
C. K. Sanathanan and J. Koerner, IEEE Trans. Automatic Control 8 (1963) 56. R. Pintelon and J. Schoukens, *System
Identification: A Frequency Domain Approach* (Wiley 2012), sections 6.3 and 9.8.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.records.record import Record
from rigsight.rigs import RIGS, Rig
from rigsight.simulate.prescribed_motion import smooth_motion

_ITERATIONS = 20
_TRANSIENT_ORDER = 2
_OUTPUTS = frozenset(signal.name for rig in RIGS.values() if rig.is_driven for signal in rig.outputs)
_STILL = 1e-12
"""Range of a signal relative to its size that is rounding."""


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
        Parameters that keep their value.

    Raises
    ------
    InputError
        If the records do not move the rig.
    """
    if rig.name == "running_gear":
        found = _running_gear(records, constants)
    elif rig.name == "axis":
        found = _axis(records, constants, no_spring=known.get("k") == 0.0)
    else:
        found = _element(records)
    parameters = {p.name: p for p in rig.parameters}
    clipped = {
        name: float(np.clip(value, parameters[name].lower, parameters[name].upper))
        for name, value in found.items()
    }
    return {**clipped, **known}


def _running_gear(records: Sequence[Record], constants: Mapping[str, float]) -> dict[str, float]:
    gain = constants["b"] * constants["k_tau"] / constants["r_0"]
    inertia, damping, stiffness = second_order(records, "u", "psi", gain)
    psi_mean = float(np.mean([np.mean(r["psi"]) for r in records]))
    u_mean = float(np.mean([np.mean(r["u"]) for r in records]))
    found = {
        "J_z": inertia,
        "k_d": damping,
        "k_c": stiffness,
        "psi_off": psi_mean - gain * u_mean / stiffness,
        "l_0": 0.25,
        "c_y": 1.0,
        "y_off": 0.0,
    }
    with_y = [record for record in records if "y" in record]
    if with_y:
        slope, rate = first_order(with_y, "psi", "y")
        found["c_y"] = slope / constants["v"]
        found["l_0"] = slope / (2.0 * rate)
        y_mean = float(np.mean([np.mean(r["y"]) for r in with_y]))
        found["y_off"] = y_mean - 2.0 * found["l_0"] * float(np.mean([np.mean(r["psi"]) for r in with_y]))
    return found


def _axis(records: Sequence[Record], constants: Mapping[str, float], no_spring: bool) -> dict[str, float]:
    gain = constants["gain"]
    inertia, damping, stiffness = second_order(records, "u", "x", gain, no_spring)
    x_mean = float(np.mean([np.mean(r["x"]) for r in records]))
    u_mean = float(np.mean([np.mean(r["u"]) for r in records]))
    offset = 0.0 if no_spring else x_mean - gain * u_mean / stiffness
    return {"m": inertia, "d": damping, "k": stiffness, "x_off": offset, "force_off": 0.0}


def _element(records: Sequence[Record]) -> dict[str, float]:
    for name in ("x", "force"):
        _check_moves(records, name)
    rows, forces = [], []
    for record in records:
        x, v = smooth_motion(record["x"], record.dt)
        rows.append(np.column_stack([v, x, np.ones_like(x)]))
        forces.append(record["force"])
    solution = np.linalg.lstsq(np.concatenate(rows), np.concatenate(forces), rcond=None)[0]
    return dict(zip(("d", "k", "force_off"), map(float, solution), strict=True))


def _check_moves(records: Sequence[Record], name: str) -> None:
    # The mean of a constant differs from it by rounding, so the comparison needs a scale.
    if all(np.ptp(r[name]) <= _STILL * np.max(np.abs(r[name])) for r in records):
        raise InputError(
            f"Signal '{name}' does not move in any estimation record; nothing can be identified."
        )


def second_order(
    records: Sequence[Record], source: str, response: str, gain: float, no_spring: bool = False
) -> tuple[float, float, float]:
    """Return inertia, damping and stiffness of ``m x'' + d x' + k x = gain u`` that fit best.

    Raises
    ------
    InputError
        If input or response do not move.
    """
    orders = (2, 1) if no_spring else (2, 1, 0)
    solution = _equation_error(records, source, response, orders, gain)
    inertia, damping = solution[0], solution[1]
    stiffness = 0.0 if no_spring else solution[2]
    if inertia <= 0.0 or (stiffness <= 0.0 and not no_spring):
        inertia, stiffness = abs(inertia) or 1.0, abs(stiffness) or 1.0
    smallest = 1e-4 * np.sqrt(stiffness * inertia) if stiffness > 0.0 else 0.0
    return float(inertia), float(max(damping, smallest)), float(stiffness)


def first_order(records: Sequence[Record], source: str, response: str) -> tuple[float, float]:
    """Return slope and rate of ``y' = slope x - rate y`` that fit best."""
    tau, unity = _equation_error(records, source, response, (1, 0), 1.0)
    slope, rate = 1.0 / tau, unity / tau
    return float(abs(slope)), float(abs(rate) or 1.0)


def _equation_error(
    records: Sequence[Record], source: str, response: str, orders: tuple[int, ...], gain: float
) -> NDArray[np.float64]:
    """Solve ``sum_i a_i (j omega)^order_i X = gain U + transient`` for the a_i."""
    for name in (source, response):
        _check_moves(records, name)
    blocks = [_spectra(record, source, response) for record in records]
    top = max(float(np.max(omega)) for omega, _, _ in blocks)
    n_transient = _TRANSIENT_ORDER + 1
    n_columns = len(orders) + n_transient * len(blocks)
    denominators = [np.ones_like(omega, dtype=complex) for omega, _, _ in blocks]
    solution = np.zeros(n_columns)
    for _ in range(_ITERATIONS):
        normal = np.zeros((n_columns, n_columns))
        right = np.zeros(n_columns)
        for index, ((omega, drive, x), denominator) in enumerate(zip(blocks, denominators, strict=True)):
            s = 1j * omega / top
            columns = np.zeros((omega.size, n_columns), dtype=complex)
            for i, order in enumerate(orders):
                columns[:, i] = s**order * x
            first = len(orders) + index * n_transient
            for power in range(n_transient):
                columns[:, first + power] = -(s**power)
            weighted = columns / denominator[:, None]
            target = gain * drive / denominator
            normal += np.real(weighted.conj().T @ weighted)
            right += np.real(weighted.conj().T @ target)
        size = np.sqrt(np.diag(normal)) + 1e-300
        previous = solution
        scaled = np.linalg.lstsq(normal / np.outer(size, size), right / size, rcond=1e-14)[0]
        solution = scaled / size
        for index, (omega, _, _) in enumerate(blocks):
            s = 1j * omega / top
            value = sum(solution[i] * s**order for i, order in enumerate(orders))
            denominators[index] = np.where(np.abs(value) > 0.0, value, 1.0)
        if np.allclose(solution[: len(orders)], previous[: len(orders)], rtol=1e-6):
            break
    return np.array([solution[i] / top**order for i, order in enumerate(orders)])


def _spectra(
    record: Record, source: str, response: str
) -> tuple[NDArray[np.float64], NDArray[np.complex128], NDArray[np.complex128]]:
    """Return omega, held input and response of the lines on which the response stands above its noise."""
    u = record[source] - np.mean(record[source])
    x = record[response] - np.mean(record[response])
    omega = 2.0 * np.pi * np.fft.rfftfreq(u.size, record.dt)[1:]
    drive, spectrum = np.fft.rfft(u)[1:] / u.size, np.fft.rfft(x)[1:] / u.size
    phase = omega * record.dt / 2.0
    sinc = np.sin(phase) / phase
    # The hold tells of the rig's input; a measured output that drives a later stage is smooth between its samples.
    hold = "band_limited" if source in _OUTPUTS else record.hold
    if hold == "zoh":
        drive = drive * sinc * np.exp(-1j * phase)
    elif hold == "foh":
        drive = drive * sinc**2
    power = np.abs(spectrum) ** 2
    floor = np.median(power[int(0.9 * power.size) :])
    significant = (power > 25.0 * floor) & (omega < 0.8 * np.pi / record.dt)
    excited = np.abs(drive) > 1e-3 * np.max(np.abs(drive))
    keep = significant & excited
    if np.count_nonzero(keep) < 20:
        keep = excited
    return omega[keep], drive[keep], spectrum[keep]

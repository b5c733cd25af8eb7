"""Linear parameters straight from the spectra of the records, as start values of a grey-box fit.

Iterated linear least squares on the equation of motion in the frequency domain, weighted by the inverse of the current
denominator so that the equation error approaches the output error; a polynomial per record takes up the transients.

References
----------
C. K. Sanathanan and J. Koerner, "Transfer function synthesis as a ratio of two complex polynomials", IEEE Trans. Automatic
Control (1963). R. Pintelon and J. Schoukens, *System Identification: A Frequency Domain Approach* (Wiley 2012), chapter 9.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.identify.equation_error import solve_in_frequency, spectra_of
from rigsight.records.record import Record
from rigsight.rigs import AXIS, RIGS, ROLLING, Rig, evaluated
from rigsight.simulate.prescribed_motion import smooth_motion

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
        found = _running_gear(rig, records, constants)
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


def _running_gear(rig: Rig, records: Sequence[Record], constants: Mapping[str, float]) -> dict[str, float]:
    gain = evaluated(rig.motion.drive_gain, constants)
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
        at_rest = evaluated(ROLLING.static_gain, found)
        found["y_off"] = y_mean - at_rest * float(np.mean([np.mean(r["psi"]) for r in with_y]))
    return found


def _axis(records: Sequence[Record], constants: Mapping[str, float], no_spring: bool) -> dict[str, float]:
    gain = evaluated(AXIS.motion.drive_gain, constants)
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
    if source in _OUTPUTS:
        # The hold tells of the rig's input; a measured output that drives a later stage is smooth between its samples.
        records = [replace(record, hold="band_limited") for record in records]
    blocks = [spectra_of(record, source, response) for record in records]
    terms = [[(order, block.response) for order in orders] for block in blocks]
    return solve_in_frequency(blocks, terms, [gain * block.drive for block in blocks]).coefficients

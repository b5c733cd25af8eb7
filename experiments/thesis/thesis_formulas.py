"""Physical parameters of the running gear from a PT2 and a PT1 by the thesis's formulas, with their uncertainty.

Thesis, equations (2.21), (2.24), (2.26) and (2.27). The position of the factor v follows from (2.12) and the lateral equation,
``c_y = 2 l_0 omega_b / v``; in (2.25) it is on the wrong side, which has no effect for v = 1 m/s.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.effects.symbols import derivative
from rigsight.errors import InputError
from rigsight.identify import PhysicalEstimates, TransferFit
from rigsight.identify.fit.covariance import colored_covariance, propagated_covariance
from rigsight.records import Record
from rigsight.rigs import RUNNING_GEAR, Rig, evaluated

_POSITIVE = frozenset({"J_z", "k_c", "k_d", "l_0", "c_y"})
_RESTS = 1e-3
_LEAST_SAMPLES = 20

assert RUNNING_GEAR.follower is not None
ROLLING = RUNNING_GEAR.follower
"""The lateral displacement, which follows the yaw angle."""


def yaw_parameters(
    fit: TransferFit,
    constants: Mapping[str, float],
    constant_errors: Mapping[str, float] | None = None,
) -> PhysicalEstimates:
    """Return k_c [N m/rad], J_z [kg m^2] and k_d [N m s/rad] of a PT2 from current to yaw angle, by (2.21).

    Parameters
    ----------
    fit
        PT2 from u to psi.
    constants
        ``b``, ``k_tau``, ``r_0``.
    constant_errors
        Standard errors of constants, by name; missing ones count as exact.

    Raises
    ------
    InputError
        If the fit is not a PT2, or its gain is not positive.
    """
    check_fit(fit, "pt2", "yaw", "psi / u")
    return motion_parameters(RUNNING_GEAR, fit, constants, constant_errors, f"(2.21) from the {fit.method}")


def motion_parameters(
    rig: Rig,
    fit: TransferFit,
    constants: Mapping[str, float],
    constant_errors: Mapping[str, float] | None,
    method: str,
) -> PhysicalEstimates:
    """Return stiffness, inertia and damping of a rig from the PT2 of its motion."""
    gain, omega_b, zeta = (fit.values[name] for name in ("gain", "omega_b", "zeta"))
    motion = rig.motion
    assert motion.inertia is not None
    slopes = relative_slopes(motion.drive_gain, constants)
    stiffness = evaluated(motion.drive_gain, constants) / gain
    inertia = stiffness / omega_b**2
    damping = 2.0 * zeta * inertia * omega_b
    # Rows: d ln parameter / d ln (gain, omega_b, zeta, constants of the drive).
    of_fit = np.array([[-1.0, 0.0, 0.0], [-1.0, -2.0, 0.0], [-1.0, -1.0, 1.0]])
    of_drive = np.tile(list(slopes.values()), (3, 1))
    return _propagated(
        {motion.stiffness.name: stiffness, motion.inertia.name: inertia, motion.damping.name: damping},
        np.hstack([of_fit, of_drive]),
        np.array([gain, omega_b, zeta, *(constants[name] for name in slopes)]),
        fit.covariance_of("gain", "omega_b", "zeta"),
        [(constant_errors or {}).get(name, 0.0) for name in slopes],
        method,
    )


def relative_slopes(expression: sp.Expr, values: Mapping[str, float]) -> dict[str, float]:
    """Return the relative change of an expression for one of each of its names: its powers, where it is a product.

    Parameters
    ----------
    expression, values
        As for `evaluated`.
    """
    return {
        symbol.name: evaluated(derivative(expression, symbol) * symbol / expression, values)
        for symbol in sorted(expression.free_symbols, key=str)
    }


def lateral_parameters(
    fit: TransferFit,
    constants: Mapping[str, float],
    constant_errors: Mapping[str, float] | None = None,
    known_l_0: tuple[float, float] | None = None,
) -> PhysicalEstimates:
    """Return l_0 [m] and c_y of a PT1 from yaw angle to lateral displacement, by (2.24) with v on the right side.

    Gain and break frequency are used with their covariance: above the break frequency the PT1 is an integrator with slope v c_y,
    so their errors largely cancel in c_y.

    Parameters
    ----------
    fit
        PT1 from psi to y.
    constants
        ``v`` [m/s].
    constant_errors
        Standard errors of constants, by name; missing ones count as exact.
    known_l_0
        Value and standard error of a measured length [m]. It replaces the static gain in c_y: a break frequency is a time, so the
        scales of both sensors then cancel.

    Raises
    ------
    InputError
        If the fit is not a PT1, or its gain or the known length is not positive.
    """
    check_fit(fit, "pt1", "lateral", "y / psi")
    gain, omega_b, speed = fit.values["gain"], fit.values["omega_b"], constants["v"]
    speed_error = (constant_errors or {}).get("v", 0.0)
    if known_l_0 is None:
        l_0 = gain / 2.0
        powers = np.array([[1.0, 0.0, 0.0], [1.0, 1.0, -1.0]])
        inputs = np.array([gain, omega_b, speed])
        covariance, errors = fit.covariance_of("gain", "omega_b"), [speed_error]
        how = "(2.24)"
    else:
        l_0, l_0_error = known_l_0
        if not (l_0 > 0.0 and l_0_error >= 0.0):
            raise InputError(
                f"A known l_0 must be a positive length with an error of at least 0 m, got {known_l_0}."
            )
        powers = np.array([[0.0, 1.0, 0.0], [1.0, 1.0, -1.0]])
        inputs = np.array([omega_b, l_0, speed])
        covariance, errors = fit.covariance_of("omega_b"), [l_0_error, speed_error]
        how = "(2.24b) with the known l_0"
    values = {"l_0": l_0, "c_y": 2.0 * l_0 * omega_b / speed}
    return _propagated(values, powers, inputs, covariance, errors, f"{how} from the {fit.method}")


def static_lateral(l_0: float) -> tuple[float, float]:
    """Return the lateral displacement per yaw angle at rest [m/rad], and its derivative with respect to l_0."""
    gain = ROLLING.static_gain
    (length,) = gain.free_symbols
    numbers = {length.name: l_0}
    return evaluated(gain, numbers), evaluated(derivative(gain, length), numbers)


def check_fit(fit: TransferFit, order: str, which: str, ratio: str) -> None:
    """Raise an error for a fit of another order, or with a negative gain, which shows that a signal has the opposite sign."""
    if fit.form.order != order:
        raise InputError(
            f"The {which} parameters need a {order.upper()} ({ratio}), got a {fit.form.order.upper()}."
        )
    if not fit.values["gain"] > 0.0:
        raise InputError(
            f"The {which} parameters need a positive gain of {ratio}, got {fit.values['gain']:.4g} {fit.unit}: a sensor or the "
            f"current has the opposite sign. Change the sign of that signal."
        )


def _propagated(
    values: dict[str, float],
    powers: NDArray[np.float64],
    inputs: NDArray[np.float64],
    covariance: NDArray[np.float64],
    independent_errors: list[float],
    method: str,
) -> PhysicalEstimates:
    """Propagate through products of powers: fitted inputs with their covariance, then independent ones."""
    n = covariance.shape[0]
    joint = np.diag(np.concatenate([np.zeros(n), np.square(independent_errors)]))
    joint[:n, :n] = covariance
    chain = np.array(list(values.values()))[:, None] * powers / inputs
    return PhysicalEstimates(tuple(values), values, propagated_covariance(joint, chain), method, _POSITIVE)


def offsets(
    record: Record,
    l_0: float,
    l_0_error: float = 0.0,
    static_gain: float | None = None,
    start: float | None = None,
    stop: float | None = None,
) -> PhysicalEstimates:
    """Return psi_off [rad] and y_off [m] from a stationary stretch of a record, by (2.26) and (2.27).

    Parameters
    ----------
    record
        With u, psi and y.
    l_0, l_0_error
        Distance from wheel carrier to middle frame and its standard error [m].
    static_gain
        psi / u at rest [rad/A], to remove the effect of the mean input; None requires an input with zero mean.
    start, stop
        The stretch [s], default the whole record: a rest, or a constant current. For a sweep use `driven_offsets`.

    Returns
    -------
    Offsets; their errors allow for colored noise. The errors of y_off and psi_off are correlated through (2.27).

    Raises
    ------
    InputError
        If the stretch is too short, or the input has a mean and no static gain is given.
    """
    begin = record.t[0] if start is None else start
    end = record.t[-1] if stop is None else stop
    inside = (record.t >= begin - 0.5 * record.dt) & (record.t <= end + 0.5 * record.dt)
    what = f"Record '{record.name}', {begin:g} to {end:g} s"
    if np.count_nonzero(inside) < _LEAST_SAMPLES:
        raise InputError(
            f"{what}: {np.count_nonzero(inside)} samples are too few for a stationary stretch; at least {_LEAST_SAMPLES} are "
            f"needed."
        )
    u_mean = float(np.mean(record["u"][inside]))
    size = float(np.max(np.abs(record["u"])))
    if static_gain is None and abs(u_mean) > _RESTS * size:
        raise InputError(
            f"{what}: the current has a mean of {u_mean:.3g} A, which also moves psi and y. Choose a stretch at zero current or "
            "give static_gain."
        )
    psi_mean, psi_error = _mean(record["psi"][inside])
    y_mean, y_error = _mean(record["y"][inside])
    pushed = u_mean * (static_gain or 0.0)
    psi_off = psi_mean - pushed
    # (2.27) with the stationary yaw angle, because the yaw angle due to the current moves y too.
    per_radian, per_length = static_lateral(l_0)
    y_off = y_mean - per_radian * psi_mean
    chain = np.array([[1.0, 0.0, 0.0], [-per_radian, 1.0, -per_length * psi_mean]])
    covariance = chain @ np.diag(np.square([psi_error, y_error, l_0_error])) @ chain.T
    values = {"psi_off": psi_off, "y_off": y_off}
    return PhysicalEstimates(tuple(values), values, covariance, f"(2.26), (2.27) from {what}")


def _mean(samples: NDArray[np.float64]) -> tuple[float, float]:
    mean = float(np.mean(samples))
    variance = colored_covariance([(samples - mean, np.ones((samples.size, 1)))], 1)
    return mean, float(np.sqrt(variance[0, 0]))


def creep_error_of_sine(
    omega: float,
    psi_amplitude: float,
    y_noise: float,
    n_samples: int,
    l_0: float,
    omega_b: float,
) -> tuple[float, float]:
    """Return the smallest possible relative standard errors of l_0 and of c_y from a sine record.

    Cramer-Rao bound for white noise on y and an exact psi. With ``G = 2 l_0 omega_b / (s + omega_b)`` and
    ``omega_b = v c_y / (2 l_0)``: ``dG/d ln c_y = 2 l_0 omega_b s / (s + omega_b)^2`` and
    ``dG/d ln l_0 = 2 l_0 omega_b^2 / (s + omega_b)^2``. They are 90 degrees apart at every frequency, so l_0 and c_y are
    independent in every sine record, and the first is largest at the break frequency, which is best for c_y.

    Parameters
    ----------
    omega
        Angular frequency of the sine [rad/s].
    psi_amplitude
        Amplitude of the yaw angle [rad].
    y_noise
        Standard deviation of the noise of y [m].
    n_samples
        Number of samples of the record, which has whole periods.
    l_0, omega_b
        Distance [m] and break frequency [rad/s].
    """
    common = evaluated(ROLLING.static_gain, {"l_0": l_0}) * omega_b / (omega**2 + omega_b**2)
    per_sine = y_noise * math.sqrt(2.0 / n_samples) / psi_amplitude
    return per_sine / (common * omega_b), per_sine / (common * omega)

"""Which input signals to drive a rig with: sweeps and steps as samples over given times."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError


def linear_sweep(
    t: NDArray[np.float64], amplitude: float, omega_start: float, omega_stop: float
) -> NDArray[np.float64]:
    """Return a sine whose angular frequency changes linearly in time, shape (n_samples,).

    Parameters
    ----------
    t
        Equally spaced times [s], shape (n_samples,); the sweep begins at the first and ends at the last.
    amplitude
        Amplitude, in the unit of the input.
    omega_start, omega_stop
        Angular frequency at the first and the last sample [rad/s].

    Raises
    ------
    InputError
        If an angular frequency is negative or above the Nyquist frequency.

    Notes
    -----
    Thesis, equation (2.4): ``s(t) = exp(j 2 pi (f_0 t + k t^2 / 2))`` with ``k = (f_1 - f_0) / T``, of which this is the
    imaginary part, so that the sweep begins at zero.
    """
    tau, duration = _elapsed(t)
    _check_frequencies(t, omega_start, omega_stop, lowest=0.0)
    rate = (omega_stop - omega_start) / duration
    return np.asarray(amplitude * np.sin(omega_start * tau + 0.5 * rate * tau**2))


def log_sweep(
    t: NDArray[np.float64], amplitude: float, omega_start: float, omega_stop: float
) -> NDArray[np.float64]:
    """Return a sine that spends the same time on every octave, shape (n_samples,).

    Parameters
    ----------
    t
        Equally spaced times [s], shape (n_samples,); the sweep begins at the first and ends at the last.
    amplitude
        Amplitude, in the unit of the input.
    omega_start, omega_stop
        Angular frequency at the first and the last sample [rad/s], both above zero.

    Raises
    ------
    InputError
        If an angular frequency is not positive or above the Nyquist frequency.

    Notes
    -----
    ``omega(t) = omega_start (omega_stop / omega_start)^(t / T)``; the thesis identifies from such a sweep (section 4.2).
    """
    tau, duration = _elapsed(t)
    _check_frequencies(t, omega_start, omega_stop, lowest=math.ulp(0.0))
    growth = math.log(omega_stop / omega_start) / duration
    if growth == 0.0:
        return np.asarray(amplitude * np.sin(omega_start * tau))
    return np.asarray(amplitude * np.sin(omega_start / growth * np.expm1(growth * tau)))


def step(t: NDArray[np.float64], amplitude: float, start: float) -> NDArray[np.float64]:
    """Return zero before the time `start` [s] and `amplitude` from it on, shape (n_samples,).

    Parameters
    ----------
    t
        Times [s], shape (n_samples,).
    amplitude
        Height of the step, in the unit of the input.
    start
        Time of the step [s].
    """
    return np.where(t >= start, amplitude, 0.0)


def _elapsed(t: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    if t.ndim != 1 or t.size < 2:
        raise InputError(
            f"A sweep needs times of shape (n_samples,) with at least two samples, got {t.shape}."
        )
    tau = t - t[0]
    return tau, float(tau[-1])


def _check_frequencies(t: NDArray[np.float64], omega_start: float, omega_stop: float, lowest: float) -> None:
    nyquist = math.pi * (t.size - 1) / float(t[-1] - t[0])
    for what, omega in (("start", omega_start), ("end", omega_stop)):
        if not lowest <= omega <= nyquist:
            least = "at least 0" if lowest == 0.0 else "above 0"
            raise InputError(
                f"The sweep's {what} frequency must be {least} and at most the Nyquist frequency {nyquist:.4g} rad/s, "
                f"got {omega:g} rad/s."
            )

"""Inputs whose frequency or level changes over time: sweeps, stepped sines and steps, as samples at given times."""

from __future__ import annotations

import math

import numpy as np

from rigsight.errors import InputError
from rigsight.records.record import Floats


def linear_sweep(t: Floats, amplitude: float, omega_start: float, omega_stop: float) -> Floats:
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


def log_sweep(t: Floats, amplitude: float, omega_start: float, omega_stop: float) -> Floats:
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


def step(t: Floats, amplitude: float, start: float) -> Floats:
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


def stepped_sine(t: Floats, amplitude: float, omega: Floats, cycles: int = 10) -> Floats:
    """Return one sine after the other without a break, each for whole periods, then zero, shape (n_samples,).

    Parameters
    ----------
    t
        Equally spaced times [s], shape (n_samples,); the first sine begins at the first.
    amplitude
        Amplitude, in the unit of the input.
    omega
        Angular frequencies [rad/s] in the order of their turns, shape (n_frequencies,).
    cycles
        Periods of each frequency.

    Raises
    ------
    InputError
        If a frequency is not positive or above the Nyquist frequency, or the times are too short for all periods.
    """
    tau, duration = _elapsed(t)
    wished = np.asarray(omega, dtype=np.float64)
    if wished.ndim != 1 or wished.size == 0 or cycles < 1:
        raise InputError(
            f"A stepped sine needs frequencies of shape (n_frequencies,) and at least one period of each, got shape "
            f"{wished.shape} and {cycles} periods."
        )
    _check_frequencies(t, float(wished.min()), float(wished.max()), math.ulp(0.0), ("lowest", "highest"))
    ends = np.concatenate([[0.0], np.cumsum(2.0 * np.pi * cycles / wished)])
    # The last period ends one sample after the last one, as the last sample of a period is not its first.
    if ends[-1] > (duration + tau[1]) * (1.0 + 1e-9):
        raise InputError(
            f"{cycles} periods of {wished.size} frequencies last {ends[-1]:.4g} s, and the times {duration:.4g} s: give a longer "
            f"duration, fewer periods or fewer low frequencies."
        )
    phase = np.interp(tau, ends, 2.0 * np.pi * cycles * np.arange(ends.size))
    return np.where(tau < ends[-1], amplitude * np.sin(phase), 0.0)


def time_bandwidth_product(duration: float, omega_start: float, omega_stop: float) -> float:
    """Return duration [s] times the swept band, ``T |f_1 - f_0|``, from angular frequencies [rad/s].

    Above some 100 the magnitude of a linear sweep's spectrum is nearly flat within the band and falls off sharply beside it
    (thesis, section 2.1.3).
    """
    return duration * abs(omega_stop - omega_start) / (2.0 * math.pi)


def _elapsed(t: Floats) -> tuple[Floats, float]:
    if t.ndim != 1 or t.size < 2:
        raise InputError(
            f"A sweep needs times of shape (n_samples,) with at least two samples, got {t.shape}."
        )
    tau = t - t[0]
    return tau, float(tau[-1])


def _check_frequencies(
    t: Floats, omega_start: float, omega_stop: float, lowest: float, names: tuple[str, str] = ("start", "end")
) -> None:
    nyquist = math.pi * (t.size - 1) / float(t[-1] - t[0])
    for what, omega in zip(names, (omega_start, omega_stop), strict=True):
        if not lowest <= omega <= nyquist:
            least = "at least 0" if lowest == 0.0 else "above 0"
            raise InputError(
                f"The {what} frequency must be {least} and at most the Nyquist frequency {nyquist:.4g} rad/s, "
                f"got {omega:g} rad/s."
            )

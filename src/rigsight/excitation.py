"""Input signals for experiments: sweeps, steps, and multisines with random phases on chosen spectral lines.

References
----------
R. Pintelon and J. Schoukens, *System Identification: A Frequency Domain Approach* (Wiley 2012), chapters 4 and 5, for
multisines. E. Van der Ouderaa, J. Schoukens and J. Renneboog, "Peak factor minimization using a time-frequency domain swapping
algorithm", IEEE Trans. Instrumentation and Measurement (1988), for the crest factor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rigsight.errors import InputError, check_option
from rigsight.records.record import Floats

Lines = Literal["full", "odd", "odd_random"]

_CLIP = 0.9
"""Share of the peak that an iteration clips at: lower converges faster, and to a higher crest factor."""


def crest_factor(signal: Floats) -> float:
    """Return the peak over the root mean square of a signal of shape (n_samples,); a sine has the square root of 2.

    Raises
    ------
    InputError
        If the signal is zero everywhere.
    """
    effective = math.sqrt(float(np.mean(np.square(signal))))
    if effective == 0.0:
        raise InputError("A signal that is zero everywhere has no crest factor.")
    return float(np.max(np.abs(signal))) / effective


@dataclass(frozen=True, eq=False)
class Multisine:
    """One period of a sum of sines.

    Attributes
    ----------
    dt
        Sample time [s].
    lines
        Excited multiples of the fundamental, increasing, shape (n_lines,).
    amplitudes
        Amplitude of each sine, in the unit of the input, shape (n_lines,).
    phases
        Phase of each cosine at the first sample [rad], shape (n_lines,).
    samples
        One period, shape (n_per_period,).
    """

    dt: float
    lines: NDArray[np.int_]
    amplitudes: Floats
    phases: Floats
    samples: Floats

    @property
    def omega(self) -> Floats:
        """Angular frequencies of the lines [rad/s], shape (n_lines,)."""
        return np.asarray(2.0 * np.pi * self.lines / (self.samples.size * self.dt))

    @property
    def crest_factor(self) -> float:
        """Peak over root mean square."""
        return crest_factor(self.samples)

    def periods(self, count: int) -> Floats:
        """Return `count` periods, shape (count * n_per_period,).

        Raises
        ------
        InputError
            If `count` is below one.
        """
        if count < 1:
            raise InputError(f"A multisine lasts at least one period, got {count}.")
        return np.tile(self.samples, count)


def multisine_lines(
    n_per_period: int,
    dt: float,
    omega_lower: float,
    omega_upper: float,
    kind: Lines = "full",
    rng: np.random.Generator | None = None,
    group: int = 4,
) -> NDArray[np.int_]:
    """Return the multiples of the fundamental to excite, shape (n_lines,).

    Parameters
    ----------
    n_per_period
        Samples in one period; its length sets the distance of the lines.
    dt
        Sample time [s].
    omega_lower, omega_upper
        Limits of the band [rad/s].
    kind
        ``"full"``: all; ``"odd"``: odd multiples, so that even distortion falls beside them; ``"odd_random"``: of every
        `group` odd multiples a random one is left out, so that odd distortion shows there.
    rng
        Chooses the lines to leave out; only ``"odd_random"`` needs it.
    group
        Odd multiples per detection line, at least 2.

    Raises
    ------
    InputError
        If the band holds no line, reaches the Nyquist frequency, or is too narrow for one group.
    """
    check_option("The kind of lines", kind, get_args(Lines))
    fundamental = 2.0 * math.pi / (n_per_period * dt)
    nyquist = math.pi / dt
    if not 0.0 <= omega_lower <= omega_upper < nyquist:
        raise InputError(
            f"A multisine needs 0 <= lower <= upper limit < Nyquist frequency {nyquist:.4g} rad/s, got {omega_lower:g} and "
            f"{omega_upper:g} rad/s."
        )
    first = max(math.ceil(omega_lower / fundamental - 1e-9), 1)
    lines = np.arange(first, math.floor(omega_upper / fundamental + 1e-9) + 1)
    if kind != "full":
        lines = lines[lines % 2 == 1]
    needed = group if kind == "odd_random" else 1
    if lines.size < needed:
        raise InputError(
            f"The band {omega_lower:g} to {omega_upper:g} rad/s holds {lines.size} lines of kind '{kind}' at a distance of "
            f"{fundamental:.4g} rad/s, and needs {needed}: widen it, or use a longer period."
        )
    if kind != "odd_random":
        return lines
    if rng is None or group < 2:
        raise InputError(
            f"Random detection lines need a random generator and groups of at least 2 lines, got group {group}."
        )
    groups = lines.size // group
    omitted = group * np.arange(groups) + rng.integers(group, size=groups)
    return np.delete(lines, omitted)


def multisine(
    n_per_period: int,
    dt: float,
    lines: NDArray[np.int_],
    effective: float,
    rng: np.random.Generator,
    spectrum: ArrayLike = 1.0,
    crest_iterations: int = 0,
) -> Multisine:
    """Return one period of a multisine with independent, uniformly distributed phases.

    Parameters
    ----------
    n_per_period
        Samples in one period.
    dt
        Sample time [s].
    lines
        Multiples of the fundamental to excite, shape (n_lines,), as of `multisine_lines`.
    effective
        Root mean square, in the unit of the input.
    rng
        Draws the phases.
    spectrum
        Relative amplitudes of the lines, positive, one number or shape (n_lines,); they are scaled to `effective`.
    crest_iterations
        Rounds of clipping that lower the crest factor. The phases are random no more then: leave it at 0 for realisations
        that a best linear approximation is averaged over.

    Raises
    ------
    InputError
        If lines repeat or lie outside 1 to below the Nyquist line, or an amplitude or `effective` is not positive.
    """
    chosen = np.unique(lines)
    if chosen.size == 0 or chosen.size != np.size(lines) or chosen[0] < 1 or 2 * chosen[-1] >= n_per_period:
        raise InputError(
            f"Lines must be different whole numbers from 1 to below {n_per_period / 2:g}, half the samples of a period."
        )
    try:
        relative = np.broadcast_to(np.asarray(spectrum, dtype=np.float64), chosen.shape)
    except ValueError:
        raise InputError(
            f"The spectrum must be one number or of shape {chosen.shape}, got {np.shape(spectrum)}."
        ) from None
    if not ((relative > 0.0).all() and np.isfinite(relative).all() and 0.0 < effective < math.inf):
        raise InputError("Amplitudes of lines and the root mean square must be positive, finite numbers.")
    # Amplitudes belong to the lines as they were given, whatever their order.
    amplitudes = relative[np.argsort(lines)]
    amplitudes = amplitudes * (effective * math.sqrt(2.0) / float(np.linalg.norm(amplitudes)))

    def period(phases: Floats) -> Floats:
        coefficients = np.zeros(n_per_period // 2 + 1, dtype=np.complex128)
        coefficients[chosen] = 0.5 * n_per_period * amplitudes * np.exp(1j * phases)
        return np.asarray(np.fft.irfft(coefficients, n_per_period))

    phases = rng.uniform(0.0, 2.0 * np.pi, chosen.size)
    samples = period(phases)
    best = phases, samples
    for _ in range(crest_iterations):
        peak = _CLIP * float(np.max(np.abs(samples)))
        phases = np.angle(np.fft.rfft(np.clip(samples, -peak, peak))[chosen])
        samples = period(phases)
        if crest_factor(samples) < crest_factor(best[1]):
            best = phases, samples
    return Multisine(dt=dt, lines=chosen, amplitudes=amplitudes, phases=best[0], samples=best[1])


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
    t, amplitude, omega_start, omega_stop
        As of `linear_sweep`, with angular frequencies above zero.

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


def _elapsed(t: Floats) -> tuple[Floats, float]:
    if t.ndim != 1 or t.size < 2:
        raise InputError(
            f"A sweep needs times of shape (n_samples,) with at least two samples, got {t.shape}."
        )
    tau = t - t[0]
    return tau, float(tau[-1])


def _check_frequencies(t: Floats, omega_start: float, omega_stop: float, lowest: float) -> None:
    nyquist = math.pi * (t.size - 1) / float(t[-1] - t[0])
    for what, omega in (("start", omega_start), ("end", omega_stop)):
        if not lowest <= omega <= nyquist:
            least = "at least 0" if lowest == 0.0 else "above 0"
            raise InputError(
                f"The {what} frequency must be {least} and at most the Nyquist frequency {nyquist:.4g} rad/s, "
                f"got {omega:g} rad/s."
            )

"""The two signals of a record that an estimator reads, and the frequencies at which the source is excited."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.records.record import Floats, Hold, Record

_UNEXCITED = 1e-4
"""Power, relative to the strongest frequency, below which a source counts as silent: 40 dB."""


def pair_unit(record: Record, source: str, response: str) -> str:
    """Return the unit of response over source, ``"1"`` where both are dimensionless."""
    return ratio_unit(record.units.get(response, ""), record.units.get(source, ""))


def ratio_unit(above: str, below: str) -> str:
    """Return the unit of a ratio, ``"1"`` where both are dimensionless."""
    if (below or "1") == "1":
        return above or "1"
    return f"{above or '1'}/({below})" if " " in below else f"{above or '1'}/{below}"


def check_alike(records: Sequence[Record], source: str, response: str) -> None:
    """Check that the records can be averaged."""
    if not records:
        raise InputError("A frequency response needs at least one record, got none.")
    first = records[0]
    for record in records:
        record[source], record[response]
        if not math.isclose(record.dt, first.dt, rel_tol=1e-9):
            raise InputError(
                f"Records to be averaged need the same sample time: '{first.name}' has {first.dt:g} s, "
                f"'{record.name}' {record.dt:g} s."
            )
        units = pair_unit(first, source, response), pair_unit(record, source, response)
        if units[0] != units[1]:
            raise InputError(
                f"Records to be averaged need the same units: '{first.name}' gives {units[0]}, '{record.name}' {units[1]}."
            )


def line_frequencies(n_samples: int, dt: float) -> Floats:
    """Return the angular frequencies between zero and Nyquist, both excluded, of `n_samples` samples [rad/s]."""
    # Shape ((n_samples - 1) // 2,); they are lines ``1 : (n_samples + 1) // 2`` of a real Fourier transform.
    lines = np.arange(1, (n_samples + 1) // 2, dtype=np.float64)
    return np.asarray(lines * (2.0 * math.pi / (n_samples * dt)), dtype=np.float64)


def among(omega: Floats, wanted: Floats) -> NDArray[np.bool_]:
    """Return which frequencies are lines of another spectrum of records of the same length, shape (n_frequencies,)."""
    nearest = wanted[np.clip(np.searchsorted(wanted, omega) - np.array([[1], [0]]), 0, wanted.size - 1)]
    return np.asarray(np.min(np.abs(nearest - omega), axis=0) <= 1e-6 * omega)


def hold_response(omega: Floats, dt: float, hold: Hold) -> NDArray[np.complex128]:
    """Return the factor by which a hold changes the ratio of sampled signals, shape (n_frequencies,).

    Samples of the response divided by samples of a held source show ``G(j omega)`` times this factor, and images of
    ``G`` around multiples of the sampling frequency, which are small for a response that falls off below Nyquist.

    Parameters
    ----------
    omega
        Angular frequencies [rad/s], shape (n_frequencies,).
    dt
        Sample time [s].
    hold
        The source between its samples: constant (``"zoh"``), on a straight line (``"foh"``), or without content above the
        Nyquist frequency (``"band_limited"``: the factor is 1), like a measured motion.

    References
    ----------
    K. J. Astrom and B. Wittenmark, *Computer-Controlled Systems* (Prentice Hall 1997).
    """
    half = 0.5 * omega * dt
    sinc = np.sinc(half / np.pi)
    if hold == "zoh":
        return np.asarray(sinc * np.exp(-1j * half))
    if hold == "foh":
        return np.asarray(sinc**2, dtype=np.complex128)
    return np.ones(omega.shape, dtype=np.complex128)


def excited(omega: Floats, power: Floats, band: tuple[float, float] | None, what: str) -> NDArray[np.bool_]:
    """Return which frequencies can be estimated, shape (n_frequencies,)."""
    # A frequency is silent if its power is 40 dB below the strongest both per rad/s and per octave: neither the falling
    # density of a logarithmic sweep nor the few low octaves of a linear one are a lack of excitation.
    strongest, per_octave = power.max(initial=0.0), omega * power
    if strongest <= 0.0:
        raise InputError(f"{what} is constant: without excitation there is no frequency response.")
    is_excited = np.asarray(
        (power >= _UNEXCITED * strongest) | (per_octave >= _UNEXCITED * per_octave.max()), dtype=np.bool_
    )
    if band is None:
        return is_excited
    lower, upper = band
    if not 0.0 <= lower < upper:
        raise InputError(
            f"A band needs 0 <= lower < upper limit, got {lower:g} and {upper:g} rad/s: swap or widen them."
        )
    wished = np.asarray((omega >= lower) & (omega <= upper), dtype=np.bool_)
    if not wished.any():
        raise InputError(
            f"{what} has no frequency from {lower:g} to {upper:g} rad/s; it reaches from {omega[0]:.4g} to "
            f"{omega[-1]:.4g} rad/s in steps of {omega[1] - omega[0] if omega.size > 1 else omega[0]:.4g} rad/s."
        )
    silent = wished & ~is_excited
    if silent.any():
        excited_omega = omega[is_excited]
        raise InputError(
            f"{what} does not excite {omega[silent][0]:.4g} to {omega[silent][-1]:.4g} rad/s of the requested band, "
            f"{lower:g} to {upper:g} rad/s. It excites {excited_omega[0]:.4g} to {excited_omega[-1]:.4g} rad/s: choose a band "
            "within, or record with a wider excitation."
        )
    return wished


class TooShortError(InputError):
    """A record is too short for the resolution that was asked for."""


def check_resolution(resolution: float, duration: float, needed: float, what: str) -> None:
    """Check that a record is long enough for a resolution."""
    if not (math.isfinite(resolution) and resolution > 0.0):
        raise InputError(f"A resolution must be a positive number of rad/s, got {resolution!r}.")
    line = 2.0 * math.pi / duration
    if resolution < needed * line * (1.0 - 1e-9):
        raise TooShortError(
            f"{what} lasts {duration:.4g} s: too short for a resolution of {resolution:.4g} rad/s. Record at least "
            f"{needed * 2.0 * math.pi / resolution:.4g} s, or allow at least {needed * line:.4g} rad/s."
        )

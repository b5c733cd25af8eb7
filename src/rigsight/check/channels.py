"""What each channel of a record holds: range, rest, noise, and the signal over noise in each octave.

References
----------
J. S. Bendat and A. G. Piersol, *Random Data* (Wiley 2010), chapter 7, for the multiple coherence of several inputs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import csd

from rigsight.records import Floats, Record, is_constant
from rigsight.rigs import Rig

_SEGMENTS = 16
"""Segments of a spectrum beyond the number of inputs: fewer would raise the coherence of noise above a half."""
_LONGEST = 2**16
"""Samples of a segment: longer ones resolve more than octaves need."""
_TOP = 0.85
"""Share of the spectral lines above which no rig responds (an assumption)."""
_HELD = 0.5
"""Share of the samples that equal the one before from which a signal is held (a convention)."""
_FEWEST_LINES = 8
_SCATTER = 1.2
"""Standard deviation of the step of the logarithm of the power from line to line: that of noise is 1.81."""
_CLEAR = 3.0
"""Signal over noise [dB] from which an octave counts as usable: twice the noise power."""


@dataclass(frozen=True)
class Octave:
    """Power of what the inputs explain of a reading over the power of the rest, in one octave."""

    low: float  # [Hz]
    high: float  # [Hz]
    signal_over_noise: float  # [dB]


@dataclass(frozen=True)
class Channel:
    """One signal of a record."""

    name: str
    unit: str
    is_input: bool
    smallest: float
    largest: float
    n_levels: int  # different values
    at_rest: float  # share of the samples that equal the one before
    std: float
    noise: float  # standard deviation of white noise; zero where a signal fills the whole band
    octaves: tuple[Octave, ...] = ()  # of a sensor, where an input moves

    @property
    def usable(self) -> tuple[float, float] | None:
        """First and last frequency [Hz] of the octaves with a clear signal; None without one."""
        clear = [octave for octave in self.octaves if octave.signal_over_noise >= _CLEAR]
        return (clear[0].low, clear[-1].high) if clear else None


@dataclass(frozen=True)
class CheckedRecord:
    """One record and its channels."""

    name: str
    role: str
    duration: float  # [s]
    rate: float  # [Hz]
    n_samples: int
    clock_uncertainty: float  # [s]
    channels: tuple[Channel, ...]


def checked_record(rig: Rig, record: Record) -> CheckedRecord:
    """Return what a record and its channels hold."""
    inputs = [signal.name for signal in rig.inputs if signal.name in record]
    moving = [record[name] for name in inputs if not is_constant(record[name])]
    channels = []
    for name, unit in rig.signal_units.items():
        if name in record:
            samples, is_input = record[name], name in inputs
            channels.append(
                Channel(
                    name,
                    unit,
                    is_input,
                    float(np.min(samples)),
                    float(np.max(samples)),
                    int(np.unique(samples).size),
                    float(np.mean(np.diff(samples) == 0.0)),
                    float(np.std(samples)),
                    _white_noise(samples),
                    () if is_input else _octaves(moving, samples, record.dt),
                )
            )
    return CheckedRecord(
        record.name,
        record.role,
        record.duration,
        1.0 / record.dt,
        record.n_samples,
        record.clock_uncertainty,
        tuple(channels),
    )


def _white_noise(samples: Floats) -> float:
    """Return the standard deviation of the white noise at the top of the spectrum; zero where a signal reaches up there."""
    # The powers of lines of noise scatter, those of a sweep or a step do not. A signal that mostly stands still is a command.
    if np.mean(np.diff(samples) == 0.0) > _HELD:
        return 0.0
    window = np.hanning(samples.size)
    lines = np.abs(np.fft.rfft((samples - np.mean(samples)) * window)) ** 2 / np.sum(window**2)
    # Lines next to each other share what the window lets through.
    power = lines[int(_TOP * lines.size) :: 2]
    if power.size < _FEWEST_LINES or np.min(power) <= 0.0 or np.std(np.diff(np.log(power))) < _SCATTER:
        return 0.0
    # The power of a line of noise is exponentially distributed: its median is log 2 times its mean.
    return float(np.sqrt(np.median(power) / np.log(2.0)))


def _octaves(inputs: Sequence[Floats], reading: Floats, dt: float) -> tuple[Octave, ...]:
    """Return the signal over noise of a reading in each octave, from the coherence with all inputs; distortion is noise here."""
    n_segments = _SEGMENTS + len(inputs)
    length = min(_LONGEST, 2 * reading.size // (n_segments + 1))
    if not inputs or is_constant(reading) or length < 16:
        return ()

    def spectrum(first: Floats, second: Floats) -> NDArray[np.complex128]:
        return np.asarray(csd(first, second, 1.0 / dt, nperseg=length)[1])

    f = np.fft.rfftfreq(length, dt)
    power = spectrum(reading, reading).real
    among = np.moveaxis(np.array([[spectrum(a, b) for b in inputs] for a in inputs]), 2, 0)
    across = np.array([spectrum(a, reading) for a in inputs]).T
    response = np.einsum("kij,kj->ki", np.linalg.pinv(among, hermitian=True), across)
    explained = np.clip(np.einsum("ki,ki->k", across.conj(), response).real, 0.0, power)
    # What so few segments show of pure noise.
    by_chance = len(inputs) / n_segments
    found = []
    for low in f[1] * 2.0 ** np.arange(np.log2(f[-1] / f[1])):
        inside = (f >= low) & (f < 2.0 * low)
        whole, own = float(np.sum(power[inside])), float(np.sum(explained[inside]))
        signal = max(own - by_chance * whole, 0.0)
        ratio = signal / max(whole - own, 1e-12 * whole) if whole > 0.0 else 0.0
        found.append(Octave(float(low), float(2.0 * low), float(10.0 * np.log10(np.clip(ratio, 1e-3, 1e9)))))
    return tuple(found)

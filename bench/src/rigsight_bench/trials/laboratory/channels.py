"""Channels of a data logger: noise, an anti-aliasing filter, quantization of an encoder."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfilt, sosfilt_zi, unit_impulse

Floats = NDArray[np.float64]

_ORDER = 4
"""Of the Butterworth filter: that of common signal conditioners."""
_SETTLED = 4096
"""Samples after which the answer of a filter is over."""


def sampled(fine: Floats, finer: int, corner: float, noise: float, rng: np.random.Generator) -> Floats:
    """Return the samples of a channel: the signal with noise, behind a filter if there is one.

    Parameters
    ----------
    fine
        The signal `finer` times as often as it is sampled, shape (finer * n_samples,).
    finer
        How much more often.
    corner
        Of the filter, in units of the Nyquist frequency of the samples; 0 without a filter.
    noise
        Standard deviation of the noise in the samples.
    rng
        Source of randomness.

    Returns
    -------
    Shape (n_samples,).
    """
    if corner == 0.0:
        clean = fine[::finer]
        return np.asarray(clean + rng.normal(scale=noise, size=clean.size))
    sections = butter(_ORDER, corner / finer, output="sos")
    # White noise before the filter, of which the filter leaves what is asked for.
    passed = float(np.sqrt(np.sum(sosfilt(sections, unit_impulse(_SETTLED)) ** 2)))
    noisy = fine + rng.normal(scale=noise / passed, size=fine.size)
    settled, _ = sosfilt(sections, noisy, zi=sosfilt_zi(sections) * fine[0])
    return np.asarray(settled[::finer])


def in_steps(samples: Floats, step: float) -> Floats:
    """Return what an encoder with these steps shows; the samples themselves where `step` is 0.

    Parameters
    ----------
    samples
        Shape (n_samples,).
    step
        Of the encoder, in the unit of the samples.
    """
    return samples if step == 0.0 else np.asarray(step * np.round(samples / step))

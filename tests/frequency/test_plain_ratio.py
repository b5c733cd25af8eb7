"""The plain ratio of two spectra is the response and a free motion, exactly."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.signal

from rigsight.frequency import local_rational_response
from rigsight.frequency.spectral import PlainRatio, plain_ratio
from rigsight.records import Record

DT, POLES = 0.01, np.array([-2.0 + 9.0j, -2.0 - 9.0j])


def record(start: float) -> Record:
    """Random motion of a second-order system that begins away from rest."""
    u = np.random.default_rng(1).normal(size=2000)
    system = scipy.signal.lti([], POLES, np.prod(-POLES).real)
    t = DT * np.arange(u.size)
    psi = scipy.signal.lsim(system.to_ss(), u, t, X0=[start, 0.3 * start], interp=False)[1]
    return Record("own", DT, {"u": u, "psi": psi}, {"u": "A", "psi": "rad"}, hold="zoh")


def left(start: float) -> tuple[PlainRatio, np.ndarray]:
    """Return a plain ratio and what the sampled system leaves of it."""
    own = record(start)
    ratio = plain_ratio(own, local_rational_response(own, "u", "psi", hold="zoh"), "zoh")
    numerator, denominator, _ = scipy.signal.cont2discrete(([np.prod(-POLES).real], np.poly(POLES).real), DT)
    sampled = scipy.signal.freqz(numerator[0], denominator, ratio.omega * DT)[1]
    source = np.fft.rfft(own["u"])[1 : ratio.omega.size + 1]
    return ratio, ratio.values - sampled * source / ratio.drive


@pytest.mark.parametrize("start", [0.0, 5.0])
def test_what_the_response_leaves_is_a_free_motion(start: float) -> None:
    ratio, rest = left(start)
    basis = ratio.free_motions(POLES)
    weights = np.linalg.lstsq(
        np.vstack([basis.real, basis.imag]), np.concatenate([rest.real, rest.imag]), rcond=None
    )[0]
    assert np.max(np.abs(rest - basis @ weights)) < 1e-9 * np.max(np.abs(ratio.values))
    alone = np.fft.rfft(ratio.free_motion(weights, POLES))[1 : ratio.omega.size + 1] / ratio.drive
    np.testing.assert_allclose(alone, basis @ weights, rtol=1e-6, atol=1e-12)

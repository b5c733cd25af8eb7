"""Share of a lightly damped peak that a local rational model and a Hann-window H1 show of the same record.

One linear sweep of 100 s drives a PT2 of 12 rad/s; the output carries white noise. The error is that of the peak's height,
relative to the true maximum. H1 is given the segment length (of `SEGMENTS`) whose error over all draws is the least, a choice
that needs the truth; the local model uses its defaults. A height is a maximum over noisy lines, which counts against both.

Run with ``python experiments/linear_recovery/peak.py [draws] [seed]``.
"""

from __future__ import annotations

import sys

import numpy as np
from scipy.signal import lsim, lti

from rigsight.errors import InputError
from rigsight.excitation import linear_sweep
from rigsight.frequency import averaged_response, local_rational_response
from rigsight.records import Record

DT = 0.005
OMEGA_0 = 12.0
"""Resonance [rad/s]."""
SWEPT = (0.6, 60.0)
NEAR = (10.0, 14.0)
"""Where the peak is looked for [rad/s]."""
READ = (2.0, 40.0)
SEGMENTS = (5.0, 10.0, 20.0, 30.0, 40.0, 50.0)
"""Lengths of the segments of H1 [s]; the last leaves three half-overlapping ones."""
NOISES = (0.0, 0.01, 0.1)
"""Standard deviation of the noise over the static response to the sweep's amplitude."""


def errors(
    damping: float, noise: float, draws: int, rng: np.random.Generator
) -> tuple[np.ndarray, dict[float, np.ndarray]]:
    """Return the relative errors of the peak of the local model, and of H1 by segment length, each of shape (draws,)."""
    t = DT * np.arange(20_000)
    u = linear_sweep(t, 1.0, *SWEPT)
    system = lti([OMEGA_0**2], [1.0, 2.0 * damping * OMEGA_0, OMEGA_0**2])
    clean = lsim(system, u, t)[1]
    peak = 1.0 / (2.0 * damping * np.sqrt(1.0 - damping**2))
    local, windowed = [], {length: [] for length in SEGMENTS}
    for _ in range(draws):
        psi = clean + noise * rng.normal(size=t.size)
        record = Record("sweep", DT, {"u": u, "psi": psi}, {"u": "A", "psi": "rad"}, kind="sweep", hold="foh")
        found = local_rational_response(record, "u", "psi", hold="foh", band=READ)
        local.append(found.band(*NEAR).magnitude.max() / peak - 1.0)
        for length in SEGMENTS:
            try:
                found = averaged_response(record, "u", "psi", 2.0 * np.pi / length, hold="foh", band=READ)
            except InputError:
                windowed[length].append(np.nan)
            else:
                windowed[length].append(found.band(*NEAR).magnitude.max() / peak - 1.0)
    return np.array(local), {length: np.array(found) for length, found in windowed.items()}


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def main() -> None:
    draws = int(sys.argv[1]) if len(sys.argv) > 1 else 25
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    rng = np.random.default_rng(seed)
    print(
        "| D | noise | local rational: rms error (mean) | Hann H1, best segments: rms error (mean) | H1 over local |"
    )
    print("|---|---|---|---|---|")
    for damping in (0.01, 0.03):
        for noise in NOISES:
            local, windowed = errors(damping, noise, draws, rng)
            best = min(
                (length for length in SEGMENTS if np.isfinite(windowed[length]).all()),
                key=lambda s: rms(windowed[s]),
            )
            h1 = windowed[best]
            print(
                f"| {damping} | {noise:g} | {rms(local):.3%} ({local.mean():+.3%}) | "
                f"{rms(h1):.2%} ({h1.mean():+.2%}), {best:g} s | {rms(h1) / rms(local):.1f} |"
            )
    print(f"\n{draws} draws, seed {seed}")


if __name__ == "__main__":
    main()

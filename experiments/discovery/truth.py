"""Error of a discovered Bouc-Wen model against the generator of the benchmark, on a noise-free multisine of another amplitude.

The generator is z' = alpha y' - beta (gamma |y'| z + delta y' |z|), m y'' + c y' + k y + z = u (Noel and Schoukens, doi
10.4121/12967592). Its equations are integrated here by scipy, apart from rigsight's simulator.

Run with ``python experiments/discovery/truth.py MODEL [seed]``, MODEL the folder that `rigsight discover` left.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from rigsight.excitation import Multisine, multisine, multisine_lines
from rigsight.metrics import rms
from rigsight.records import Record
from rigsight.simulate import simulate
from rigsight.workflow.campaign.model_file import read_model

M, C, K, ALPHA, BETA, GAMMA, DELTA = 2.0, 10.0, 5e4, 5e4, 1e3, 0.8, -1.1
DT = 1.0 / 750.0
SAMPLES = 4096
BAND = (2.0 * np.pi * 5.0, 2.0 * np.pi * 150.0)
"""Angular frequencies [rad/s]."""
EFFECTIVE = (25.0, 50.0, 75.0)
"""Root mean square of the force [N]; the records have 50."""


def generated(signal: Multisine, periods: int) -> np.ndarray:
    """Return the displacement of the generator, shape (periods * n_per_period,)."""
    omega, amplitudes, phases = signal.omega, signal.amplitudes, signal.phases

    def rates(t: float, state: np.ndarray) -> list[float]:
        y, v, z = state
        u = float(amplitudes @ np.cos(omega * t + phases))
        loop = ALPHA * v - BETA * (GAMMA * abs(v) * z + DELTA * v * abs(z))
        return [v, (u - C * v - K * y - z) / M, loop]

    t = DT * np.arange(periods * signal.samples.size)
    solved = solve_ivp(rates, (0.0, t[-1]), np.zeros(3), "DOP853", t, rtol=1e-9, atol=[1e-12, 1e-9, 1e-7])
    return np.asarray(solved.y[0])


def main(folder: str, seed: int) -> None:
    model = read_model(Path(folder))
    print("| force [N rms] | displacement [m rms] | free-run error [m rms] | NRMSE |\n|---|---|---|---|")
    for number, effective in enumerate(EFFECTIVE):
        rng = np.random.default_rng([seed, number])
        signal = multisine(SAMPLES, DT, multisine_lines(SAMPLES, DT, *BAND), effective, rng)
        truth = generated(signal, 2)
        record = Record(
            name="truth",
            dt=DT,
            signals={"u": signal.periods(2)},
            units={},
            role="validation",
            hold="band_limited",
        )
        # The first period carries both to the periodic answer; only the second is counted.
        own = simulate(model.structure, model.values, record)["x"]
        error, size = rms((own - truth)[SAMPLES:]), rms(truth[SAMPLES:])
        print(f"| {effective:g} | {size:.3g} | {error:.3g} | {100.0 * error / size:.3f} % |")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 1)

"""The simulator compared with a hand-written C program and scipy, in one run: error and time on the hysteretic running gear.

150 s of a logarithmic sweep from 1e-3 to 640 rad/s at 1 A, sampled at 5 ms (30,001 samples), the published set R. Times are
those of the fastest of several runs; compare the ratios, the nanoseconds are this machine's.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from rigsight.effects import effect_named
from rigsight.records.record import Record
from rigsight.rigs import RUNNING_GEAR
from rigsight.rigs.published import published_sets
from rigsight.simulate import (
    compose,
    parameter_vector,
    record_input,
    rest_state,
    simulate_outputs,
    simulate_sets,
)
from rigsight.simulate.side_by_side import choose_substeps

Floats = NDArray[np.float64]

DT = 5e-3
N_SAMPLES = 30_001
ACCURACY = 1e-6
BATCH_ACCURACY = 1e-4
N_SETS = 256
BATCH = 64
STRETCH, N_STRETCHES = 500, 6

C_PROGRAM = r"""
#include <math.h>
typedef struct { double drive, damping, elastic, memory, A, beta, gamma, creep, relax; } model;
static inline void rates(const model *m, double u, const double x[4], double r[4]) {
    double w = x[1], z = x[3], speed = fabs(w);
    r[0] = w;
    r[1] = m->drive * u - m->damping * w - m->elastic * x[0] - m->memory * z;
    r[2] = m->creep * x[0] - m->relax * x[2];
    r[3] = m->A * w - m->beta * speed * z - m->gamma * w * fabs(z);
}
void simulate(const model *m, const double *u, long n, double dt, int substeps, double *psi) {
    double x[4] = {0, 0, 0, 0}, y[4], a[4], b[4], c[4], d[4], h = dt / substeps;
    psi[0] = 0;
    for (long i = 0; i + 1 < n; i++) {
        double slope = (u[i + 1] - u[i]) / dt;
        for (int j = 0; j < substeps; j++) {
            double first = u[i] + slope * j * h, middle = first + 0.5 * h * slope, last = first + h * slope;
            rates(m, first, x, a);
            for (int k = 0; k < 4; k++) y[k] = x[k] + 0.5 * h * a[k];
            rates(m, middle, y, b);
            for (int k = 0; k < 4; k++) y[k] = x[k] + 0.5 * h * b[k];
            rates(m, middle, y, c);
            for (int k = 0; k < 4; k++) y[k] = x[k] + h * c[k];
            rates(m, last, y, d);
            for (int k = 0; k < 4; k++) x[k] += h / 6 * (a[k] + 2 * (b[k] + c[k]) + d[k]);
        }
        psi[i + 1] = x[0];
    }
}
"""


@dataclass(frozen=True)
class Coefficients:
    """The equations of the hysteretic gear as nine numbers, for the programs that rigsight is compared with."""

    drive: float
    damping: float
    elastic: float
    memory: float
    A: float
    beta: float
    gamma: float
    creep: float
    relax: float

    @classmethod
    def of(cls, q: dict[str, float]) -> Coefficients:
        """Return the numbers that the parameters of the rig and the effect give."""
        relax = q["v"] * q["c_y"] / (2.0 * q["l_0"])
        return cls(
            drive=q["b"] * q["k_tau"] / q["r_0"] / q["J_z"],
            damping=q["k_d"] / q["J_z"],
            elastic=q["a"] * q["k_c"] / q["J_z"],
            memory=(1.0 - q["a"]) * q["k_c"] / q["J_z"],
            A=q["A"],
            beta=q["beta"],
            gamma=q["gamma"],
            creep=q["v"] * q["c_y"],
            relax=relax,
        )

    def rates(self, u: float, x: Floats) -> tuple[float, float, float, float]:
        """Return the time derivatives of yaw angle, yaw rate, lateral displacement and z."""
        w, z = x[1], x[3]
        return (
            w,
            self.drive * u - self.damping * w - self.elastic * x[0] - self.memory * z,
            self.creep * x[0] - self.relax * x[2],
            self.A * w - self.beta * abs(w) * z - self.gamma * w * abs(z),
        )


def log_sweep() -> Floats:
    t = DT * np.arange(N_SAMPLES)
    scale = t[-1] / np.log(640.0 / 1e-3)
    return np.sin(1e-3 * scale * np.expm1(t / scale))


def truth(model: Coefficients, u: Floats) -> Floats:
    """States by DOP853 restarted at every sample, shape (n_samples, 4)."""
    states = np.zeros((u.size, 4))
    for i in range(u.size - 1):
        slope = (u[i + 1] - u[i]) / DT

        def rates(t: float, x: Floats, i: int = i, slope: float = slope) -> tuple[float, ...]:
            return model.rates(u[i] + slope * t, x)

        states[i + 1] = solve_ivp(rates, (0.0, DT), states[i], method="DOP853", rtol=1e-10, atol=1e-14).y[
            :, -1
        ]
    return states


def relative_error(simulated: Floats, exact: Floats) -> float:
    return float(np.sqrt(np.mean((simulated - exact) ** 2) / np.mean(exact**2)))


def fastest(run: Callable[[], object], repeats: int = 7) -> float:
    """Seconds of the fastest of several runs; the first, which may compile, is not counted."""
    run()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return min(times)


def c_program(model: Coefficients, u: Floats, exact: Floats) -> tuple[str, float, float] | None:
    """Name, error and nanoseconds per sample of Runge-Kutta in C with the fewest substeps (powers of two) that do."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        source, library = Path(folder, "gear.c"), Path(folder, "gear.so")
        source.write_text(C_PROGRAM, "utf-8")
        command = [
            compiler,
            "-O3",
            "-march=native",
            "-shared",
            "-fPIC",
            str(source),
            "-o",
            str(library),
            "-lm",
        ]
        subprocess.run(command, check=True)
        program = ctypes.CDLL(str(library)).simulate
        doubles = ctypes.POINTER(ctypes.c_double)
        numbers = np.array(list(vars(model).values()))
        psi = np.zeros(u.size)

        def run(substeps: int) -> None:
            program(
                numbers.ctypes.data_as(doubles), u.ctypes.data_as(doubles), ctypes.c_long(u.size),
                ctypes.c_double(DT), ctypes.c_int(substeps), psi.ctypes.data_as(doubles),
            )  # fmt: skip

        for substeps in (2, 4, 8, 16, 32, 64, 128, 256):
            run(substeps)
            error = relative_error(psi, exact)
            if error <= ACCURACY:
                break
        seconds = fastest(lambda: run(substeps))
    return f"C, RK4 with {substeps} substeps (gcc -O3 -march=native)", error, 1e9 * seconds / u.size


def scipy_program(model: Coefficients, u: Floats, states: Floats) -> tuple[str, float, float]:
    """LSODA on stretches spread over the record, each started from the truth, which favors its error."""
    t = DT * np.arange(u.size)
    simulated, exact, seconds = [], [], 0.0
    for first in np.linspace(0, u.size - STRETCH - 1, N_STRETCHES).astype(int):
        part = slice(first, first + STRETCH + 1)
        start = time.perf_counter()
        solution = solve_ivp(
            lambda now, x: model.rates(np.interp(now, t, u), x),
            (t[part][0], t[part][-1]), states[first], method="LSODA", t_eval=t[part], rtol=1e-6, atol=1e-9,
        )  # fmt: skip
        seconds += time.perf_counter() - start
        simulated.append(solution.y[0])
        exact.append(states[part, 0])
    name = f"scipy solve_ivp, LSODA rtol 1e-6 (on {STRETCH * N_STRETCHES:,} of the samples)"
    error = relative_error(np.concatenate(simulated), np.concatenate(exact))
    return name, error, 1e9 * seconds / (STRETCH * N_STRETCHES)


def main() -> None:
    u = log_sweep()
    published = published_sets()["hysteresis_r"]
    values = {**published.values(), "psi_off": 0.0, "y_off": 0.0}
    model = Coefficients.of(values)
    print(
        f"{N_SAMPLES:,} samples of the hysteretic running gear; truth by DOP853, restarted at every sample ..."
    )
    states = truth(model, u)
    exact = states[:, 0]

    structure = compose(RUNNING_GEAR, [effect_named("bouc_wen_hysteresis")], {"n": 1.0})
    record = Record(name="sweep", dt=DT, signals={"u": u}, units={"u": "A"})
    held = record_input(structure, record)
    p = parameter_vector(structure, values)
    state = rest_state(structure, p, held)
    simulated = simulate_outputs(structure, held, p, state, u.size, ACCURACY)
    seconds = fastest(lambda: simulate_outputs(structure, held, p, state, u.size, ACCURACY))
    own = ("rigsight, accuracy 1e-6", relative_error(simulated[:, 0], exact), 1e9 * seconds / u.size)

    rows = [own]
    c_row = c_program(model, u, exact)
    if c_row is None:
        print("No C compiler (gcc or cc) found: the C program is skipped.")
    else:
        rows.append(c_row)
    rows.append(scipy_program(model, u, states))
    print(f"\n{'':72}{'error':>10}{'ns/sample':>12}{'time ratio':>12}")
    for name, error, nanoseconds in rows:
        print(f"{name:72}{error:10.1e}{nanoseconds:12.0f}{nanoseconds / own[2]:12.2f}")

    substeps = choose_substeps(structure, held, p, state, u.size, BATCH_ACCURACY)
    rng = np.random.default_rng(0)
    sets = np.repeat(p[:, None], N_SETS, axis=1)
    for name in ("J_z", "k_c", "k_d", "beta"):
        index = structure.names.index(name)
        sets[index, 1:] *= rng.uniform(0.99, 1.01, N_SETS - 1)
    starts = np.repeat(state[:, None], N_SETS, axis=1)

    def batch(part: slice) -> Floats:
        return simulate_sets(structure, held, sets[:, part], starts[:, part], u.size, substeps)

    error = relative_error(batch(slice(0, 1))[:, 0, 0], exact)
    batches = [slice(first, first + BATCH) for first in range(0, N_SETS, BATCH)]
    one = N_SETS / fastest(lambda: [batch(part)[-1] for part in batches], 3)
    with ThreadPoolExecutor(2) as threads:
        two = N_SETS / fastest(lambda: list(threads.map(lambda part: batch(part)[-1], batches)), 3)
    print(
        f"\nParallel sets, {substeps} substeps, error {error:.1e} (required {BATCH_ACCURACY:g}), all samples:"
    )
    print(f"  one thread   {one:8,.0f} sets/s   {1e9 / one / u.size:6.2f} ns/sample")
    print(f"  two threads  {two:8,.0f} sets/s   {1e9 / two / u.size:6.2f} ns/sample")


if __name__ == "__main__":
    main()

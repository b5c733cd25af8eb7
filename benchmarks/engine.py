"""The engine compared with that of another checkout, in turns: compilation, one parameter set, many sets in parallel.

    python benchmarks/engine.py                                     # this checkout alone
    python benchmarks/engine.py --beside DIR                        # and another, with its own .venv if it has one

Each figure is the best of several runs; compare the ratios, the seconds are this machine's.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

DT = 5e-3
N_SAMPLES = 30_001
N_SETS = 64
ACCURACY = 1e-4
ROUNDS = 3
EFFECTS = {
    "bouc_wen_hysteresis": {"A": 1.0, "a": 0.48, "beta": 7362.0, "gamma": -7164.0, "n": 1.0},
    "coulomb_friction": {"T_c": 0.01},
    "iwan_hysteresis": {"a": 0.3, "x_s": 2e-3, "q": -0.4},
}
GEAR = {
    "v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27,
    "J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "l_0": 0.25, "c_y": 0.98, "psi_off": 0.0, "y_off": 0.0,
}  # fmt: skip


def processor_time() -> float:
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(part.ru_utime + part.ru_stime for part in used)


def fastest(run: Callable[[], object], repeats: int = 4) -> float:
    run()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return min(times)


def compilation() -> dict[str, float]:
    """Processor seconds per structure, each with one effect of the catalogue, from an empty cache."""
    import numpy as np

    from rigsight.effects import CATALOGUE
    from rigsight.records.record import Record
    from rigsight.rigs import AXIS, RUNNING_GEAR
    from rigsight.simulate import compose, parameter_vector, record_input, simulate_outputs, simulate_sets

    found = {}
    for rig in (RUNNING_GEAR, AXIS):
        for effect in CATALOGUE:
            if not rig.offers(effect):
                continue
            structure = compose(rig, [effect], effect.special_cases)
            begin = processor_time()
            values = {p.name: min(max(1.0, p.lower), p.upper) for p in structure.parameters}
            record = Record("r", 1e-3, {"u": np.zeros(3)}, {"u": "A"})
            held, p = record_input(structure, record), parameter_vector(structure, values)
            state = np.zeros(max(1, len(structure.states)))
            simulate_outputs(structure, held, p, state, 3, 1e-3)
            simulate_sets(structure, held, p[:, None], state[:, None], 3, 1)
            found[f"{rig.name}, {effect.name}"] = processor_time() - begin
    return found


def speed() -> dict[str, dict[str, float]]:
    """Nanoseconds per sample of one set at 1e-6, and sets per second at 1e-4 with one and two threads, by effect."""
    import numpy as np

    from rigsight.effects import effect_named
    from rigsight.records.record import Record
    from rigsight.rigs import RUNNING_GEAR
    from rigsight.simulate import (
        compose,
        parameter_vector,
        record_input,
        rest_state,
        simulate_outputs,
        simulate_sets,
    )
    from rigsight.simulate.side_by_side import choose_substeps

    t = DT * np.arange(N_SAMPLES)
    scale = t[-1] / np.log(640.0 / 1e-3)
    record = Record("sweep", DT, {"u": np.sin(1e-3 * scale * np.expm1(t / scale))}, {"u": "A"})
    found = {}
    for name, own in EFFECTS.items():
        structure = compose(RUNNING_GEAR, [effect_named(name)], {"n": 1.0} if "n" in own else {})
        held, p = record_input(structure, record), parameter_vector(structure, {**GEAR, **own})
        state = rest_state(structure, p, held)
        exact = simulate_outputs(structure, held, p, state, N_SAMPLES, 1e-8)[:, 0]
        substeps = choose_substeps(structure, held, p, state, N_SAMPLES, ACCURACY)
        sets = np.repeat(p[:, None], N_SETS, axis=1)
        rng = np.random.default_rng(0)
        for parameter in ("J_z", "k_c", "k_d"):
            sets[structure.names.index(parameter), 1:] *= rng.uniform(0.99, 1.01, N_SETS - 1)
        states = np.repeat(np.asarray(state)[:, None], N_SETS, axis=1)

        def batch(_: int) -> object:
            return simulate_sets(structure, held, sets, states, N_SAMPLES, substeps)[-1, 0, 0]  # noqa: B023

        error = (
            simulate_sets(structure, held, sets[:, :1], states[:, :1], N_SAMPLES, substeps)[:, 0, 0] - exact
        )
        one_set = fastest(lambda: simulate_outputs(structure, held, p, state, N_SAMPLES, 1e-6))  # noqa: B023
        with ThreadPoolExecutor(2) as threads:
            two = fastest(lambda: list(threads.map(batch, range(2))))
        found[name] = {
            "ns per sample": 1e9 * one_set / N_SAMPLES,
            "sets per second": N_SETS / fastest(lambda: batch(0)),
            "sets per second, two threads": 2 * N_SETS / two,
            "error side by side": float(np.sqrt(np.mean(error**2) / np.mean(exact**2))),
        }
    return found


def measured(checkout: Path, what: str, cache: str) -> dict[str, object]:
    """Measure in a process of a checkout's own."""
    own = checkout / ".venv" / "bin" / "python"
    python = str(own) if own.exists() else sys.executable
    environment = {**os.environ, "PYTHONPATH": str(checkout / "src"), "RIGSIGHT_CACHE_DIR": cache}
    run = subprocess.run(
        [python, __file__, "--measure", what], env=environment, capture_output=True, text=True, check=False
    )
    if run.returncode != 0:
        sys.exit(f"{checkout}: {run.stderr}")
    return json.loads(run.stdout)


def middle(values: list[float]) -> float:
    return sorted(values)[len(values) // 2]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--beside", type=Path, help="another checkout")
    parser.add_argument("--measure", choices=("compilation", "speed"), help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.measure:
        print(json.dumps(compilation() if chosen.measure == "compilation" else speed()))
        return
    checkouts = [Path(__file__).resolve().parents[1], *([chosen.beside.resolve()] if chosen.beside else [])]
    with tempfile.TemporaryDirectory() as place:
        caches = [f"{place}/{i}" for i in range(len(checkouts))]
        compiled = [measured(c, "compilation", cache) for c, cache in zip(checkouts, caches, strict=True)]
        print("Processor time per structure [s], median and largest over the catalogue on both driven rigs:")
        for checkout, found in zip(checkouts, compiled, strict=True):
            print(f"  {middle(list(found.values())):6.2f} {max(found.values()):6.2f}  {checkout}")
        rounds = [
            [measured(c, "speed", cache) for c, cache in zip(checkouts, caches, strict=True)]
            for _ in range(ROUNDS)
        ]
    for effect in EFFECTS:
        print(f"\n{effect} on the running gear, {N_SAMPLES:,} samples")
        for figure in (
            "ns per sample",
            "sets per second",
            "sets per second, two threads",
            "error side by side",
        ):
            pick = min if figure == "ns per sample" else max
            best = [pick(one[i][effect][figure] for one in rounds) for i in range(len(checkouts))]
            ratio = f"  ratio {best[0] / best[1]:.2f}" if len(best) > 1 else ""
            print(f"  {figure:32}" + "".join(f"{value:12.3g}" for value in best) + ratio)


if __name__ == "__main__":
    main()

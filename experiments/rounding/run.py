"""Effect of rounding on diagnoses: repetitions with data disturbed by 1e-9 of the noise, other compilers, one and two jobs.

run.py                     all builds, table in results.md beside this file
run.py --trials 3 17       with these trials of the standard blind bench, seed 9 (some minutes each)
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from cases import Case, cases
from threadpoolctl import threadpool_limits

from rigsight.diagnose.diagnosis import diagnose

SHARE = 1e-9
BUILDS: dict[str, dict[str, str]] = {
    "gcc -O3": {"CC": "gcc"},
    "gcc -O1": {"CC": "gcc", "RIGSIGHT_CFLAGS": "-O1"},
    "clang": {"CC": "clang"},
}
ENOUGH = 0.01
"""Standard errors by which numbers may differ."""


def outcome(case: Case, seed: int, n_jobs: int) -> dict[str, Any]:
    """Return what is compared of one diagnosis."""
    with threadpool_limits(limits=1, user_api="blas"):
        found = diagnose(case.disturbed(SHARE, seed), case.effects, n_jobs=n_jobs)
    best = next((c for c in found.candidates if c.effects == found.effects), found.candidates[0])
    return {
        "verdict": " + ".join((found.verdict, *found.effects)),
        "error_over_noise": best.error_over_noise,
        "values": {name: (e.value, e.std) for name, e in best.parameters.items()},
    }


def ways(seeds: int) -> list[tuple[str, int, int]]:
    """Return build, seed of the disturbance and number of jobs of each repetition; the first is what others are compared with."""
    first, *others = BUILDS
    return [
        *((first, seed, 1) for seed in range(seeds + 1)),
        *((build, 0, 1) for build in others),
        (first, 0, 2),
    ]


def line(case: str, repeated: Sequence[dict[str, Any]]) -> str:
    """Return a row of the table."""
    first, *others = repeated
    same = all(other["verdict"] == first["verdict"] for other in others)
    largest, name = 0.0, "-"
    for other in others if same else []:
        for key, (value, std) in first["values"].items():
            moved = abs(other["values"][key][0] - value) / std if std > 0.0 else 0.0
            if moved > largest:
                largest, name = moved, key
    spread = max(abs(other["error_over_noise"] - first["error_over_noise"]) for other in others)
    told = "yes" if same else ", ".join(sorted({r["verdict"] for r in repeated}))
    good = "yes" if same and largest <= ENOUGH else "**no**"
    left = f"{first['error_over_noise']:.4f}"
    return (
        f"| {case} | {first['verdict']} | {left} | {told} | {spread:.1e} | {largest:.1e} ({name}) | {good} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=3, help="disturbances")
    parser.add_argument("--draws", type=int, default=3, help="draws of noise of each case with sliders")
    parser.add_argument(
        "--trials", type=int, nargs="*", default=[], help="trials of the standard bench, seed 9"
    )
    parser.add_argument("--part", nargs=3, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    chosen = cases(asked.draws, tuple(asked.trials))
    if asked.part:
        seed, n_jobs = map(int, asked.part[1:])
        for case in chosen:
            print(json.dumps(outcome(case, seed, n_jobs)), flush=True)
        return
    shared = ["--draws", str(asked.draws), "--trials", *map(str, asked.trials)]

    def repetition(way: tuple[str, int, int]) -> list[dict[str, Any]]:
        # A process each: a kernel that is loaded stays, whatever the variables say later.
        build, seed, n_jobs = way
        command = [sys.executable, __file__, *shared, "--part", build, str(seed), str(n_jobs)]
        told = subprocess.run(
            command, env={**os.environ, **BUILDS[build]}, check=True, capture_output=True, text=True
        )
        return [json.loads(text) for text in told.stdout.splitlines()]

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        table = list(zip(*pool.map(repetition, ways(asked.seeds)), strict=True))
    lines = [line(case.name, row) for case, row in zip(chosen, table, strict=True)]
    head = (
        "# Does a diagnosis depend on rounding?\n\n"
        f"`run.py {' '.join(sys.argv[1:])}`: {asked.seeds} disturbances of {SHARE:g} of the noise, builds {', '.join(BUILDS)}, "
        "one and two jobs; largest difference to the first.\n\n"
        "| case | verdict | floors | same verdict | difference in floors | in standard errors | within 0.01 |\n"
        "|---|---|---|---|---|---|---|\n"
    )
    Path(__file__).with_name("results.md").write_text(head + "\n".join(lines) + "\n", encoding="utf-8")
    print("\n".join(lines))


if __name__ == "__main__":
    main()

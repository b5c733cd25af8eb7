"""Accuracy of the engine (1e-6): every effect over its search box against DOP853; writes results.md beside this file."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from draws import Draw, draws
from joblib import Parallel, delayed
from numpy.typing import NDArray
from truth import Truth

from rigsight.effects import CATALOGUE, effect_named
from rigsight.errors import SimulationError
from rigsight.simulate import parameter_vector, record_input, rest_state, simulate_outputs

WISH = 1e-6
NUDGE = 1e-9
"""Shift of the states at the start, in units of their size, whose growth says how sensitive a motion is by itself."""

FINE_STEPS = 200
"""Least steps of DOP853 between samples where the engine differs from it: which of the two misses something?"""


@dataclass(frozen=True)
class Trial:
    """Relative RMS error of the first output; None where no bounded motion exists. `growth` is how much a shift grows."""

    number: int
    error: float | None
    growth: float
    reason: str = ""


def relative(difference: NDArray[np.float64], of: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.nanmean(difference**2) / (np.nanmean((of - of[0]) ** 2) + 1e-300)))


def tried(number: int, draw: Draw) -> Trial:
    structure, n_samples = draw.structure, draw.record.n_samples
    held = record_input(structure, draw.record)
    p = parameter_vector(structure, draw.values)
    state = rest_state(structure, p, held)
    try:
        simulated = simulate_outputs(structure, held, p, state, n_samples)[:, 0]
        finest = simulate_outputs(structure, held, p, state, n_samples, 3e-5)[:, 0]
    except SimulationError as error:
        return Trial(number, None, 0.0, str(error))
    sizes = np.full(state.size, max(float(np.ptp(finest)), 1e-30))
    try:
        exact = Truth(structure, p, held, sizes).reading(state, n_samples)
        if relative(simulated - exact, exact) > WISH:
            longest = held.interval / FINE_STEPS
            exact = Truth(structure, p, held, sizes, longest).reading(state, n_samples)
    except ArithmeticError as error:
        return Trial(number, None, 0.0, f"DOP853: {error}")
    error = relative(simulated - exact, exact)
    growth = 0.0
    if error > WISH:
        moved = state.copy()
        moved[0] += NUDGE * sizes[0]
        shifted = simulate_outputs(structure, held, p, moved, n_samples, 3e-5)[:, 0]
        growth = relative(shifted - finest, exact) / NUDGE
    return Trial(number, error, growth)


def of_effect(name: str, count: int, seed: int) -> tuple[str, list[Trial]]:
    return name, [tried(i, draw) for i, draw in enumerate(draws(effect_named(name), count, seed))]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--effects", nargs="+", default=[effect.name for effect in CATALOGUE])
    chosen = parser.parse_args()
    names = chosen.effects
    rows, misses, left_out = [], [], []
    results = Parallel(n_jobs=chosen.jobs, return_as="generator")(
        delayed(of_effect)(name, chosen.draws, chosen.seed) for name in names
    )
    for name, trials in results:
        errors = np.array([trial.error for trial in trials if trial.error is not None])
        beside = [trial for trial in trials if trial.error is not None and trial.error > WISH]
        rows.append(
            f"| {name} | {errors.size} | {np.median(errors):.1e} | {errors.max():.1e} | {len(beside)} |"
        )
        misses += [f"| {name} | {t.number} | {t.error:.1e} | {t.growth:.1e} |" for t in beside]
        left_out += [f"- {name} {t.number}: {t.reason}" for t in trials if t.error is None]
        print(rows[-1], flush=True)
    text = [
        f"Written by `python experiments/engine_accuracy/run.py --draws {chosen.draws} --seed {chosen.seed}`.",
        "",
        f"Relative RMS error of the first output of `simulate` (wish {WISH:g}) against DOP853, restarted at samples and kinks.",
        "",
        "| effect | draws | median | largest | above the wish |", "|---|---|---|---|---|", *rows, "",
        "Above the wish, with the factor by which a shift of 1e-9 of the displacement at the start grows by itself:", "",
        "| effect | draw | error | growth |", "|---|---|---|---|", *misses, "",
        "Left out, because there is no bounded motion or no truth:", "", *(left_out or ["- none"]), "",
    ]  # fmt: skip
    Path(__file__).with_name("results.md").write_text("\n".join(text), "utf-8")


if __name__ == "__main__":
    main()

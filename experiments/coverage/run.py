"""Coverage and width of intervals of two standard errors, by the formula and by the bootstrap.

    python experiments/coverage/run.py --seed 1 --draws 6

Every effect of the catalogue is drawn on a rig of one mass (`axis`; `running_gear` where the effect needs one, `element` where
the motion is prescribed), and some on a drive train. The true model is fitted from perturbed parameters and from the true ones,
and the better fit counts. Each draw is a line of ``draws_SEED.jsonl``; draws that stand there are not done again. ``--table``
prints the table alone.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from plants import Drawn, drawn

from rigsight.diagnose.bootstrap import uncertainty_of
from rigsight.diagnose.fit_context import FittedModel, candidates_on
from rigsight.diagnose.search.nested_models import in_lowest_basins
from rigsight.effects import CATALOGUE, Effect
from rigsight.errors import RigsightError
from rigsight.identify import FitResult
from rigsight.rigs import RIGS, Rig

HERE = Path(__file__).parent
ON_DRIVE_TRAIN = (
    "coulomb_friction@motor_bearing",
    "stribeck_friction@load_bearing",
    "backlash@shaft",
    "iwan_hysteresis@shaft",
    "cubic_stiffness@shaft",
    "torque_ripple@load_bearing",
    "sensor_delay@load_angle",
)
OFF = 0.15
"""Standard deviation of the logarithm of the factor by which numbers are off where the first fit begins."""
SAME = 1e-3
"""Relative distance of costs below which two fits have ended at the same place."""


def subjects() -> list[tuple[Rig, Effect]]:
    """Return each rig with each effect."""
    found, kinds = [], set()
    for name in ("axis", "running_gear", "element"):
        for effect in candidates_on(RIGS[name], CATALOGUE):
            if effect.name not in kinds:
                kinds.add(effect.name)
                found.append((RIGS[name], effect))
    on_train = {e.name: e for e in candidates_on(RIGS["drive_train"], CATALOGUE)}
    return found + [(RIGS["drive_train"], on_train[name]) for name in ON_DRIVE_TRAIN]


def fitted(plant: Drawn, rng: np.random.Generator) -> tuple[FitResult, bool]:
    """Return the better of two fits of the true model, and whether the one from perturbed numbers got there."""
    bench = plant.bench
    structure = bench.composed(plant.effects)
    problem, free = bench.problem(structure, bench.estimation), bench.free_parameters(structure)
    factors = np.exp(OFF * rng.standard_normal(len(free)))
    start = {**plant.values, **{n: plant.values[n] * f for n, f in zip(free, factors, strict=True)}}
    # To the end only from the better place: one that is far off may be a model that no accurate integration follows.
    rough = [problem.fit(values, free, finish=False) for values in (start, plant.values)]
    best = min(rough, key=lambda fit: fit.cost)
    arrived = rough[0].cost < (1.0 + SAME) * best.cost
    ended = problem.fit(best.values, free, best.initial_states)
    model = FittedModel(plant.effects, ended, ended, ended.weighted_rms)
    return in_lowest_basins(bench, [model])[0].fit, arrived


def draw(rig: Rig, effect: Effect, seed: int, number: int) -> dict[str, Any]:
    """Return what one draw gives."""
    key = (seed, number, *(effect.name.encode()))
    rng = np.random.default_rng([*key, 1])
    plant = drawn(rig, effect, key)
    begun = time.process_time()
    fit, arrived = fitted(plant, rng)
    between = time.process_time()
    found = uncertainty_of(plant.bench, fit, rng)
    done = time.process_time()
    own = {fit.structure.parameter_name(e, p.name) for e in fit.structure.effects for p in e.parameters}
    return {
        "effect": effect.name,
        "rig": rig.name,
        "number": number,
        "gap": plant.gap,
        "disturbed": plant.disturbed,
        "left": fit.weighted_rms,
        "arrived": arrived,
        "method": found.method,
        "seconds": {"fit": between - begun, "bootstrap": done - between},
        "parameters": [
            {
                "name": name,
                "of_effect": name in own,
                "true": plant.values[name],
                "value": fit.values[name],
                "formula": fit.standard_errors[name],
                "bootstrap": found.std[name],
            }
            for name in fit.free
        ],
    }


def within(rows: Iterable[dict[str, Any]], how: str) -> tuple[float, float, int]:
    """Return the share of parameters within two standard errors, the median of std / |value|, and how many there are."""
    hits, widths = [], []
    for row in rows:
        for p in row["parameters"]:
            std = max(p["formula"], p["bootstrap"]) if how == "larger" else p[how]
            if not (math.isfinite(p["formula"]) and std > 0.0):
                continue
            hits.append(abs(p["value"] - p["true"]) <= 2.0 * std)
            if p["value"] != 0.0:
                widths.append(std / abs(p["value"]))
    return float(np.mean(hits)), float(np.median(widths)), len(hits)


def table(rows: list[dict[str, Any]]) -> str:
    """Return the table as Markdown."""
    lines = [
        "| effect | draws | numbers | within 2: formula | bootstrap | larger | width: formula | bootstrap | arrived |",
        "|---|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    names = list(dict.fromkeys((r["rig"], r["effect"]) for r in rows))
    groups = [
        (
            effect if rig == "axis" else f"{effect} ({rig})",
            [r for r in rows if (r["rig"], r["effect"]) == (rig, effect)],
        )
        for rig, effect in names
    ]
    for name, own in [*groups, ("all", rows)]:
        (before, wide, count), (after, wider, _), (larger, _, _) = (
            within(own, how) for how in ("formula", "bootstrap", "larger")
        )
        lines.append(
            f"| {name} | {len(own)} | {count} | {before:.0%} | {after:.0%} | {larger:.0%} | {wide:.2g} | {wider:.2g} | "
            f"{np.mean([r['arrived'] for r in own]):.0%} |"
        )
    seconds = [r["seconds"]["bootstrap"] for r in rows]
    lines.append(
        f"\nProcessor seconds of the bootstrap: median {np.median(seconds):.2g}, largest {np.max(seconds):.2g}; "
        f"by the formula: {sum(r['method'] == 'formula' for r in rows)} of {len(rows)}."
    )
    return "\n".join(lines)


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--draws", type=int, default=6)
    parser.add_argument("--only", default="", help="only effects whose names begin with this text")
    parser.add_argument("--table", action="store_true", help="print the table of the trials drawn so far")
    chosen = parser.parse_args()
    kept = HERE / f"draws_{chosen.seed}.jsonl"
    rows = [json.loads(line) for line in kept.read_text().splitlines()] if kept.exists() else []
    known = {(r["rig"], r["effect"], r["number"]) for r in rows}
    for number in range(0 if chosen.table else chosen.draws):
        for rig, effect in subjects():
            if (rig.name, effect.name, number) in known or not effect.name.startswith(chosen.only):
                continue
            try:
                row = draw(rig, effect, chosen.seed, number)
            except RigsightError as error:
                print(f"{effect.name} {number}: {error}")
                continue
            rows.append(row)
            with kept.open("a") as file:
                file.write(json.dumps(row) + "\n")
            print(f"{effect.name} {number}: left {row['left']:.3g}, {row['seconds']}", flush=True)
    print(table([r for r in rows if r["effect"].startswith(chosen.only)]))


if __name__ == "__main__":
    main()

"""Time to store, read and score the outcomes of 100,000 blind trials, with invented rows."""

from __future__ import annotations

import argparse
import math
import resource
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from rigsight.effects import CATALOGUE
from rigsight_bench.running.files import STORE_FILE
from rigsight_bench.running.score_files import BLIND_FILE, PAGE_FILE, merge
from rigsight_bench.running.store import TrialStore
from rigsight_bench.scoring import Outcome, ParameterError, WithheldError

PARTS = 4
"""Benches that the rows come from, as if they had run on so many clusters."""
ONE_BY_ONE = 500
"""Rows that are written in transactions of their own, as a running bench writes them."""
RIGHT = 0.9
TIERS = {"faint": (1.5, 5.0), "clear": (5.0, 20.0), "strong": (20.0, 80.0)}
RIG_PARAMETERS = ("J_z", "k_c", "k_d", "psi_off", "l_0", "c_y", "y_off")


def made_up(number: int, seed: int, rng: np.random.Generator) -> Outcome:
    effect, other = (CATALOGUE[int(i)] for i in rng.choice(len(CATALOGUE), 2, replace=False))
    tier = list(TIERS)[int(rng.integers(len(TIERS)))]
    right = bool(rng.random() < RIGHT)
    stated = float(rng.uniform(0.8, 1.0))
    errors = rng.lognormal(0.0, 0.02 if right else 1.0, 2)
    names = [*((name, "rig") for name in RIG_PARAMETERS), *((p.name, effect.name) for p in effect.parameters)]
    return Outcome(
        design="standard",
        seed=seed,
        trial=f"{number:03d}",
        fingerprint="",
        version="made up",
        kind="single",
        effects=(effect.name,),
        rig="running_gear" if rng.random() < 0.6 else "axis",
        noise="low" if rng.random() < 0.5 else "high",
        gap=math.exp(rng.uniform(*np.log(TIERS[tier]))),
        tier=tier,
        verdict="effect",
        named=(effect.name if right else other.name,),
        right=right,
        right_within_set=right,
        place_right=right or effect.place is other.place,
        probability=stated if right else 1.0 - stated,
        stated=stated,
        held_out=float(np.mean(errors)),
        withheld=(
            WithheldError("withheld_1", "multisine", 0.7, 8000, float(errors[0])),
            WithheldError("withheld_2", "step", 0.85, 3000, float(errors[1])),
        ),
        parameters=tuple(ParameterError(name, of, float(rng.normal())) for name, of in names)
        if right
        else (),
        seconds=float(rng.lognormal(4.0, 0.5)),
    )


@contextmanager
def timed(what: str) -> Iterator[None]:
    begin, used = time.perf_counter(), time.process_time()
    yield
    elapsed, used = time.perf_counter() - begin, time.process_time() - used
    sys.stdout.write(f"{what:58} {elapsed:7.2f} s, {used:.2f} s of a processor\n")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=100_000)
    rows: int = parser.parse_args().rows
    rng = np.random.default_rng(0)
    outcomes = [made_up(number // PARTS, number % PARTS, rng) for number in range(rows)]
    with tempfile.TemporaryDirectory() as place:
        parts = [Path(place) / f"part_{seed}" for seed in range(PARTS)]
        with timed(f"{rows} rows written, {PARTS} files, one transaction each"):
            for seed, part in enumerate(parts):
                part.mkdir()
                with TrialStore(part / STORE_FILE) as store:
                    store.add(outcomes[seed::PARTS])
        with (
            timed(f"{ONE_BY_ONE} of them again, one transaction each"),
            TrialStore(parts[0] / STORE_FILE) as store,
        ):
            for outcome in outcomes[: ONE_BY_ONE * PARTS : PARTS]:
                store.add([outcome])
        del outcomes
        with timed(f"{rows} rows read, merged and scored; json and page written"):
            content = merge(parts, Path(place) / "all")
        sizes = {name: (Path(place) / "all" / name).stat().st_size for name in (BLIND_FILE, PAGE_FILE)}
        sizes[STORE_FILE] = sum((part / STORE_FILE).stat().st_size for part in parts)
    if content["n_trials"] != rows:
        sys.exit(f"{content['n_trials']} rows were read back.")
    for name, size in sizes.items():
        sys.stdout.write(f"{name:58} {size / 1e6:7.1f} MB\n")
    # Kilobytes on Linux.
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    sys.stdout.write(f"{'largest memory':58} {memory:7.2f} GB\n")


if __name__ == "__main__":
    main()

"""Check that the files of a diagnosis reveal the hidden effect only by the physics.

Draws 108 trials of the standard design (seed 6: the first 100 and all others without an effect), unless `out/blind-cheat` holds
them, and looks at their campaigns as a cheat would, who knows the source of the draws but not the keys.

Run with ``python experiments/blind_cheat/cheat.py [part ...]``; parts: same, tests, noise, rig, seed, random, cache, process.
"""

from __future__ import annotations

import sys
from collections import Counter

from campaigns import campaigns
from contents import noise, same, tests
from draws import random, rig, seed
from surroundings import cache, process

PARTS = {
    "same": same,
    "tests": tests,
    "noise": noise,
    "rig": rig,
    "seed": seed,
    "random": random,
    "cache": cache,
    "process": process,
}


def main() -> None:
    wanted = sys.argv[1:] or list(PARTS)
    if not set(wanted) <= set(PARTS):
        sys.exit(f"Parts are {', '.join(PARTS)}; got {', '.join(wanted)}.")
    trials = campaigns()
    print(
        f"{len(trials)} trials: {dict(Counter(t.key['kind'] for t in trials))}, {dict(Counter(t.rig for t in trials))}"
    )
    for part in wanted:
        PARTS[part](trials)


if __name__ == "__main__":
    main()

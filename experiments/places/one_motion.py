"""On a rig with one motion: how often the true effect is among those that a diagnosis fits first.

    python experiments/places/one_motion.py --draws 50 --seed 3

A draw is a trial of the standard blind bench with one hidden effect. Writes one_motion.md beside this file.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from rigsight.campaign import Campaign
from rigsight.diagnose.fit_context import fit_context_of, start_values_of
from rigsight.diagnose.noise.detection import noise_floors
from rigsight.diagnose.search.single_effects import reidentify
from rigsight.diagnose.search.worth_fitting import search_places
from rigsight.effects import CATALOGUE
from rigsight.identify import IdleThreads
from rigsight.identify.fit.windows import Windowing
from rigsight_bench.trials import draw_trial
from rigsight_bench.trials.standard.subjects import standard_subject_of

HEAD = """# On a rig with one motion: is the true effect looked at first?

`one_motion.py --draws {draws} --seed {seed}`: {kept} of {all} true effects are among those that are looked at first, which are
{share:.0%} of the candidates.

| trial | rig | effect | gap (noise floors) | looked at | of | the true one among them | seconds |
|---:|---|---|---:|---:|---:|---|---:|
"""


def row(seed: int, number: int) -> tuple[int, int, bool, str]:
    """Return how many effects are looked at first, of how many, whether the true one is among them, and a row of the table."""
    trial = draw_trial("standard", seed, number)
    rig = trial.rig
    constants = {p.name: trial.values[p.name] for p in rig.constants}
    campaign = Campaign(str(number), rig, constants, trial.given, trial.records)
    noise = {floor.output: floor.std for floor in noise_floors(rig, campaign.records, campaign.drifts, True)}
    bench = fit_context_of(campaign, noise, Windowing(), None, IdleThreads(1), start_values_of(campaign))
    linear = reidentify(bench, bench.start)
    offered = bench.offered(CATALOGUE)
    begun = time.process_time()
    found = search_places(bench, linear, offered)
    seconds = time.process_time() - begun
    (true,) = trial.key["effects"]
    kept = true in {effect.name for effect in found.effects}
    told = f"| {number} | {rig.name} | {true} | {linear.error_over_noise:.3g} | {len(found.effects)} | {len(offered)} "
    return len(found.effects), len(offered), kept, f"{told}| {'yes' if kept else '**no**'} | {seconds:.1f} |"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--draws", type=int, default=50)
    parser.add_argument("--seed", type=int, default=3)
    asked = parser.parse_args()
    numbers = [n for n in range(asked.draws) if standard_subject_of(asked.seed, n).kind == "single"]
    rows = []
    for number in numbers:
        rows.append(row(asked.seed, number))
        print(rows[-1][-1], flush=True)
    looked, offered, kept, lines = zip(*rows, strict=True)
    head = HEAD.format(
        draws=asked.draws, seed=asked.seed, kept=sum(kept), all=len(rows), share=sum(looked) / sum(offered)
    )
    Path(__file__).with_name("one_motion.md").write_text(head + "\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

"""Distribution of the p-values of the adequacy check: uniform for true models, small for the equations without the effect.

    python experiments/adequacy/run.py --seed 2 --trials 80

Each trial of the standard blind bench (disturbed, noisy, one mass) gives two models: the hidden effects fitted from their true
numbers, and the re-identified equations without them. Writes results.md beside this file and docs/images/p_values.png.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np

from rigsight.campaign import Campaign
from rigsight.diagnose.fit_context import fit_context_of, start_values_of
from rigsight.diagnose.noise.adequacy import Adequacy, adequacy
from rigsight.diagnose.noise.detection import noise_floors
from rigsight.diagnose.search.single_effects import reidentify
from rigsight.effects import effect_named
from rigsight.errors import RigsightError
from rigsight.identify import IdleThreads
from rigsight.identify.fit.windows import Windowing
from rigsight_bench.trials import draw_trial

HERE = Path(__file__).parent
LARGE = 2.0
"""Gaps [noise floors] from which the equations without the effect should be refused."""

ARRIVED = 1.3
"""What the true model may leave of its worst record [noise floors], if the fit ended at it."""


@dataclass(frozen=True)
class Row:
    """One trial: what is hidden, the gap, and the adequacy of the true model and of the equations without it.

    `worst` is what the true model leaves of its worst record, in noise floors: far above 1 the fit has stopped at another place.
    """

    trial: int
    effects: tuple[str, ...]
    gap: float
    worst: float
    true: Adequacy
    linear: Adequacy


def row(seed: int, trial: int) -> Row | None:
    """Return what one trial gives; None for an effect from outside and for wrong parameters."""
    drawn = draw_trial("standard", seed, trial)
    if drawn.key["kind"] in ("outside", "parameters"):
        return None
    rig, records = drawn.rig, drawn.records
    constants = {p.name: drawn.values[p.name] for p in rig.constants}
    campaign = Campaign(str(trial), rig, constants, {}, tuple(records))
    noise = {floor.output: floor.std for floor in noise_floors(rig, records)}
    bench = fit_context_of(campaign, noise, Windowing(), None, IdleThreads(1), start_values_of(campaign))
    rng = np.random.default_rng(trial)
    linear = reidentify(bench, bench.start)
    effects = tuple(effect_named(name) for name in drawn.key["effects"])
    structure = bench.composed(effects)
    fit = bench.problem(structure, bench.estimation).fit(
        {**bench.start, **drawn.key["values"]}, bench.free_parameters(structure)
    )
    true = bench.score(effects, fit)
    return Row(
        trial,
        tuple(drawn.key["effects"]),
        linear.error_over_noise,
        max(bench.problem(structure, [r]).fit(fit.values, ()).weighted_rms for r in bench.records),
        adequacy(bench, true, rng),
        adequacy(bench, linear, rng),
    )


def told(rows: list[Row]) -> str:
    """Return the results as Markdown."""
    arrived = [r for r in rows if r.worst <= ARRIVED]
    p = np.array([r.true.p_value for r in arrived])
    below = "\n".join(
        f"| {level} | {np.mean(p < level):.3f} |" for level in (0.01, 0.05, 0.1, 0.25, 0.5, 0.75)
    )
    large = [r for r in rows if r.effects and r.gap >= LARGE]
    refused = sum(not r.linear.adequate for r in large)
    lines = "\n".join(
        f"| {r.trial} | {', '.join(r.effects) or 'none'} | {r.gap:.3g} | {r.worst:.3g} | {r.true.p_value:.3g} | "
        f"{r.linear.p_value:.2g} | {r.linear.goes_with or '-'} |"
        for r in rows
    )
    return "\n".join(
        [
            "# Results",
            "",
            f"{len(arrived)} true models; {len(rows) - len(arrived)} more are left out, whose fit stopped elsewhere in a record. "
            "Share of them with a p-value below a level:",
            "",
            "| level | share |",
            "|---|---|",
            below,
            "",
            f"Of {len(large)} gaps of {LARGE:g} noise floors and more, equations without the effect were refused in {refused}.",
            "",
            "| trial | hidden | gap | worst record, true model | p, true model | p, without it | goes with |",
            "|---|---|---|---|---|---|---|",
            lines,
            "",
        ]
    )


def draw_picture(rows: list[Row]) -> None:
    """Write the distribution of the true models' p-values beside that of uniform ones."""
    mpl.use("Agg")
    p = np.sort([r.true.p_value for r in rows if r.worst <= ARRIVED])
    figure, axes = plt.subplots(figsize=(4.5, 4.0), layout="constrained")
    axes.plot([0, 1], [0, 1], color="0.6", lw=1, label="uniform")
    axes.step(p, (1 + np.arange(p.size)) / p.size, where="post", label="true models")
    axes.set(xlabel="p-value", ylabel="share below", xlim=(0, 1), ylim=(0, 1))
    axes.legend(frameon=False)
    figure.savefig(HERE.parents[1] / "docs/images/p_values.png", dpi=120)
    plt.close(figure)


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, default=2)
    parser.add_argument("--trials", type=int, default=80)
    chosen = parser.parse_args()
    rows = []
    for trial in range(chosen.trials):
        try:
            found = row(chosen.seed, trial)
        except RigsightError as error:
            print(f"trial {trial}: {error}")
            continue
        if found is not None:
            rows.append(found)
            print(
                f"trial {trial}: {', '.join(found.effects)}: p = {found.true.p_value:.3g}, without {found.linear.p_value:.3g}"
            )
            (HERE / "results.md").write_text(told(rows), encoding="utf-8")
            draw_picture(rows)


if __name__ == "__main__":
    main()

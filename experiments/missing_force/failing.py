"""How often does the evidence itself fail? The likelihood of verdicts of known causes by `FAMILIES.failing`.

`failing.py FOLDER...` reads folders of `rigsight blind --design measured` and writes what each verdict weighed to
`verdicts.jsonl`; without a folder it fits.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from rigsight.diagnose.policy import FAMILIES, SEARCH
from rigsight.effects import family_of

VERDICTS = Path(__file__).parent / "verdicts.jsonl"
RANGE = (1e-4, 1.0)


def weighed(folder: Path, trial: str) -> dict[str, Any] | None:
    """Return of each family its rank and its shares of the simulated gap and of the force; None of a verdict without a cause."""
    key = json.loads((folder / "keys" / f"{trial}.json").read_text(encoding="utf-8"))
    found = json.loads((folder / "results" / trial / "diagnosis.json").read_text(encoding="utf-8"))
    if found["verdict"] not in ("effect", "unknown"):
        return None
    gap = np.mean([(own["reidentified"] / own["noise_floor"]) ** 2 for own in found["gap"].values()])
    families: dict[tuple[str, str], list[float]] = {}
    for model in found["candidates"]:
        if not model["effects"] or model["error_over_noise"] is None:
            continue
        pairs = zip(model["effects"], model["where"], strict=True)
        own = {(str(family_of(effect)), where) for effect, where in pairs}
        for family in own:
            at = families.setdefault(family, [0.0, 0.0, 0.0])
            at[0] += model["ranking_share"]
            if len(own) == 1:
                at[1] = max(at[1], float(1.0 - model["error_over_noise"] ** 2 / gap))
    force = found["missing_force"] or {"families": [], "by_chance": 0.0}
    for cause in force["families"]:
        at = families.get((cause["family"], cause["where"]), [0.0, 0.0, 0.0])
        at[2] = cause["share"] if at[0] > 0.0 else 0.0  # nothing is said of a family whose fits have no size
    return {
        "campaign": key["campaign"],
        "effect": key["effects"][0],
        "truth": [key["family"], key["where"][0]],
        "by_chance": force["by_chance"],
        "families": [[*name, *(round(value, 4) for value in own)] for name, own in families.items()],
    }


def of_truth(trial: dict[str, Any], failing: float) -> float:
    """Return the probability of the hidden family at its place; of any other cause if no model has it."""
    of_law = SEARCH.law_error**2
    rank, simulated, along = np.clip([own[2:] for own in trial["families"]], 0.0, 1.0).T
    remains = [(1.0 + of_law) / (1.0 - share + of_law) for share in (simulated, along)]
    power = FAMILIES.per_motion * (1.0 - trial["by_chance"])
    weights = np.maximum(rank, FAMILIES.least_rank) ** np.max(simulated)
    weights = weights * remains[0] ** FAMILIES.per_simulation * remains[1] ** power
    chances = weights / ((1.0 + failing) * np.sum(weights) + FAMILIES.other_causes)
    names = [own[:2] for own in trial["families"]]
    return float(chances[names.index(trial["truth"])] if trial["truth"] in names else 1.0 - np.sum(chances))


def cost(trials: Sequence[dict[str, Any]], failing: float) -> float:
    """Return the log score."""
    return -float(np.mean([np.log(of_truth(trial, failing)) for trial in trials]))


def fitted(trials: Sequence[dict[str, Any]]) -> float:
    """Return the odds with the largest likelihood."""
    found = minimize_scalar(lambda x: cost(trials, np.exp(x)), bounds=np.log(RANGE), method="bounded")
    return float(np.exp(found.x))


def main() -> None:
    """Collect or fit."""
    if sys.argv[1:]:
        found = sorted(path.parent for f in sys.argv[1:] for path in Path(f).glob("results/*/diagnosis.json"))
        rows = [weighed(result.parents[1], result.name) for result in found]
        VERDICTS.write_text("".join(f"{json.dumps(row)}\n" for row in rows if row), encoding="utf-8")
        return
    trials = [json.loads(line) for line in VERDICTS.open(encoding="utf-8")]
    campaigns = sorted({trial["campaign"] for trial in trials})
    print(f"{len(trials)} verdicts of {len(campaigns)} campaigns: {fitted(trials):.3f}")
    scores = []
    for campaign in campaigns:
        own = fitted([trial for trial in trials if trial["campaign"] != campaign])
        scores += [cost([trial], own) for trial in trials if trial["campaign"] == campaign]
    print(f"Log score, each campaign by the others: {np.mean(scores):.2f}; without: {cost(trials, 1e-9):.2f}")


main()

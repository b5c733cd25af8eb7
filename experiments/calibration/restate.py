"""Copy a bench with the probabilities that the present calibration gives to its diagnoses; nothing is diagnosed again.

    .venv/bin/python experiments/calibration/restate.py BENCH COPY
    rigsight blind --out COPY --design DESIGN --seed SEED --rescore

A calibration may be trained while the trials that judge it still run, as it changes neither a verdict nor a ranking.
"""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path
from typing import Any

from rigsight.blind.scoring.training_trial import first_model, share_of, training_trial
from rigsight.diagnose import Calibration
from rigsight.diagnose.verdict.calibration import trained
from rigsight.effects import AT


def main(bench: Path, copy: Path) -> None:
    """Copy what the command line names."""
    shutil.copytree(bench, copy, ignore=shutil.ignore_patterns("campaigns"))
    for result in sorted(copy.glob("results/*/diagnosis.json")):
        key = json.loads((copy / "keys" / f"{result.parent.name}.json").read_text(encoding="utf-8"))
        diagnosis = json.loads(result.read_text(encoding="utf-8"))
        restated = with_probabilities(diagnosis, key, trained())
        result.write_text(json.dumps(restated, indent=2) + "\n", encoding="utf-8")


def with_probabilities(
    diagnosis: dict[str, Any], key: dict[str, Any], calibration: Calibration
) -> dict[str, Any]:
    """Return the content of ``diagnosis.json`` with the probabilities and likely causes of a calibration."""
    situation = training_trial(key, diagnosis).situation
    tried = [candidate for candidate in diagnosis["candidates"] if candidate["effects"]]
    first = first_model(diagnosis, tried)
    ordered = [tried[first], *(c for i, c in enumerate(tried) if i != first)] if tried else []
    probabilities = calibration.probabilities(situation, [share_of(c) for c in ordered])
    for candidate, probability in zip(ordered, probabilities, strict=True):
        candidate["probability"] = probability
    without = next(c for c in diagnosis["candidates"] if not c["effects"])
    without["probability"] = calibration.without_effect(situation)
    stated = [candidate["probability"] for candidate in diagnosis["candidates"]]
    outside = max(0.0, 1.0 - sum(stated))
    enough = min(calibration.least_probability, max(outside, *stated))
    diagnosis["likely_causes"] = {
        "effects": [
            _names(candidate, situation.several_places)
            for candidate in diagnosis["candidates"]
            if candidate["probability"] >= enough
        ],
        "outside": outside >= enough,
    }
    return diagnosis


def _names(candidate: dict[str, Any], by_place: bool) -> list[str]:
    placed = zip(candidate["effects"], candidate["where"], strict=True)
    return [f"{name}{AT}{place}" if by_place else name for name, place in placed]


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))

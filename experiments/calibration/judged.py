"""Scores of the trials that judge the calibration, with the probabilities that the present calibration gives.

    .venv/bin/python experiments/calibration/judged.py BENCH...    # adds trials of benches to judged.jsonl
    .venv/bin/python experiments/calibration/judged.py             # prints the scores of all of them

A line of the file has of a trial what its scores depend on: the key without the numbers of the rig, and of the diagnosis verdict,
ranking and errors. A calibration changes neither, so it may be trained while the trials that judge it run.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rigsight.blind.scoring.probability_scores import ALL, probability_scores, scores_of
from rigsight.blind.scoring.score import Outcome, outcome
from rigsight.blind.scoring.training_trial import first_model, share_of, training_trial
from rigsight.diagnose import Calibration
from rigsight.diagnose.verdict.calibration import trained
from rigsight.effects import AT

FILE = Path(__file__).parent / "judged.jsonl"
OF_KEY = (
    "schema_version", "design", "seed", "trial", "kind", "effects", "where", "rig", "noise", "gap", "condition",
)  # fmt: skip
OF_DIAGNOSIS = ("verdict", "effects", "where", "ambiguous_with", "adequate", "likely_causes")
OF_CANDIDATE = ("effects", "where", "probability", "error_over_noise", "ranking_share")
NEGLIGIBLE = 1e-4
"""Share of the ranking below which a candidate that is not the true cause is left out."""
CLEAR = 5.0
"""Gap, in noise floors, of a clear trial."""
FAR = 10.0
"""Gap of the goals for several effects."""
Line = dict[str, Any]


def main(benches: Sequence[Path]) -> None:
    """Add the trials of benches, or print the scores."""
    known = {_name(line): line for line in read_lines()}
    if not benches:
        print(tables([scored(line, trained()) for line in known.values()]))
        return
    found = []
    for bench in benches:
        own = list(_of_bench(bench))
        if not own:
            sys.exit(f"{bench} holds no trial: name the folder that 'rigsight blind --out' wrote.")
        found += own
    known |= {_name(line): line for line in found}
    lines = (json.dumps(known[name]) for name in sorted(known))
    FILE.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
    print(f"{len(found)} trials read, {len(known)} in {FILE}.")


def read_lines() -> list[Line]:
    """Return the lines of the file."""
    return (
        [json.loads(line) for line in FILE.read_text(encoding="utf-8").splitlines()] if FILE.exists() else []
    )


def _name(line: Line) -> tuple[str, int, str]:
    key = line["key"]
    return (key["design"], key["seed"], str(key["trial"]).zfill(3))


def _of_bench(bench: Path) -> Iterable[Line]:
    for run in sorted(bench.glob("results/*/run.json")):
        key = json.loads((bench / "keys" / f"{run.parent.name}.json").read_text(encoding="utf-8"))
        told = json.loads(run.read_text(encoding="utf-8"))
        result = run.with_name("diagnosis.json")
        diagnosis = json.loads(result.read_text(encoding="utf-8")) if result.exists() else None
        yield {
            "key": {name: key[name] for name in OF_KEY if name in key},
            "seconds": told["seconds"],
            "message": told["message"],
            "diagnosis": None if diagnosis is None else _shortened(diagnosis, key),
        }


def _shortened(diagnosis: Line, key: Line) -> Line:
    hidden = set(key["effects"])
    candidates = [
        candidate
        for candidate in diagnosis["candidates"]
        if share_of(candidate) >= NEGLIGIBLE
        or set(candidate["effects"]) in (set(), hidden, set(diagnosis["effects"]))
    ]
    return {
        **{name: diagnosis[name] for name in OF_DIAGNOSIS},
        "candidates": [{name: _rounded(one[name]) for name in OF_CANDIDATE} for one in candidates],
        "noise_floor": {
            output: {"lower_bound": floor["lower_bound"]}
            for output, floor in diagnosis["noise_floor"].items()
        },
        "gap_by_place": [
            {name: place[name] for name in ("place", "looked_at")}
            for place in diagnosis["gap_by_place"] or ()
        ],
    }


def _rounded(value: Any) -> Any:
    return float(f"{value:.6g}") if isinstance(value, float) else value


def scored(line: Line, calibration: Calibration) -> Outcome:
    """Return the outcome of a trial with the probabilities of a calibration."""
    diagnosis = line["diagnosis"]
    if diagnosis is not None:
        diagnosis = with_probabilities(diagnosis, line["key"], calibration)
    return outcome(line["key"], diagnosis, (), line["seconds"], "", line["message"])


def with_probabilities(diagnosis: Line, key: Line, calibration: Calibration) -> Line:
    """Return a diagnosis with the probabilities and likely causes of a calibration."""
    situation = training_trial(key, diagnosis).situation
    tried = [dict(candidate) for candidate in diagnosis["candidates"] if candidate["effects"]]
    first = first_model(diagnosis, tried)
    ordered = [tried[first], *(c for i, c in enumerate(tried) if i != first)] if tried else []
    probabilities = calibration.probabilities(situation, [share_of(c) for c in ordered])
    for candidate, probability in zip(ordered, probabilities, strict=True):
        candidate["probability"] = probability
    without = {
        "effects": [],
        "where": [],
        "probability": calibration.without_effect(situation),
        "error_over_noise": situation.gap,
        "ranking_share": None,
    }
    candidates = [*ordered, without]
    stated = [candidate["probability"] for candidate in candidates]
    outside = max(0.0, 1.0 - sum(stated))
    enough = min(calibration.least_probability, max(outside, *stated))
    likely = [_names(c, situation.several_places) for c in candidates if c["probability"] >= enough]
    return {
        **diagnosis,
        "candidates": candidates,
        "likely_causes": {"effects": likely, "outside": outside >= enough},
    }


def _names(candidate: Line, by_place: bool) -> list[str]:
    placed = zip(candidate["effects"], candidate["where"], strict=True)
    return [f"{name}{AT}{place}" if by_place else name for name, place in placed]


def tables(outcomes: Sequence[Outcome]) -> str:
    """Return scores of the stated probabilities and shares of right verdicts, as Markdown."""
    rows = [
        "| stratum | trials | stated, mean | true | log score | Brier | slope | likely causes hold the truth | their number |",
        "|---|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    strata = probability_scores(outcomes)
    clear = [o for o in outcomes if o.gap is not None and (o.gap >= CLEAR or not o.effects)]
    strata[f"clear: {CLEAR:g} floors and more, and controls"] = scores_of(clear)
    rows += [_row(name, scores) for name, scores in strata.items() if scores["count"]]
    rows += ["", "| trials | right | of | share | seconds, median |", "|---|---:|---:|---:|---:|"]
    for name, of_group in _groups(outcomes).items():
        right = sum(o.right for o in of_group)
        median = float(np.median([o.seconds for o in of_group]))
        rows.append(f"| {name} | {right} | {len(of_group)} | {right / len(of_group):.0%} | {median:.0f} |")
    return "\n".join(rows)


def _row(name: str, scores: Line) -> str:
    slope = "" if scores["slope"] is None else f"{scores['slope']:.2f} ± {scores['slope_error']:.2f}"
    covered, size = scores["covered"], scores["set_size"]
    return (
        f"| {name} | {scores['count']} | {scores['stated']:.2f} | {_share(scores['true'])} | {scores['log_score']:.2f} "
        f"| {scores['brier']:.3f} | {slope} | {_share(covered)} | {size:.2f} |"
    )


def _share(told: Any) -> str:
    share = told["share"] if isinstance(told, dict) else told
    return "" if share is None else f"{share:.0%}"


def _groups(outcomes: Sequence[Outcome]) -> dict[str, list[Outcome]]:
    found: dict[str, list[Outcome]] = {ALL: list(outcomes)}
    for one in outcomes:
        if one.kind in ("pair", "triple"):
            found.setdefault(
                f"{one.kind}s, {'' if (one.gap or 0.0) >= FAR else 'below '}{FAR:g} floors", []
            ).append(one)
        elif one.kind == "single":
            found.setdefault(
                f"single effects, {'' if (one.gap or 0.0) >= CLEAR else 'below '}{CLEAR:g} floors", []
            ).append(one)
        else:
            found.setdefault(one.kind, []).append(one)
        found.setdefault(f"design {one.design}", []).append(one)
    return dict(sorted(found.items(), key=lambda named: (named[0] != ALL, named[0])))


if __name__ == "__main__":
    main([Path(name) for name in sys.argv[1:]])

"""Scores of the trials that judge the calibration, with the probabilities that the present calibration gives.

    .venv/bin/python experiments/calibration/judged.py BENCH... --state 40f2704    # adds trials to judged/40f2704.jsonl
    .venv/bin/python experiments/calibration/judged.py --state 40f2704             # prints the scores of all of them
    .venv/bin/python experiments/calibration/judged.py --state 40f2704 edb9015     # of two states together

A line of a file has of a trial what its scores depend on: the key without the numbers of the rig, and of the diagnosis verdict,
ranking and errors. A calibration changes neither, so it may be trained while the trials that judge it run. All lines of a file
are of one state of the code, and a trial that is run again keeps its first outcome.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rigsight.diagnose.verdict.calibration import Calibration, trained
from rigsight.effects import AT
from rigsight_bench.scoring.goals import is_clear
from rigsight_bench.scoring.probability_scores import ALL, probability_scores, scores_of
from rigsight_bench.scoring.score import outcome
from rigsight_bench.scoring.shares import share_of as share_of_trials
from rigsight_bench.scoring.training_trial import first_model, share_of, training_trial
from rigsight_bench.scoring.trial_outcome import FAILED, Outcome

FOLDER = Path(__file__).parent / "judged"
OF_KEY = (
    "schema_version", "design", "seed", "trial", "kind", "effects", "where", "rig", "noise", "gap", "condition",
)  # fmt: skip
OF_DIAGNOSIS = ("verdict", "effects", "where", "ambiguous_with", "adequate", "likely_causes")
OF_CANDIDATE = ("effects", "where", "probability", "error_over_noise", "ranking_share")
NEGLIGIBLE = 1e-4
"""Share of the ranking below which a candidate that is not the true cause is left out."""
_LEAST_SHARE = 1e-12
Line = dict[str, Any]


def main() -> None:
    """Add the trials of benches, or print the scores."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("bench", type=Path, nargs="*")
    parser.add_argument("--state", required=True, nargs="+", help="commit of the code that ran the trials")
    given = parser.parse_args()
    files = [FOLDER / f"{state}.jsonl" for state in given.state]
    lines = [line for file in files if file.exists() for line in read_lines(file)]
    if given.bench:
        if len(files) > 1:
            parser.error(f"benches are of one state, got {' '.join(given.state)}.")
        (file,) = files
        lines = with_benches(lines, given.bench)
        file.write_text("".join(f"{json.dumps(line)}\n" for line in lines), encoding="utf-8")
        print(f"{len(lines)} trials in {file}.")
    elif all(file.exists() for file in files):
        print(tables([scored(line, trained()) for line in lines]))
    else:
        known = ", ".join(sorted(path.stem for path in FOLDER.glob("*.jsonl")))
        sys.exit(
            f"There are no trials of {' or '.join(given.state)}: name benches to add, or states of {known}."
        )


def with_benches(known: Sequence[Line], benches: Sequence[Path]) -> list[Line]:
    """Return the lines with those of benches; a trial that is there already stays as it is."""
    lines = {_name(line): line for line in known}
    for bench in benches:
        found = list(_of_bench(bench))
        if not found:
            sys.exit(f"{bench} has no trials: name the folder that 'rigsight blind --out' wrote.")
        lines = {_name(line): line for line in found} | lines
    return [lines[name] for name in sorted(lines)]


def read_lines(file: Path) -> list[Line]:
    """Return the lines of a file."""
    return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]


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
    shares = [share_of(c) for c in ordered]
    # A bench tries the whole catalogue: those that a line leaves out keep what the calibration gives them.
    omitted = max(_LEAST_SHARE, 1.0 - math.fsum(shares))
    probabilities = calibration.probabilities(situation, [*shares, omitted] if shares else [])
    for candidate, probability in zip(ordered, probabilities, strict=False):
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
    outside = max(0.0, 1.0 - math.fsum([*stated, *probabilities[len(ordered) :]]))
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
        "| stratum | trials | stated, mean | true | log score | Brier | slope | offset | set contains the truth | set size |",
        "|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    strata = probability_scores(outcomes)
    strata["clear trials"] = scores_of([o for o in outcomes if is_clear(o)])
    rows += [_row(name, scores) for name, scores in strata.items()]
    rows += [
        "",
        "| trials | right | failed | of | share, 95 % interval | seconds, median |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    for name, of_group in _groups(outcomes).items():
        right = share_of_trials(of_group, lambda o: o.right)
        failed = sum(o.verdict == FAILED for o in of_group)
        low, high = right["interval"]
        share = f"{right['share']:.0%}, {low:.0%} to {high:.0%}"
        median = float(np.median([o.seconds for o in of_group]))
        rows.append(f"| {name} | {right['count']} | {failed} | {right['total']} | {share} | {median:.0f} |")
    return "\n".join(rows)


def _row(name: str, scores: Line) -> str:
    return (
        f"| {name} | {scores['count']} | {_number(scores['stated'], 2)} | {_share(scores['true'])} "
        f"| {_number(scores['log_score'], 2)} | {_number(scores['brier'], 3)} "
        f"| {_with_error(scores, 'slope')} | {_with_error(scores, 'offset')} "
        f"| {_share(scores['covered'])} | {_number(scores['set_size'], 2)} |"
    )


def _number(value: float | None, digits: int) -> str:
    return "" if value is None else f"{value:.{digits}f}"


def _with_error(scores: Line, name: str) -> str:
    return "" if scores[name] is None else f"{scores[name]:.2f} ± {scores[f'{name}_error']:.2f}"


def _share(told: Line) -> str:
    return "" if told["share"] is None else f"{told['share']:.0%}"


def _groups(outcomes: Sequence[Outcome]) -> dict[str, list[Outcome]]:
    found: dict[str, list[Outcome]] = {ALL: list(outcomes)}
    for one in outcomes:
        size = "" if one.kind in ("none", "parameters") else (", clear" if is_clear(one) else ", faint")
        found.setdefault(f"{one.kind}{size}", []).append(one)
        found.setdefault(f"design {one.design}", []).append(one)
        found.setdefault(f"rig {one.rig}", []).append(one)
    return dict(sorted(found.items(), key=lambda named: (named[0] != ALL, named[0])))


if __name__ == "__main__":
    main()

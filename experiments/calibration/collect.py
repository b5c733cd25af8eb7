"""Read benches that `rigsight blind` has run, and put their trials into the table.

    .venv/bin/python experiments/calibration/collect.py BENCH... [--left-out FOLDER...]

A trial that is in the table keeps its first outcome. A folder of trials whose effect was left out of the
candidates is one that `leave_one_out.py` wrote; its bench is named before it.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from table import FILE, read_table, write_table

from rigsight_bench.scoring.training_trial import TrainingTrial, training_trial


def main() -> None:
    """Collect what the command line names."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("bench", type=Path, nargs="+")
    parser.add_argument("--left-out", type=Path, nargs="*", default=[])
    given = parser.parse_args()
    found = [trial for bench in given.bench for trial in _of_bench(bench)]
    for folder in given.left_out:
        found += [trial for bench in given.bench for trial in _left_out(bench, folder)]
    known = {_name(trial): trial for trial in (read_table() if FILE.exists() else [])}
    known = {_name(trial): trial for trial in found} | known
    write_table(known.values())
    print(f"{len(found)} trials read, {len(known)} in {FILE}.")


def _name(trial: TrainingTrial) -> tuple[str, int, str, bool]:
    return (trial.design, trial.seed, trial.trial, trial.left_out)


def _of_bench(bench: Path) -> list[TrainingTrial]:
    return [
        training_trial(_read(bench / "keys" / f"{result.parent.name}.json"), _read(result))
        for result in sorted(bench.glob("results/*/diagnosis.json"))
    ]


def _left_out(bench: Path, folder: Path) -> list[TrainingTrial]:
    return [
        training_trial(_read(bench / "keys" / f"{result.parent.name}.json"), _read(result), left_out=True)
        for result in sorted((folder / bench.name).glob("*/diagnosis.json"))
    ]


def _read(path: Path) -> dict:
    return json.loads(path.read_text(encoding="utf-8"))


if __name__ == "__main__":
    main()

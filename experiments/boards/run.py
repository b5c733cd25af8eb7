"""From the training records of a board to its number.

    python experiments/boards/run.py emps --records emps/train.csv
    python experiments/boards/run.py silverbox --data FOLDER --judge

Without --records, nonlinear_benchmarks reads the official records, from files in --data or by its own download. The equations of
the board are fitted to a first part of the training records and scored on the rest of them, then fitted to all of them. Test
records are read only with --judge or --test, after that. Writes OUT/BOARD/result.json, model.json and equation.tex.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from declared import BOARDS, RIGS, Board
from official import official_records, records_of_files
from scoring import free_run_error

import rigsight as rs
from rigsight.errors import InputError, RigsightError
from rigsight.records.record import Record
from rigsight.simulate.model import Model
from rigsight.workflow.export import run_export
from rigsight.workflow.run.results import json_text, write_together

RESULT = "result.json"


def split(board: Board, records: Sequence[Record]) -> tuple[list[Record], list[Record]]:
    """Return the first part of each training record, and the rest, which is scored."""
    fitted, scored = [], []
    for record in records:
        edge = round((1.0 - board.held_out) * record.n_samples)
        fitted.append(record.slice(0, edge))
        scored.append(replace(record.slice(edge, None), name=f"{record.name}, held out", role="validation"))
    return fitted, scored


def fitted(board: Board, records: Sequence[Record]) -> Model:
    """Return the model of the board with numbers that fit records."""
    rig = rs.Rig.from_file(RIGS / board.rig) if board.rig.endswith(".toml") else board.rig
    estimation = [replace(record, role="estimation") for record in records]
    campaign = rs.make_campaign(rig, estimation, parameters=board.start, effects=board.effects)
    samples = board.initial_samples if board.objective == "free-run" else None
    identifier = rs.LinearIdentifier(objective=board.objective, initial_samples=samples, n_jobs=1)
    model: Model = identifier.fit(campaign).model_
    return model


def errors(board: Board, model: Model, records: Sequence[Record]) -> dict[str, float]:
    """Return the error of the free run over each record, in the unit of the board."""
    return {record.name: free_run_error(board, model, record) for record in records}


def test_errors(board: Board, model: Model, records: Sequence[Record]) -> dict[str, float]:
    """Return the number of the board for each test record, begun as the board says."""
    ways = list(board.begins.values())
    found = {}
    for i, record in enumerate(records):
        begins = ways[i] if len(ways) == len(records) else "samples"
        found[record.name] = free_run_error(board, model, record, begins)
    return found


def state() -> str:
    """Return the commit of this tree, marked where files differ from it."""
    command = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty", "--abbrev=12"]
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip() or "unknown"


def training_records(board: Board, arguments: argparse.Namespace) -> list[Record]:
    """Return the training records that the command line names, else the official ones."""
    if arguments.records:
        return records_of_files(board, arguments.records, "estimation")
    training, _ = official_records(board, arguments.data)
    if not training:
        raise InputError(
            f"The board '{arguments.board}' has no official training records. Name some with --records."
        )
    return training


def test_records(board: Board, arguments: argparse.Namespace) -> list[Record]:
    """Return the test records that the command line names, else the official ones."""
    if arguments.test:
        return records_of_files(board, arguments.test, "validation")
    return official_records(board, arguments.data)[1]


def check_not_judged(result: Path) -> None:
    """Refuse a second look at test records: there is one final run."""
    if result.exists() and json.loads(result.read_text(encoding="utf-8"))["test"] is not None:
        raise InputError(f"{result} is the final run of this board. Name another folder with --out.")


def run(arguments: argparse.Namespace) -> None:
    """Fit, score and write one board."""
    began, board = time.perf_counter(), BOARDS[arguments.board]
    out = arguments.out / arguments.board
    judged = bool(arguments.judge or arguments.test)
    if judged:
        check_not_judged(out / RESULT)
    training = training_records(board, arguments)
    held_out = records_of_files(board, arguments.validation or (), "validation")
    part, rest = (training, held_out) if held_out else split(board, training)
    validation = errors(board, fitted(board, part), rest)
    everything = [*training, *held_out]
    model = fitted(board, everything)
    found = {
        "board": arguments.board,
        "unit": board.unit,
        "initial_samples": board.initial_samples,
        "objective": board.objective,
        "validation": validation,
        "training": errors(board, model, everything),
        "test": test_errors(board, model, test_records(board, arguments)) if judged else None,
        "numbers": model.values,
        "state": state(),
        "seed": None,
        "seconds": round(time.perf_counter() - began, 1),
    }
    write_together(out, {"model.json": json_text(model.to_json()), RESULT: json_text(found)})
    run_export(out / "model.json", "latex", out / "equation.tex")
    for what in ("validation", "training", "test"):
        for name, error in (found[what] or {}).items():
            print(f"{what:10}  {name:32}  {error:.4g} {board.unit}")
    print(f"{found['seconds']} s, state {found['state']}, nothing is drawn: {out}")


def main() -> int:
    """Run one board from the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("board", choices=BOARDS)
    parser.add_argument("--data", type=Path, help="folder that holds the official files")
    parser.add_argument("--records", type=Path, nargs="+", help="training records as CSV: t, u, y")
    parser.add_argument("--validation", type=Path, nargs="+", help="training records that are held out first")
    parser.add_argument("--test", type=Path, nargs="+", help="test records as CSV")
    parser.add_argument("--judge", action="store_true", help="score the official test records")
    parser.add_argument("--out", type=Path, default=Path("boards"), help="folder of the results")
    try:
        run(parser.parse_args())
    except RigsightError as error:
        print(f"boards: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("boards: interrupted, nothing was written", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())

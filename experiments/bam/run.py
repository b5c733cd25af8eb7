"""Held-out errors of BAM's friction models M1 to M6 and of rigsight's friction laws on the same logs.

    python experiments/bam/run.py LOGS --bam /tmp/bam/bin/python --split motion --out FOLDER

Writes FOLDER/SPLIT.json and prints the table.
"""

from __future__ import annotations

import argparse
import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
from logs import SPLITS
from of_rigsight import rows_of

HERE = Path(__file__).parent


def table(rows: list[dict[str, Any]]) -> str:
    """Return the rows in Markdown, errors in mrad."""
    lines = [
        "| model | numbers | fitted logs | held-out logs | worst held-out log | as published, all logs | processor seconds |",
        "|---|---:|---:|---:|---:|---:|---:|",
    ]
    for row in rows:
        fitted, held = 1e3 * np.array(row["fitted"]), 1e3 * np.array(row["held_out"])
        known = f"{1e3 * np.mean(row['published']):.1f}" if "published" in row else ""
        lines.append(
            f"| {row['model']} | {len(row['numbers'])} | {fitted.mean():.1f} | {held.mean():.1f} | {held.max():.1f} | {known} | "
            f"{row['seconds']:.0f} |"
        )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("logs", type=Path, help="folder of the logs")
    parser.add_argument("--bam", type=Path, required=True, help="Python that has better-actuator-models")
    parser.add_argument("--split", choices=SPLITS, default="motion")
    parser.add_argument("--out", type=Path, required=True)
    choice = parser.parse_args()
    rows = rows_of(choice.logs, choice.split)
    command = [str(choice.bam), str(HERE / "of_bam.py"), str(choice.logs), "--split", choice.split]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    rows = [*json.loads(done.stdout), *rows]
    choice.out.mkdir(parents=True, exist_ok=True)
    (choice.out / f"{choice.split}.json").write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    print(table(rows))


if __name__ == "__main__":
    main()

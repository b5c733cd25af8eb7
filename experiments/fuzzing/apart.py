"""Run the inputs that the fuzzer kept through the unmodified program, which reads in a separate process: apart.py NAME FOLDER."""

from __future__ import annotations

import random
import sys
from pathlib import Path

from oracle import Oracle
from targets import TARGETS, inspected

MOST = 25
"""Inputs; each starts processes."""


def main(name: str, folder: Path) -> None:
    """Try all that crashed the library, and a draw of what reached something new."""
    crashed = sorted(file for kind in ("crash", "timeout", "oom") for file in folder.glob(f"{kind}-*"))
    kept = sorted((folder / "corpus").iterdir())
    drawn = random.Random(5).sample(kept, min(len(kept), max(MOST - len(crashed), 10)))
    judge = Oracle(folder / "apart", longest=400.0)
    for file in [*crashed, *drawn]:
        judge.judge(file.read_bytes(), inspected(TARGETS[name].suffix))
    judge.save(at_once=True)


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))

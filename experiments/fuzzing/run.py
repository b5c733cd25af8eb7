"""Fuzz every reader of files, guided by coverage: each input must end in a value or one message.

run.py                        every target for a minute; what was found lies in out/fuzzing, the table in results.md here
run.py --only TDMS --seconds 600
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from targets import TARGETS

HERE = Path(__file__).parent
OUT = HERE.parents[1] / "out/fuzzing"
TABLE = HERE / "results.md"
_MOST_RESTARTS = 30
_STATUS = re.compile(r"#\d+\s+\w+\s+cov: (\d+) ft: (\d+) corp: (\d+)/")


@dataclass(frozen=True)
class Outcome:
    """What fuzzing one target came to.

    Attributes
    ----------
    name
        Target.
    inputs, accepted
        Inputs tried, and those that were sound.
    before, after
        Places in the code reached by the seeds, and at the end.
    corpus
        Inputs kept because each reached something new.
    apart
        Inputs tried through the process of its own, None where there is none.
    crashes
        Times a library in C took the process with it, or ran in circles.
    findings
        Breaches of the promise, by kind.
    """

    name: str
    inputs: int
    accepted: int
    before: int
    after: int
    corpus: int
    apart: int | None
    crashes: int
    findings: tuple[str, ...]


def fuzz(name: str, seconds: int, out: Path) -> Outcome:
    """Fuzz a target for some seconds, starting again after every crash of a library in C."""
    folder = out / re.sub(r"\W+", "_", name)
    (folder).mkdir(parents=True, exist_ok=True)
    end, before, after = time.monotonic() + seconds, 0, 0
    for _ in range(_MOST_RESTARTS):
        left = int(end - time.monotonic())
        if left < 2:
            break
        log = folder / "log.txt"
        with log.open("wb") as stream:
            subprocess.run(
                [
                    sys.executable, str(HERE / "one_target.py"), name, str(folder), f"-max_total_time={left}", "-timeout=30",
                    "-rss_limit_mb=9000", "-max_len=40000", "-print_final_stats=1",
                ],
                stdout=subprocess.DEVNULL, stderr=stream, check=False, env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
            )  # fmt: skip
        reached = [
            int(cov) for cov, _, _ in _STATUS.findall(log.read_text(encoding="utf-8", errors="replace"))
        ]
        if reached:
            before = before or reached[0]
            after = max(after, reached[-1])
    return _outcome(name, folder, before, after)


def _outcome(name: str, folder: Path, before: int, after: int) -> Outcome:
    counts = _counts(folder)
    kinds = list(counts["kinds"])
    apart = None
    crashes = [file for kind in ("crash", "timeout", "oom") for file in folder.glob(f"{kind}-*")]
    if TARGETS[name].in_child:
        subprocess.run([sys.executable, str(HERE / "apart.py"), name, str(folder)], check=True)
        told = _counts(folder / "apart")
        apart, kinds = told["inputs"], kinds + told["kinds"]
    else:
        kinds += [file.name for file in crashes]
    n_kept = len(list((folder / "corpus").iterdir()))
    return Outcome(
        name, counts["inputs"], counts["accepted"], before, after, n_kept, apart, len(crashes), tuple(kinds)
    )


def _counts(folder: Path) -> dict:
    file = folder / "counts.json"
    if not file.is_file():
        raise SystemExit(f"{folder} contains no counts: the target did not start; see {folder / 'log.txt'}.")
    return json.loads(file.read_text(encoding="utf-8"))


def table(outcomes: Sequence[Outcome]) -> str:
    """Return the outcomes as Markdown."""
    lines = [
        "| reader | inputs | of these sound | places reached by the seeds -> at the end | kept | through its own process "
        "| crashes of its library | breaches |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for one in outcomes:
        apart = "-" if one.apart is None else f"{one.apart}"
        lines.append(
            f"| {one.name} | {one.inputs} | {one.accepted} | {one.before} -> {one.after} | {one.corpus} | {apart} "
            f"| {one.crashes} | {'; '.join(one.findings) or 'none'} |"
        )
    return "\n".join(lines) + "\n"


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", metavar="NAME", default=[], help="names of targets in the table")
    parser.add_argument("--seconds", type=int, default=60, help="seconds for each target, without its start")
    parser.add_argument(
        "--out", type=Path, default=OUT, help=f"default {OUT}; an existing corpus there is continued"
    )
    parser.add_argument(
        "--table", type=Path, default=None, help=f"default {TABLE}, if every target is fuzzed"
    )
    asked = parser.parse_args(arguments)
    unknown = [name for name in asked.only if name not in TARGETS]
    if unknown:
        raise SystemExit(f"Unknown: {', '.join(unknown)}. There are: {', '.join(TARGETS)}.")
    outcomes = []
    for name in asked.only or TARGETS:
        outcomes.append(fuzz(name, asked.seconds, asked.out))
        print(table(outcomes[-1:]).splitlines()[-1], flush=True)
    written = asked.table or (None if asked.only else TABLE)
    if written is not None:
        written.write_text(table(outcomes), encoding="utf-8")
    if any(one.findings for one in outcomes):
        raise SystemExit(f"Violations were found; the inputs are in {asked.out}.")


if __name__ == "__main__":
    main()

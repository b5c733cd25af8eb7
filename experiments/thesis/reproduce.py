"""Tables, figures and open questions of the thesis on the virtual rig: our values beside the published ones.

reproduce.py                 everything, some minutes
reproduce.py NAME...         these only; the names stand in README.md
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import error_tables
import figures
import parameter_tables
import questions
from rich.console import Console

OUT = Path("out/thesis")
SHOWN = {
    "3.1": parameter_tables.table_3_1,
    "4.1": parameter_tables.table_4_1,
    "5.2": parameter_tables.table_5_2,
    "5.1": error_tables.table_5_1,
    "step": error_tables.step_comparison,
    "6.1": error_tables.table_6_1,
    "6.2": error_tables.table_6_2,
    "question-1": questions.one_model_for_all_amplitudes,
    "question-2": questions.peak_and_break,
    "question-3": questions.sweeps_and_steps,
    "question-4": questions.conicity_table,
    "question-5": questions.upward_turn,
    "figures": lambda: figures.draw_all(OUT),
    "campaign": lambda: figures.write_campaign(OUT / "campaign"),
}


def main(names: list[str]) -> None:
    unknown = [name for name in names if name not in SHOWN]
    if unknown:
        raise SystemExit(f"Unknown: {', '.join(unknown)}. There are: {', '.join(SHOWN)}.")
    console = Console(width=None if sys.stdout.isatty() else 170)
    for name in names or SHOWN:
        begin = time.monotonic()
        console.print(SHOWN[name]())
        console.print(f"[dim]{name}: {time.monotonic() - begin:.0f} s[/dim]\n")


if __name__ == "__main__":
    main(sys.argv[1:])

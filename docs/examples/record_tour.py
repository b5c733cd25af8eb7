"""Record the terminal of docs/tour.md anew: python docs/examples/record_tour.py; takes some minutes."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "tour.md"
STEPS = (
    ("A logger wrote four files. What do they hold?", "rigsight inspect stage/sweep_5N.csv"),
    (
        "The rig is a stage: a mass on a spring and a damper. `init` writes the campaign and says what it guessed.",
        "rigsight init stage --model axis",
    ),
    (
        "The given simulation has a mass of 2 kg, a damping of 15 N s/m and a stiffness of 800 N/m. Enter these values:",
        "sed -i 's/^# m =    /m = 2.0  /; s/^# d =    /d = 15.0  /; s/^# k =    /k = 800.0  /' stage/campaign.toml",
    ),
    ("What is missing in it?", "rigsight diagnose stage --out results"),
    (
        "The drive indeed holds its output between samples; `init` had to assume something. Correct it and repeat:",
        'sed -i \'s/^hold = "foh"/hold = "zoh"/\' stage/campaign.toml; rigsight diagnose stage --out results',
    ),
    (
        "How much better is the completed model than one without the effect, record by record?",
        "rigsight identify stage --out linear --quiet; rigsight compare stage results linear --out compared",
    ),
    (
        "The completed model goes back into a program of your own.",
        "rigsight export results --to python --out stage.py",
    ),
)
HEAD = """# A tour in two minutes

Recorded by [record_tour.py](examples/record_tour.py): every command was run as printed, and its output is unchanged. The
records are those of the [first diagnosis](first_diagnosis.md), which explains each step: a positioning stage on dry guides,
whose simulation lacks the friction.
"""
TAIL = """## The same in a browser

`rigsight app stage` opens these steps as pages ([a first use](app.md), filmed): what is in a file,

![The page of a file: a table of its channels, and their plots over time](images/app/2-channels.png)

a diagnosis with its progress, the time left and a button to cancel it,

![The page Diagnosis while it runs: a bar, the candidate that was fitted last, the time left](images/app/6-running.png)

and its report.

![The page Diagnosis when it is done: the report, with its verdict](images/app/7-diagnosis.png)
"""


def shown(command: str, folder: Path) -> str:
    """Run a command line and return what a terminal of 100 columns shows."""
    surroundings = {
        **os.environ,
        "COLUMNS": "100",
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
    }
    ran = subprocess.run(
        command,
        shell=True,
        cwd=folder,
        env=surroundings,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        check=True,
    )
    return re.sub(r" +$", "", ran.stdout, flags=re.MULTILINE).strip("\n")


def main() -> None:
    text = [HEAD]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        subprocess.run(
            [sys.executable, str(ROOT / "docs" / "examples" / "make_stage.py"), str(folder / "stage")],
            check=True,
        )
        for words, command in STEPS:
            output = shown(command, folder)
            text.append(
                f"{words}\n\n```console\n$ {command}\n{output}\n```\n".replace("\n\n```\n", "\n```\n")
            )
    PAGE.write_text("\n".join([*text, TAIL]), encoding="utf-8")


if __name__ == "__main__":
    main()

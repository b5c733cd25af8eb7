"""Diagnose the single-effect trials of a bench again, each with its hidden effect removed from the candidates.

    .venv/bin/python experiments/calibration/leave_one_out.py BENCH FOLDER

Then the cause lies outside the catalogue, and nobody chose its form. Left out of this study are effects that another one of the
catalogue contains as a special case, and linear effects of a drive or sensor, which one of the other equals where there is one
sensor. Results go to FOLDER/NAME OF BENCH; a trial that is there already is kept.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

from rigsight.effects import CATALOGUE

CONTAINED = {parent for effect in CATALOGUE for parent in effect.parents} | {
    "free_play",
    "asymmetric_stiffness",
}
"""Parents, free play (an end stop without a spring inside), and an asymmetric spring (a cubic one under a constant force)."""
EQUAL_ON_ONE_SENSOR = {"input_delay", "sensor_delay", "actuator_lag", "sensor_lag", "time_shift"}


def main(bench: Path, folder: Path) -> None:
    """Diagnose what is waiting."""
    for run in sorted(bench.glob("results/*/run.json")):
        trial = run.parent.name
        key = json.loads((bench / "keys" / f"{trial}.json").read_text(encoding="utf-8"))
        target = folder / bench.name / trial
        if key["kind"] != "single" or target.exists() or not is_outside_then(key["effects"][0]):
            continue
        others = [
            word
            for effect in CATALOGUE
            if effect.name != key["effects"][0]
            for word in ("--effect", effect.name)
        ]
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=target.parent) as place:
            out = Path(place) / "results"
            command = [
                Path(sys.executable).parent / "rigsight",
                "diagnose",
                bench / "campaigns" / trial,
                "--out",
                out,
            ]
            subprocess.run([*map(str, command), "--jobs", "1", "--quiet", *others], check=False)
            if out.exists():
                out.rename(target)
                print(f"{trial}: {key['effects'][0]}", flush=True)


def is_outside_then(effect: str) -> bool:
    """Return True if nothing else in the catalogue obeys the equations of an effect."""
    return effect not in CONTAINED and effect not in EQUAL_ON_ONE_SENSOR


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))

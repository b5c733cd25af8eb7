"""Check that the surroundings of a diagnosis do not reveal the hidden effect: kernel cache, environment, files."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from campaigns import Campaign

from rigsight_bench.running.files import BenchFolder, trial_name
from rigsight_bench.running.trial import diagnose_trial

SPY = """
import json, os, sys
os.makedirs("results")
found = sorted(os.path.join(folder, name) for folder, _, names in os.walk(".") for name in names)
modes = [oct(os.stat(name).st_mode) for name in found]
parent = f"/proc/{os.getppid()}/cmdline"
reached = open(parent).read().replace(chr(0), " ") if os.path.exists(parent) else ""
seen = {"environment": dict(os.environ), "arguments": sys.argv, "files": found, "modes": modes, "order": os.listdir("campaign")}
json.dump({**seen, "parent": reached}, open("results/seen.json", "w"))
"""
DRAWS = """
import os, pathlib, sys
from unittest.mock import patch
from rigsight_bench.trials import draw_trial
from rigsight_bench.trials.standard import trial
from rigsight_bench.trials.standard.subjects import Subject
cache = pathlib.Path(os.environ["RIGSIGHT_CACHE_DIR"])
for effect in ("cubic_stiffness", "position_dependent_damping"):
    with patch.object(trial, "standard_subject_of", lambda *_: Subject("single", (effect,), "clear", "low")):
        draw_trial("standard", 6, 0)
    print(effect, len([file for file in cache.rglob("*") if file.is_file()]))
"""


def cache(_: list[Campaign]) -> None:
    """Print whether drawing leaves anything of the hidden effect in the cache that diagnoses share."""
    with tempfile.TemporaryDirectory() as place:
        environment = {**os.environ, "RIGSIGHT_CACHE_DIR": place}
        ran = subprocess.run(
            [sys.executable, "-c", DRAWS], env=environment, check=True, capture_output=True, text=True
        )
    print(
        "\nfiles in the kernel cache after drawing one effect, then another:",
        ", ".join(ran.stdout.splitlines()),
    )


def process(trials: list[Campaign]) -> None:
    """Print whether the surroundings of a diagnosing process differ between trials, and what it could reach if it tried."""
    seen = []
    with tempfile.TemporaryDirectory() as name:
        bench = BenchFolder(Path(name))
        for kind in ("single", "pair", "outside", "none", "parameters"):
            trial = next(t for t in trials if t.key["kind"] == kind)
            shutil.copytree(trial.folder, bench.campaign(trial_name(trial.number)))
            diagnose_trial(bench, trial_name(trial.number), start=("-c", SPY))
            seen.append(json.loads((bench.result(trial_name(trial.number)) / "seen.json").read_text()))
    for what in ("environment", "arguments", "files", "modes", "order"):
        variants = {json.dumps(one[what], sort_keys=True) for one in seen}
        print(f"{what} of the process: {len(variants)} variant(s) in five trials")
    print("variables:", ", ".join(sorted(seen[0]["environment"])))
    print("a hostile process could read its parent's command line:", bool(seen[0]["parent"]))

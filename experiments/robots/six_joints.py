"""Arms of six joints in MuJoCo: the residual in MuJoCo of what mujoco.sysid fits, and of the model that rigsight writes back."""

from __future__ import annotations

import argparse
import json
import logging
from pathlib import Path

import mujoco
from beside_sysid import error, fitted
from several_causes import DT, drawn, run_arm, write_records

from rigsight.workflow.export import run_export

N_JOINTS, N_CAUSES = 6, 2
FIELDS = ("damping", "armature", "frictionloss")
"""What mujoco.sysid fits, at every joint."""


def run_log(seed: int, folder: Path, n_jobs: int) -> dict[str, object]:
    """Correct the model of an arm in both ways, and return errors on the withheld record in noise floors."""
    arm = drawn(seed, N_JOINTS, N_CAUSES)
    write_records(arm, seed, folder)
    source = folder / "arm.xml"
    xml = source.read_text(encoding="utf-8")
    by_sysid, seconds = fitted(xml, folder, FIELDS, DT)
    found = run_arm(arm, seed, folder, n_jobs)
    written = run_export(folder / "results" / "model.json", "mjcf", folder / "corrected.xml", robot=source)
    return {
        **found,
        "given": error(mujoco.MjModel.from_xml_string(xml), folder, DT),
        "sysid": error(by_sysid, folder, DT),
        "sysid_seconds": round(seconds, 1),
        "corrected": error(mujoco.MjModel.from_xml_path(str(written.path)), folder, DT),
        "without_field": written.without_field,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--logs", type=int, nargs=2, default=(0, 10), metavar=("FIRST", "END"))
    parser.add_argument("--out", type=Path, required=True, help="folder of the records and results")
    parser.add_argument("--jobs", type=int, default=1, help="processes of each diagnosis")
    choice = parser.parse_args()
    logging.disable(logging.WARNING)
    choice.out.mkdir(parents=True, exist_ok=True)
    for seed in range(*choice.logs):
        result = choice.out / f"log_{seed:02d}.json"
        if not result.exists():
            own = run_log(seed, choice.out / f"log_{seed:02d}", choice.jobs)
            result.write_text(json.dumps(own), encoding="utf-8")
        print(result.read_text(encoding="utf-8"), flush=True)


if __name__ == "__main__":
    main()

"""The same input gives the same result, bit for bit, in another process and with other numbers of jobs."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import rigsight

PROGRAM = """
import sys
from pathlib import Path
from rigsight.effects import effect_named
from rigsight.workflow.diagnose import run_diagnose
names = ("coulomb_friction",)
if __name__ == "__main__":
    folder, out, jobs = sys.argv[1:]
    run_diagnose(Path(folder), Path(out), effects=[effect_named(name) for name in names], n_jobs=int(jobs))
"""


@pytest.mark.slow
def test_a_diagnosis_does_not_depend_on_jobs_hashes_or_compiled_kernels(
    axis_campaign: Path, tmp_path: Path
) -> None:
    program = tmp_path / "program.py"
    program.write_text(PROGRAM, "utf-8")
    source = str(Path(rigsight.__file__).parents[1])
    results = []
    # The first compiles the kernels; the other finds them.
    for jobs, hashes in (("2", "1"), ("1", "2")):
        out = tmp_path / f"out_{hashes}"
        subprocess.run(
            [sys.executable, program, axis_campaign, out, jobs],
            env={
                **os.environ,
                "PYTHONPATH": source,
                "PYTHONHASHSEED": hashes,
                "RIGSIGHT_CACHE_DIR": str(tmp_path / "kernels"),
            },
            check=True,
            timeout=600,
        )
        results.append({name: (out / name).read_bytes() for name in ("diagnosis.json", "model.json")})
    assert results[1] == results[0]

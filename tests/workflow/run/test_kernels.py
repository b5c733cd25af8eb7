from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from rigsight.errors import InputError
from rigsight.workflow.run.kernels import checked_jobs

FRESH_MACHINE = """
import json, sys
from pathlib import Path
import numpy as np
from rigsight.effects import effect_named
from rigsight.identify import GreyBoxFit
from rigsight.records import Record
from rigsight.rigs import ELEMENT
from rigsight.simulate import compose
from rigsight.workflow.run.kernels import prepare_kernels

cache = Path(sys.argv[1])
def machine_code():
    return sorted(path.name for path in cache.iterdir())

structures = [compose(ELEMENT), compose(ELEMENT, [effect_named("quadratic_damping")])]
steps = []
prepare_kernels(structures, 2, steps.append)
prepared = machine_code()
again = []
prepare_kernels(structures, 2, again.append)

t = 1e-2 * np.arange(200)
x = np.sin(5.0 * t)
record = Record(name="r", dt=1e-2, signals={"x": x, "force": 3.0 * x}, units={})
values = {"k": 2.0, "d": 0.1, "force_off": 0.0, "c_2": 0.1}
scales = {"x": 1.0, "force": 1.0, "time": 0.2, "input": 1.0}
for structure in structures:
    GreyBoxFit(structure, [record], scales, {"force": 1e-3}).fit(values, ["k"])
print(json.dumps({
    "steps": [(step.done, step.total, step.detail) for step in steps], "again": len(again),
    "prepared": len(prepared), "new": sorted(set(machine_code()) - set(prepared)),
}))
"""


@pytest.mark.slow
def test_kernels_compiled_beforehand_are_those_that_a_fit_calls(tmp_path: Path) -> None:
    environment = {**os.environ, "RIGSIGHT_CACHE_DIR": str(tmp_path)}
    ran = subprocess.run(
        [sys.executable, "-c", FRESH_MACHINE, str(tmp_path)],
        env=environment, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr
    reported = json.loads(ran.stdout)
    assert reported["steps"][0] == [0, 2, ""]
    assert {detail for _, _, detail in reported["steps"][1:]} == {"element", "quadratic_damping"}
    assert reported["again"] == 0
    assert reported["prepared"] > 0
    assert reported["new"] == []


def test_jobs_default_to_the_processors_there_are() -> None:
    assert checked_jobs(None) >= 1
    assert checked_jobs(3) == 3
    with pytest.raises(InputError, match=r"must lie in \[1, 1024\], got 0"):
        checked_jobs(0)

"""The exported C file, compiled without a warning, against the engine."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from rigsight.export import export_model

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")

STRICT = ["-O2", "-Wall", "-Wextra", "-Werror", "-std=c99", "-pedantic"]


def compiled(folder: Path, *arguments: str) -> Path:
    program = folder / "program"
    command = ["gcc", *STRICT, "-o", str(program), *arguments, "-lm"]
    run = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    return program


def written(case, folder: Path, **options) -> str:
    text = export_model(case.model, "c", source="model.json", name="rig", **options)
    assert isinstance(text, str)
    (folder / "rig.c").write_text(text, encoding="utf-8")
    return text


def output_of(program: Path, case) -> dict[str, np.ndarray]:
    rows = np.column_stack([case.t, *case.inputs])
    lines = ["head", *(",".join(f"{value!r}" for value in row) for row in rows.tolist())]
    run = subprocess.run([program], input="\n".join(lines) + "\n", capture_output=True, text=True, check=True)
    head, *body = run.stdout.splitlines()
    table = np.array([[float(value) for value in line.split(",")] for line in body])
    assert head.split(",") == ["t", *case.outputs]
    return {name: table[:, i + 1] for i, name in enumerate(case.outputs)}


def test_it_gives_the_outputs_of_the_engine(case, tmp_path: Path):
    written(case, tmp_path)
    simulated = output_of(compiled(tmp_path, "-DRIG_MAIN", "rig.c"), case)
    assert max(case.errors(simulated).values()) <= 1e-6
    # Across kinks the engine's own error at its default accuracy is what remains.
    told = max(case.errors(simulated, told=True).values())
    assert told <= (1e-6 if case.smooth else 2e-5)


def test_a_program_of_one_s_own_uses_the_declarations(case_named, tmp_path: Path):
    case = case_named("coulomb_friction")
    written(case, tmp_path)
    (tmp_path / "own.c").write_text(
        """#define RIG_DECLARATIONS
#include "rig.c"
#include <stdio.h>
int main(void) {
    static rig_model m;
    rig_parameters p;
    double u[1] = {0.2}, y[2];
    int i, bad;
    rig_defaults(&p);
    p.T_c = 5.0;
    bad = rig_init(&m, &p, u);
    for (i = 0; i < 100; i++) bad |= rig_step(&m, 0.01, u, u);
    rig_outputs(&m, y);
    printf("%d %d %.17g\\n", bad, m.moving, y[0]);
    return 0;
}
""",
        encoding="utf-8",
    )
    program = compiled(tmp_path, "own.c", "rig.c")
    run = subprocess.run([program], capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["0", "0", "0"]


@pytest.mark.parametrize("broken", ["0.02,0.1\n0.025,0.2\n", "0.02,x\n", "0.02\n"])
def test_the_program_stops_at_what_it_cannot_use(broken: str, case_named, tmp_path: Path):
    case = case_named("input_delay")
    written(case, tmp_path)
    program = compiled(tmp_path, "-DRIG_MAIN", "rig.c")
    text = "t,u\n0.0,0.0\n0.01,0.0\n" + broken
    run = subprocess.run([program], input=text, capture_output=True, text=True, check=False)
    assert run.returncode == 1
    assert "line" in run.stderr


def test_a_delay_longer_than_the_history_is_told(case_named, tmp_path: Path):
    case = case_named("input_delay")
    written(case, tmp_path)
    program = compiled(tmp_path, "-DRIG_MAIN", "-DRIG_HISTORY=4", "rig.c")
    run = subprocess.run([program], input="0,0\n0.01,0\n", capture_output=True, text=True, check=False)
    assert run.returncode == 1
    assert "status 3" in run.stderr

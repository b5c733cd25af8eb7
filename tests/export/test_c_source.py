"""The exported C file, compiled without a warning, is the engine."""

from __future__ import annotations

import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rigsight.export.targets import export_model
from rigsight.libraries.library_cache import c_compilers, kernel_options
from rigsight.simulate.compiled.kernel_equations import KernelEquations
from rigsight.simulate.compiled.kernel_source import accurate_integrator

from ..tiers import slow_but

WARNED = ("-Wall", "-Wextra", "-Werror", "-std=c99", "-pedantic")
STRICT = ("-O2", *WARNED)
TO_ROUNDING = 1e-11
"""With the engine's options. Measured: 1e-14 and less, but 1e-12 where the test itself computes the rates of a motion."""
OTHER_ROUNDING = 1e-8
"""With others. Measured: 3e-14 here, 3e-9 in 3000 samples of a Bouc-Wen loop, where rounding shows in the lengths of
steps. A hundredth of the error that the engine aims for."""


def compiled(folder: Path, *arguments: str, flags: tuple[str, ...] = STRICT) -> Path:
    program = folder / "program"
    command = [*c_compilers()[0].command, *flags, "-o", str(program), *arguments, "-lm"]
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


@pytest.mark.slow
def test_it_gives_the_outputs_of_the_engine_to_rounding(case, tmp_path: Path):
    written(case, tmp_path)
    flags = (*(option for option in kernel_options() if option != "-w"), *WARNED)
    simulated = output_of(compiled(tmp_path, "-DRIG_MAIN", "rig.c", flags=flags), case)
    assert max(case.errors(simulated, reported=True).values()) <= TO_ROUNDING


# One of each kind of text that the integrator has; FMUs are compiled with yet other options.
@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    slow_but(
        "stribeck_friction", "all delays", "friction at two joints", "a mass matrix of coordinates",
        of=[
            "bouc_wen_hysteresis", "iwan_hysteresis", "stribeck_friction", "backlash", "all delays", "start held by friction",
            "element with sliders", "friction at two joints", "a saturated control law", "a mass matrix of coordinates",
            "a prescribed road",
        ],
    ),
)  # fmt: skip
def test_other_options_give_them_too(name: str, case_named, tmp_path: Path):
    case = case_named(name)
    written(case, tmp_path)
    simulated = output_of(compiled(tmp_path, "-DRIG_MAIN", "rig.c"), case)
    assert max(case.errors(simulated, reported=True).values()) <= OTHER_ROUNDING


def test_it_holds_the_engine_s_own_text(case_named, tmp_path: Path):
    case = case_named("backlash")
    text = written(case, tmp_path)
    assert accurate_integrator(KernelEquations(case.model.structure)) in text


@pytest.mark.slow
def test_its_accuracy_can_be_chosen(case_named, tmp_path: Path):
    case = case_named("bouc_wen_hysteresis")
    written(case, tmp_path)
    usual, fine = (
        output_of(compiled(tmp_path, "-DRIG_MAIN", f"-DRIG_ACCURACY={accuracy}", "rig.c"), case)
        for accuracy in ("1e-6", "1e-8")
    )
    assert max(case.errors(usual, reported=True).values()) <= OTHER_ROUNDING
    assert max(case.errors(fine).values()) < 0.1 * max(case.errors(usual).values())


def test_sample_times_may_vary_where_nothing_is_remembered(case_named, tmp_path: Path):
    case = case_named("cubic_stiffness")
    written(case, tmp_path)
    middle = 0.5 * (case.t[1:] + case.t[:-1])
    # Every third interval is cut in two on the same straight line.
    t = np.sort(np.concatenate([case.t, middle[::3]]))
    finer = replace(case, t=t, inputs=(np.interp(t, case.t, case.inputs[0]),))
    simulated = output_of(compiled(tmp_path, "-DRIG_MAIN", "rig.c"), finer)
    kept = np.isin(t, case.t)
    assert max(case.errors({name: y[kept] for name, y in simulated.items()}).values()) <= 1e-6


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


@pytest.mark.slow
def test_a_start_that_friction_would_hold_is_refused_with_a_status_of_its_own(case_named, tmp_path: Path):
    case = case_named("friction at two joints")
    written(case, tmp_path)
    program = compiled(tmp_path, "-DRIG_MAIN", "rig.c")
    run = subprocess.run([program], input="0,0.2\n0.01,0.2\n", capture_output=True, text=True, check=False)
    assert run.returncode == 1
    assert "status 5" in run.stderr

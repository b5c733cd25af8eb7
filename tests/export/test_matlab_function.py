"""The exported MATLAB function in Octave against the engine."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from rigsight.export.targets import export_model

pytestmark = [
    pytest.mark.skipif(
        shutil.which("octave-cli") is None, reason="octave-cli is not installed (apt-get install octave)"
    ),
    pytest.mark.slow,
]

N_SAMPLES = 41
LONG_STARTS = {"offsets", "start under load"}
"""Starts that are sought over tens of thousands of steps: a minute each in Octave, and left to the other languages."""


@pytest.fixture(scope="module")
def results(tmp_path_factory, case_named, case_names, refused) -> Path:
    """The folder with the outputs of all models, out of one session of Octave, which takes a second to start."""
    folder = tmp_path_factory.mktemp("octave")
    script = ["warning('off', 'all');"]
    for i, name in enumerate(case_names):
        case = case_named(name)
        if name in LONG_STARTS or refused(case, "matlab"):
            continue
        text = export_model(case.model, "matlab", source="model.json", name=f"rig{i}")
        assert isinstance(text, str)
        (folder / f"rig{i}.m").write_text(text, encoding="utf-8")
        np.savetxt(folder / f"in{i}.txt", np.column_stack([case.t, *case.inputs])[:N_SAMPLES], fmt="%.17g")
        signals = ", ".join(f"a(:, {k + 2})" for k in range(len(case.inputs)))
        script += [
            f"a = load('in{i}.txt'); y = rig{i}(a(:, 1), {signals});",
            f"dlmwrite('out{i}.txt', y, 'delimiter', ' ', 'precision', '%.17g');",
        ]
    (folder / "run_models.m").write_text("\n".join(script) + "\n", encoding="utf-8")
    surroundings = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    run = subprocess.run(
        ["octave-cli", "-q", "run_models.m"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        env=surroundings,
    )
    assert run.returncode == 0, run.stderr
    return folder


def test_it_gives_the_outputs_of_the_engine(case, case_names, refused, results: Path):
    if case.name in LONG_STARTS or refused(case, "matlab"):
        pytest.skip("seeking this start takes Octave a minute, or it is refused")
    table = np.loadtxt(results / f"out{case_names.index(case.name)}.txt", ndmin=2)
    assert table.shape == (N_SAMPLES, len(case.outputs))
    simulated = {name: table[:, i] for i, name in enumerate(case.outputs)}
    assert max(case.errors(simulated).values()) <= 1e-6

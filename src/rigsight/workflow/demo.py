"""What `rigsight demo` does: a virtual rig with a hidden effect makes a campaign, which is then diagnosed like any other."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rigsight.diagnose import Diagnosis
from rigsight.effects import CATALOGUE, effect_named
from rigsight.excitation import log_sweep, step
from rigsight.records import Hold, Kind, Record, Role
from rigsight.rigs import RUNNING_GEAR
from rigsight.rigs.published import PublishedSet, published_sets
from rigsight.simulate import Structure, compose, simulate
from rigsight.workflow.diagnose import run_diagnose
from rigsight.workflow.kernels import checked_jobs, prepare_kernels, structures_to_try
from rigsight.workflow.progress import Listener, Stage, silent
from rigsight.workflow.results import check_writable, removed_on_failure, write_together

CAMPAIGN_FOLDER = "campaign"
HIDDEN_EFFECT = "bouc_wen_hysteresis"
MEASURING = "Measuring on the virtual rig"

# One hysteresis with constant numbers that comes near the published responses at all amplitudes, where the published
# linear simulation needs other numbers at each; not itself published.
_HIDDEN = {
    "J_z": 0.58, "k_c": 700.0, "k_d": 0.5, "psi_off": 8e-4, "l_0": 0.25, "c_y": 0.98, "y_off": 2e-4,
    "A": 1.0, "a": 0.09, "beta": 2660.0, "gamma": -660.0, "n": 1.0,
}  # fmt: skip
_GIVEN_SET = "identified"
_DT = 5e-3
_NOISE = {"psi": 2e-5, "y": 2e-5}
"""Standard deviation of the sensor noise [rad], [m]."""
_SWEEP_TIME = 60.0
_SWEEP_OMEGA = (2.0 * math.pi * 0.1, 2.0 * math.pi * 10.0)
_STEP_TIME = 20.0
_STEP_START = 10.0


@dataclass(frozen=True)
class _Run:
    """One experiment on the virtual rig."""

    name: str
    role: Role
    kind: Kind
    amplitude: float
    hold: Hold
    duration: float
    signal: Callable[[NDArray[np.float64], float], NDArray[np.float64]]


def _sweep(t: NDArray[np.float64], amplitude: float) -> NDArray[np.float64]:
    return log_sweep(t, amplitude, *_SWEEP_OMEGA)


def _step(t: NDArray[np.float64], amplitude: float) -> NDArray[np.float64]:
    return step(t, amplitude, _STEP_START)


_RUNS = (
    _Run("sweep_0.25A", "estimation", "sweep", 0.25, "foh", _SWEEP_TIME, _sweep),
    _Run("sweep_0.50A", "estimation", "sweep", 0.50, "foh", _SWEEP_TIME, _sweep),
    _Run("sweep_0.75A", "validation", "sweep", 0.75, "foh", _SWEEP_TIME, _sweep),
    _Run("sweep_1.00A", "estimation", "sweep", 1.00, "foh", _SWEEP_TIME, _sweep),
    _Run("step_0.60A", "validation", "step", 0.60, "zoh", _STEP_TIME, _step),
)


def run_demo(
    out: str | Path,
    *,
    seed: int = 0,
    n_jobs: int | None = None,
    listener: Listener = silent,
    command: str = "rigsight demo",
) -> Diagnosis:
    """Measure a virtual running gear with a hidden hysteresis and diagnose the campaign.

    Parameters
    ----------
    out
        Folder for the results of the diagnosis; the campaign goes into its folder ``campaign``.
    seed
        Seed of the sensor noise and of the diagnosis.
    n_jobs
        Candidates fitted at the same time; None for one per processor.
    listener
        Told of every finished step.
    command
        The command line that the report quotes.

    Raises
    ------
    InputError
        If the results cannot be written.
    """
    out = Path(out)
    jobs = checked_jobs(n_jobs)
    check_writable(out)
    folder = out / CAMPAIGN_FOLDER
    # With the exponent as a number, it is the very kernel that the diagnosis starts with: one less to compile.
    structure = compose(RUNNING_GEAR, [effect_named(HIDDEN_EFFECT)], {"n": _HIDDEN["n"]})
    prepare_kernels(structures_to_try(RUNNING_GEAR, CATALOGUE), jobs, listener)
    files = _campaign(structure, np.random.default_rng(seed), listener)
    with removed_on_failure(folder):
        write_together(folder, files)
        return run_diagnose(folder, out, seed=seed, n_jobs=jobs, listener=listener, command=command)


def _campaign(structure: Structure, rng: np.random.Generator, listener: Listener) -> dict[str, str]:
    """Return the files of the campaign; nothing in them tells the hidden effect or its numbers."""
    given = published_sets()[_GIVEN_SET]
    truth = {**given.constants, **_HIDDEN}
    stage = Stage(MEASURING, len(_RUNS), listener)
    files = {"campaign.toml": _campaign_toml(given)}
    for run in _RUNS:
        files[f"{run.name}.csv"] = _csv_text(_measured(structure, truth, run, rng))
        stage.finished(run.name)
    return files


def _measured(
    structure: Structure, truth: Mapping[str, float], run: _Run, rng: np.random.Generator
) -> Record:
    t = _DT * np.arange(round(run.duration / _DT), dtype=np.float64)
    record = Record(
        name=run.name, dt=_DT, signals={"u": run.signal(t, run.amplitude)}, units={"u": "A"}, hold=run.hold
    )
    clean = simulate(structure, truth, record)
    noisy = {name: clean[name] + rng.normal(scale=size, size=t.size) for name, size in _NOISE.items()}
    return clean.with_signals(**noisy)


def _csv_text(record: Record) -> str:
    names = ("u", "psi", "y")
    rows = np.column_stack([record.t, *(record[name] for name in names)])
    lines = [",".join(("t", *names)), *(",".join(f"{value:.9g}" for value in row) for row in rows)]
    return "\n".join(lines) + "\n"


def _campaign_toml(given: PublishedSet) -> str:
    constants = "\n".join(f"{name} = {value!r}" for name, value in given.constants.items())
    numbers = {**given.parameters, **given.given}
    if "delta_0" in given.given:
        del numbers["c_y"]
    parameters = "\n".join(f"{name} = {value!r}" for name, value in numbers.items())
    records = "\n".join(
        f'''
[[records]]
file = "{run.name}.csv"
role = "{run.role}"
kind = "{run.kind}"
amplitude = {run.amplitude}
hold = "{run.hold}"'''
        for run in _RUNS
    )
    return f'''title = "Virtual running gear"

[rig]
model = "{given.rig}"

[rig.constants]
{constants}

# {given.title}: {given.source}
[rig.parameters]
{parameters}
{records}
'''

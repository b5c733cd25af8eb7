"""Files and records that many tests need."""

from __future__ import annotations

import contextlib
import hashlib
import importlib.metadata
import json
import os
import pickle
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from threadpoolctl import threadpool_limits

import rigsight
from rigsight import cli
from rigsight.effects import effect_named
from rigsight.excitation import linear_sweep
from rigsight.libraries.library_cache import processor
from rigsight.records import Record
from rigsight.rigs import AXIS, Rig, read_rig_file
from rigsight.simulate import compose, simulate

# Timings decide no test: on a busy machine an example may take any time.
settings.register_profile("rigsight", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("rigsight")

# Tests run side by side, a process per processor. Matrix products spread over the same processors wait for each other there:
# a fit of a step took 4 s of processor time instead of 0.1 s. The variable is for the processes that tests start.
threadpool_limits(limits=1, user_api="blas")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Whoever starts the tests in the background may have them ignore Ctrl-C, and the commands that they start inherit that.
for number, handler in ((signal.SIGINT, signal.default_int_handler), (signal.SIGTERM, signal.SIG_DFL)):
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, handler)
if hasattr(signal, "SIGHUP"):
    signal.signal(signal.SIGHUP, signal.SIG_DFL)

Run = Callable[..., tuple[int, str, str]]
Kept = Callable[[str, Callable[[], Any]], Any]
TESTS = Path(__file__).parent
SHARED_DATA = TESTS.parent / "../shared/data"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The third-party records, which are not part of the repository."""
    if not SHARED_DATA.is_dir():
        pytest.skip(f"the third-party records are not at {SHARED_DATA}")
    return SHARED_DATA


def sweep_rows(n_samples: int = 200, dt: float = 0.01) -> np.ndarray:
    """Time, current, yaw angle and lateral displacement, shape (n_samples, 4)."""
    t = dt * np.arange(n_samples)
    return np.column_stack([t, np.sin(3 * t**2), 0.1 * np.sin(3 * t**2 - 0.4), 0.01 * np.cos(2 * t)])


@pytest.fixture
def write_csv(tmp_path: Path) -> Callable[..., Path]:
    """Write rows of a sweep as a delimited file and return its path."""

    def write(
        name: str = "sweep.csv",
        rows: np.ndarray | None = None,
        header: str | None = "t,u,psi,y",
        separator: str = ",",
        change: Callable[[list[str]], None] | None = None,
    ) -> Path:
        rows = sweep_rows() if rows is None else rows
        lines = [] if header is None else [header]
        lines += [separator.join(f"{value:.9g}" for value in row) for row in rows]
        if change is not None:
            change(lines)
        path = tmp_path / name
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path

    return write


AXIS_NOISE = 2e-5
AXIS_MODEL: dict[str, Any] = {
    "schema_version": 1,
    "rig": "axis",
    "hold": "foh",
    "constants": {"gain": 1.0},
    "parameters": {"m": 2.0, "d": 5.0, "k": 800.0, "x_off": 0.0, "force_off": 0.0},
    "effects": ["cubic_stiffness"],
    "effect_parameters": {"k_3": 5e6},
    "units": {"k_3": "N/m^3"},
}
AXIS_CAMPAIGN = """\
title = "stage"

[rig]
model = "axis"

[rig.parameters]
m = 2.0
d = 5.0
k = 800.0

[[records]]
file = "fit.csv"
role = "estimation"
kind = "sweep"
amplitude = 4.0

[[records]]
file = "score.csv"
role = "validation"
kind = "sweep"
amplitude = 3.0
"""


def axis_record(name: str, amplitude: float, seed: int) -> Record:
    """A sweep of an axis with a cubic spring, with sensor noise, after a second of rest."""
    t = 5e-3 * np.arange(2000)
    u = np.concatenate([np.zeros(200), linear_sweep(t[200:], amplitude, 3.0, 60.0)])
    record = Record(name=name, dt=5e-3, signals={"u": u}, units={"u": "N"})
    values = {**AXIS_MODEL["constants"], **AXIS_MODEL["parameters"], **AXIS_MODEL["effect_parameters"]}
    clean = simulate(compose(AXIS, [effect_named("cubic_stiffness")]), values, record)
    noise = np.random.default_rng(seed).normal(scale=AXIS_NOISE, size=t.size)
    return clean.with_signals(x=clean["x"] + noise)


@pytest.fixture(scope="session")
def axis_rows() -> dict[str, np.ndarray]:
    """Time, input and displacement of the records of the axis campaign, by file name."""
    records = {"fit.csv": axis_record("fit", 4.0, 1), "score.csv": axis_record("score", 3.0, 2)}
    return {name: np.column_stack([r.t, r["u"], r["x"]]) for name, r in records.items()}


@pytest.fixture
def axis_campaign(tmp_path: Path, axis_rows: dict[str, np.ndarray]) -> Path:
    """The folder of a campaign that a diagnosis solves in seconds: the given axis lacks a cubic spring."""
    folder = tmp_path / "stage"
    folder.mkdir()
    (folder / "campaign.toml").write_text(AXIS_CAMPAIGN, encoding="utf-8")
    for name, rows in axis_rows.items():
        lines = ["t,u,x", *(",".join(f"{value:.9g}" for value in row) for row in rows)]
        (folder / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder


@pytest.fixture
def write_model(tmp_path: Path) -> Callable[..., Path]:
    """Write the model of the axis with changes and return its file."""

    def write(change: Callable[[dict[str, Any]], object] | None = None, text: str | None = None) -> Path:
        content = json.loads(json.dumps(AXIS_MODEL))
        if change is not None:
            change(content)
        path = tmp_path / "model.json"
        path.write_text(json.dumps(content, indent=2) if text is None else text, encoding="utf-8")
        return path

    return write


@pytest.fixture(scope="session")
def kept(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Kept:
    """Return what takes long to make: from disk, if all that it depends on is the same as when it was made.

    What is kept lies below `.pytest_cache`, under a hash of the sources of rigsight and of the tests, and is made once for all
    processes that test.
    """
    state = sources_hash()
    cache = getattr(request.config, "cache", None)
    folder = tmp_path_factory.getbasetemp() if cache is None else Path(cache.mkdir("rigsight"))

    def get(name: str, make: Callable[[], Any]) -> Any:
        file = folder / f"{name}.{state}"
        with (folder / f"{name}.lock").open("w") as lock:
            # Where files cannot be locked, two processes may make the same; the later one replaces what is alike.
            with contextlib.suppress(ImportError):
                import fcntl

                fcntl.flock(lock, fcntl.LOCK_EX)
            if not file.exists():
                for earlier in folder.glob(f"{name}.*"):
                    if earlier.suffix != ".lock":
                        earlier.unlink(missing_ok=True)
                part = folder / f"{name}.{os.getpid()}"
                part.write_bytes(pickle.dumps(make()))
                part.replace(file)
        return pickle.loads(file.read_bytes())

    return get


def sources_hash() -> str:
    """Return a hash of what a result depends on: sources of rigsight and of the tests, packages, processor, this Python."""
    found = hashlib.sha256(sys.version.encode() + processor().encode())
    for package in ("control", "numpy", "scikit-learn", "scipy", "sympy"):
        found.update(importlib.metadata.version(package).encode())
    for root in (Path(rigsight.__file__).parent, TESTS.parent / "bench/src", TESTS):
        for path in sorted(root.rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts:
                found.update(str(path.relative_to(root)).encode() + b"\0" + path.read_bytes())
    return found.hexdigest()[:32]


@pytest.fixture
def mass_on_spring(tmp_path: Path) -> Callable[..., Rig]:
    """Make a rig of one mass on a spring, driven by a force, whose joint is written as asked."""

    def make(units: dict[str, str], **joint: str) -> Rig:
        lines = [
            'name = "stage"', 'summary = "A mass on a spring."', 'inputs.u.unit = "N"', 'parameters.m.unit = "kg"',
            *(f'parameters.{name}.unit = "{unit}"' for name, unit in units.items()),
            'coordinates.x.unit = "m"', 'energy.kinetic = "m*d(x)^2/2"', 'joints.spring.motion = "x"',
            *(f'joints.spring.{key} = "{expression}"' for key, expression in joint.items()),
            'drives.motor = {signal = "u", force = "motor", along = "x"}', 'sensors.x = {reads = "x", unit = "m"}',
        ]  # fmt: skip
        file = tmp_path / "stage.toml"
        file.write_text("\n".join(lines), encoding="utf-8")
        return read_rig_file(file)

    return make


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Run:
    """Run a command line in this process and return exit code, stdout and stderr."""

    def call(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["rigsight", *map(str, arguments)])
        capfd.readouterr()
        try:
            cli.main()
            code: Any = 0
        except SystemExit as leaving:
            code = leaving.code or 0
        return code, *capfd.readouterr()

    return call

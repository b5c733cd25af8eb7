"""Every trial comes back once, whoever dies on the way; what is wrong with a cluster is said."""

from __future__ import annotations

import json
import logging
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any, overload

import pytest

import rigsight
import rigsight_bench
from rigsight.errors import InputError, RigsightError
from rigsight_bench.running import execution
from rigsight_bench.running.execution import finished

pytestmark = pytest.mark.slow

PATIENCE = 120.0


def no_dask() -> bool:
    try:
        import distributed  # noqa: F401
    except ImportError:
        return True
    return False


on_a_cluster = pytest.mark.skipif(
    no_dask(), reason="distributed is not installed: pip install './bench[cluster]'"
)


def trial_in(
    folder: Path, seconds: float = 0.0, failing: int | None = None
) -> Callable[[int], tuple[int, int]]:
    """Return a trial that leaves a file as it begins; nested, so that it travels to workers that have no tests."""

    def run(trial: int) -> tuple[int, int]:
        (folder / f"{trial}-{os.getpid()}").touch()
        if trial == failing:
            raise ZeroDivisionError(f"trial {trial} fails")
        time.sleep(seconds)
        return trial, os.getpid()

    return run


def begun(folder: Path) -> list[tuple[int, int]]:
    return [(int(trial), int(pid)) for trial, pid in (file.name.split("-") for file in folder.iterdir())]


@contextmanager
def running(*arguments: str, place: Path, **environment: str) -> Iterator[subprocess.Popen[bytes]]:
    """Run a command of Dask's own."""
    with (place / "log.txt").open("ab") as log:
        process = subprocess.Popen(
            [sys.executable, "-m", "dask", *arguments],
            cwd=place,
            env={**os.environ, **environment},
            stdout=log,
            stderr=log,
        )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


@contextmanager
def scheduler(place: Path, **environment: str) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    file = place / "scheduler.json"
    options = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(file))
    with running("scheduler", *options, place=place, **environment) as process:
        until = time.monotonic() + PATIENCE
        while not file.exists() or not file.read_text().strip():
            assert process.poll() is None, (place / "log.txt").read_text()
            assert time.monotonic() < until
            time.sleep(0.05)
        yield json.loads(file.read_text())["address"], process


@contextmanager
def worker(address: str, place: Path, **environment: str) -> Iterator[subprocess.Popen[bytes]]:
    options = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", str(place))
    with running("worker", address, *options, place=place, **environment) as process:
        yield process


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with scheduler(tmp_path_factory.mktemp("scheduler")) as (found, _):
        yield found


@pytest.fixture
def files(tmp_path: Path) -> Path:
    folder = tmp_path / "files"
    folder.mkdir()
    return folder


def test_every_trial_of_this_machine_comes_back(files: Path) -> None:
    found = list(finished(trial_in(files), range(7), n_jobs=2))
    assert sorted(trial for trial, _ in found) == list(range(7))
    assert os.getpid() not in {pid for _, pid in found}


def test_an_error_of_a_trial_is_raised(files: Path) -> None:
    with pytest.raises(ZeroDivisionError, match="trial 1 fails"):
        list(finished(trial_in(files, failing=1), range(3), n_jobs=2))


def test_a_killed_process_of_this_machine_is_told_as_what_it_is() -> None:
    def run(trial: int) -> int:
        os.kill(os.getpid(), signal.SIGKILL)
        return trial

    with pytest.raises(RigsightError, match="continues the bench"):
        list(finished(run, range(2), n_jobs=2))


@pytest.mark.slow
@on_a_cluster
def test_a_worker_that_is_killed_in_the_middle_loses_no_trial(
    address: str, tmp_path: Path, files: Path
) -> None:
    trials = range(10)
    with worker(address, tmp_path) as first, worker(address, tmp_path):
        found, lost = [], None
        for trial, pid in finished(trial_in(files, seconds=0.2), trials, 1, address, folder=tmp_path):
            found.append((trial, pid))
            ended = {done for done, _ in found}
            in_the_middle = [t for t, p in begun(files) if p == first.pid and t not in ended]
            if lost is None and in_the_middle:
                first.send_signal(signal.SIGKILL)
                lost = in_the_middle[0]
    assert sorted(trial for trial, _ in found) == list(trials)
    assert lost is not None
    assert {pid for trial, pid in begun(files) if trial == lost} >= {first.pid, dict(found)[lost]}
    assert dict(found)[lost] != first.pid
    assert not list(tmp_path.glob(".seen-by-workers*"))


class Asked(Sequence[int]):
    """Many trials that know how many of them were asked for."""

    def __init__(self) -> None:
        self.most = 0

    def __len__(self) -> int:
        return 100_000

    @overload
    def __getitem__(self, index: int) -> int: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[int]: ...
    def __getitem__(self, index: Any) -> Any:
        self.most = max(self.most, index + 1)
        return index


@on_a_cluster
def test_a_bench_waits_for_workers_and_what_is_left_early_begins_no_more(
    address: str, tmp_path: Path, files: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(execution, "_LOOK_AGAIN", 0.3)
    said: list[str] = []
    trials = Asked()
    with ExitStack() as later:

        def say(text: str) -> None:
            if not said:
                later.enter_context(worker(address, tmp_path))
            said.append(text)

        results = finished(trial_in(files, seconds=0.05), trials, 1, address, say=say)
        until = time.monotonic() + PATIENCE
        while len(said) < 2 and time.monotonic() < until:
            next(results)
        results.close()  # type: ignore[attr-defined]
        time.sleep(0.2)
        left = len(begun(files))
        time.sleep(0.5)
        assert len(begun(files)) == left
    assert "No worker" in said[0]
    assert address in said[0]
    assert "Continuing" in said[1]
    assert trials.most < 100


@on_a_cluster
def test_an_error_of_a_trial_on_a_worker_is_raised(address: str, tmp_path: Path, files: Path) -> None:
    with worker(address, tmp_path), pytest.raises(ZeroDivisionError, match="trial 2 fails"):
        list(finished(trial_in(files, failing=2), range(5), 1, address))


@on_a_cluster
def test_a_scheduler_that_does_not_answer_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(execution, "_REACHED_WITHIN", 1.0)
    with closing(socket.create_server(("127.0.0.1", 0))) as server:
        free = f"tcp://127.0.0.1:{server.getsockname()[1]}"
    for wrong in (free, "tcp://127.0.0.1:nonsense", "no/address"):
        with pytest.raises(InputError, match="dask scheduler") as caught:
            list(finished(abs, [1], 1, wrong))
        assert wrong in str(caught.value)


@on_a_cluster
def test_a_worker_that_does_not_see_the_folder_is_named(address: str, tmp_path: Path, files: Path) -> None:
    shared = tmp_path / "bench"
    with ExitStack() as later:

        def say(_: str) -> None:
            # What lies in the folder here never reaches this worker.
            for mark in shared.iterdir():
                mark.unlink()
            later.enter_context(worker(address, tmp_path))

        with pytest.raises(InputError, match=f"{shared}.*shared file system"):
            list(finished(trial_in(files), range(3), 1, address, folder=shared, say=say))
    assert not begun(files)


@on_a_cluster
def test_a_worker_with_another_rigsight_is_named(address: str, tmp_path: Path, files: Path) -> None:
    other = tmp_path / "other"
    for package in (rigsight, rigsight_bench):
        source = Path(str(package.__file__)).parent
        shutil.copytree(source, other / source.name)
    (other / "rigsight" / "units.py").open("a").write("# another state\n")
    with (
        worker(address, tmp_path, PYTHONPATH=str(other)),
        pytest.raises(InputError, match="install the same version on both"),
    ):
        list(finished(trial_in(files), range(3), 1, address))
    assert not begun(files)


@pytest.mark.slow
@on_a_cluster
@pytest.mark.parametrize("away", [0.0, 2.0])
def test_a_scheduler_that_dies_is_told_in_one_message(
    away: float,
    tmp_path: Path,
    files: Path,
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # Whoever takes the results may be away while the connection is given up.
    monkeypatch.setattr(execution, "_REACHED_WITHIN", 1.0)
    # Dask's messages go to handlers of its own.
    monkeypatch.setattr(logging.getLogger("distributed"), "propagate", True)
    with scheduler(tmp_path) as (own, process), worker(own, tmp_path):
        results = finished(trial_in(files, seconds=0.1), range(1000), 1, own)
        next(results)
        process.kill()
        time.sleep(away)
        with pytest.raises(RigsightError, match="continues the bench"):
            list(results)
    assert not [record for record in caplog.records if record.name.startswith("distributed")]


@pytest.mark.slow
@on_a_cluster
def test_a_trial_that_kills_its_workers_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(execution, "_ROUNDS", 2)

    def run(trial: int) -> int:
        os.kill(os.getpid(), signal.SIGKILL)
        return trial

    few = {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0"}
    with scheduler(tmp_path, **few) as (own, _), worker(own, tmp_path) as one, worker(own, tmp_path) as two:
        with pytest.raises(RigsightError, match="trial 3"):
            list(finished(run, [3], 1, own))
        # It has been tried in both rounds.
        assert [one.wait(PATIENCE), two.wait(PATIENCE)] == [-signal.SIGKILL] * 2


def test_a_cluster_without_dask_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"pip install '\./bench\[cluster\]'"):
        list(finished(abs, [1], 1, "tcp://127.0.0.1:8786"))

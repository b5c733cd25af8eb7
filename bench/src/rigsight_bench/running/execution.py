"""Blind trials run in processes of this machine or on the workers of a Dask cluster.

The cluster is started with Dask's own commands (``docs/blind_cluster.md``). A trial whose worker dies goes back into the queue; a
bench without workers waits for them; workers that join later are used as well.
"""

from __future__ import annotations

import asyncio
import functools
import hashlib
import logging
import queue
import secrets
import socket
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

from joblib import Parallel, delayed

import rigsight
from rigsight.errors import InputError, RigsightError
from rigsight_bench.running.parent_watch import end_with_parent

Name = TypeVar("Name", int, str)
Result = TypeVar("Result")

_REACHED_WITHIN = 5.0
"""Time [s] in which a scheduler must answer, at first and after a lost connection."""
_LOOK_AGAIN = 2.0
"""Time [s] after which workers are counted again."""
_PER_THREAD = 4
"""Trials queued at the scheduler per worker thread: enough to keep all busy, few enough to save the scheduler's memory."""
_LEAST_HANDED_OVER = 16
_RETRIES = 2
"""Times that a trial is repeated after an error: when a machine shuts down, the diagnosis ends before its worker does."""
_ROUNDS = 3
"""Times that a trial is submitted; each time three of its workers may die. After that the trial itself may be the cause."""


def finished(
    run_one: Callable[[Name], Result],
    trials: Sequence[Name],
    n_jobs: int,
    cluster: str | None = None,
    *,
    folder: Path | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> Iterator[Result]:
    """Run every trial and yield its result as it ends, in any order; each result once.

    When the iteration is left early (Ctrl-C, an error), no further trials are started; a trial that is already running on a
    worker of a cluster runs to its end there.

    Parameters
    ----------
    run_one
        Runs a trial; must be importable on a worker, with arguments that name files by absolute paths.
    trials
        Number or name of each.
    n_jobs
        Processes on this machine; ignored on a cluster, where the workers determine how many trials run in parallel.
    cluster
        Address of a Dask scheduler such as ``tcp://10.0.0.1:8786``; None for this machine.
    folder
        Folder that every worker must see as this process does; None if trials need none.
    say
        Called with messages for the user: that there is no worker, and that one has joined.

    Raises
    ------
    InputError
        If no scheduler answers, or a worker does not see the folder or runs another rigsight.
    RigsightError
        If worker processes of this machine or the scheduler die, or a trial kills its workers. Errors of `run_one` are raised, on
        a cluster after the trial has been repeated.
    """
    if cluster is None:
        return _on_this_machine(run_one, trials, n_jobs)
    return _on_cluster(run_one, trials, cluster, folder, say)


def _on_this_machine(
    run_one: Callable[[Name], Result], trials: Sequence[Name], n_jobs: int
) -> Iterator[Result]:
    processes = min(n_jobs, max(1, len(trials)))
    # On an interruption joblib kills the other processes, which then do not remove their temporary files.
    with tempfile.TemporaryDirectory(prefix="rigsight-", ignore_cleanup_errors=True) as place:
        own: dict[str, Any] = {}
        if processes > 1:
            own = {"backend": "loky", "initializer": _begin, "initargs": (place,)}
        parallel = Parallel(n_jobs=processes, return_as="generator_unordered", batch_size=1, **own)
        try:
            yield from parallel(delayed(run_one)(trial) for trial in trials)
        except BrokenProcessPool:
            raise RigsightError(
                "A process that ran a blind trial was killed from outside, most often because memory ran out. "
                "The same command continues the bench; a lower --jobs runs fewer trials in parallel."
            ) from None


def _begin(place: str) -> None:
    """End this process when its parent has ended, and put its temporary files where the parent removes them."""
    end_with_parent()
    tempfile.tempdir = place


def _on_cluster(
    run_one: Callable[[Name], Result],
    trials: Sequence[Name],
    address: str,
    folder: Path | None,
    say: Callable[[str], None],
) -> Iterator[Result]:
    _check_installed()
    with _only_fatal_messages():
        client = _connected(address)
        try:
            with _marked(folder) as mark:
                task = functools.partial(_run_on_worker, run_one, mark, source_version())
                yield from _Queue(client, address, task, say).results(trials)
        finally:
            # When the client is closed, the scheduler drops the trials that are waiting.
            client.close(timeout=_REACHED_WITHIN)


def _check_installed() -> None:
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise InputError(
            "A bench on a cluster needs Dask, which is not installed: pip install './bench[cluster]'"
        ) from None


@contextmanager
def _only_fatal_messages() -> Iterator[None]:
    """Keep Dask from logging tracebacks of lost connections, which are reported as errors of our own.

    Dask sets its levels when it is imported, so this must be called after the import.
    """
    # The level of the first is that of all loggers of Dask without one of their own; the client has one.
    loggers = [logging.getLogger(name) for name in ("distributed", "distributed.client")]
    before = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for logger, level in zip(loggers, before, strict=True):
            logger.setLevel(level)


def _connected(address: str) -> Any:
    from distributed import Client

    try:
        # In a thread, because an event loop is already running in the main thread of a notebook.
        with ThreadPoolExecutor(1) as thread:
            kind = thread.submit(asyncio.run, _kind_of_server(address)).result()
        if kind != "Scheduler":
            raise InputError(f"what answers is a {kind}")
        return Client(address, timeout=_REACHED_WITHIN, set_as_default=False, name="rigsight")
    except Exception as error:
        # With a server of another kind Dask may fail in any way, for instance by taking HTML for a message length.
        reason = (
            f"no answer within {_REACHED_WITHIN:g} s"
            if isinstance(error, TimeoutError)
            else str(error).splitlines()[0]
        )
        raise InputError(
            f"No Dask scheduler answers at '{address}' ({reason}). Start one with 'dask scheduler', which prints its address, "
            "such as tcp://10.0.0.1:8786, and give that address with --cluster."
        ) from None


async def _kind_of_server(address: str) -> str:
    """Return the kind of server at an address; a client that fails to connect would leave threads and messages behind."""
    from distributed.core import rpc
    from distributed.security import Security

    server = rpc(address, timeout=_REACHED_WITHIN, connection_args=Security().get_connection_args("client"))
    try:
        identity = await asyncio.wait_for(server.identity(), _REACHED_WITHIN)
        return str(identity["type"])
    finally:
        await server.close_rpc()


class _Queue:
    """Trials that are submitted to a scheduler."""

    def __init__(
        self, client: Any, address: str, task: Callable[[Any], Any], say: Callable[[str], None]
    ) -> None:
        self._client = client
        self._address = address
        self._task = task
        self._say = say
        self._run = secrets.token_hex(8)
        self._ended: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._under_way: dict[Any, tuple[Any, int]] = {}
        """Trial and round of each future; a future is kept alive by its entry here."""
        self._threads = 0
        self._looked = -_LOOK_AGAIN
        self._deserted = False

    def results(self, trials: Sequence[Any]) -> Iterator[Any]:
        """Yield the result of each trial as it ends."""
        waiting = iter(trials)
        left = len(trials)
        while left:
            self._look()
            room = max(_LEAST_HANDED_OVER, _PER_THREAD * self._threads) - len(self._under_way)
            for _, trial in zip(range(room), waiting, strict=False):
                self._hand_over(trial, 1)
            for future in self._next():
                trial, turn = self._under_way.pop(future)
                if self._died_with_workers(future, trial, turn):
                    self._hand_over(trial, turn + 1)
                    continue
                left -= 1
                yield self._result(future)

    def _hand_over(self, trial: Any, turn: int) -> None:
        if self._client.status == "closed":
            raise self._gone()
        key = (f"trial-{self._run}", trial, turn)
        future = self._client.submit(self._task, trial, key=key, retries=_RETRIES)
        self._under_way[future] = trial, turn
        future.add_done_callback(self._ended.put)

    def _next(self) -> list[Any]:
        try:
            return [self._ended.get(timeout=_LOOK_AGAIN)]
        except queue.Empty:
            return []

    def _look(self) -> None:
        """Count the threads of all workers at intervals, and report if there are none."""
        if time.monotonic() - self._looked < _LOOK_AGAIN:
            return
        try:
            self._threads = self._client.scheduler_info(n_workers=0)["total_threads"]
        except (OSError, ValueError, KeyError):
            # Whether the connection is lost for good is reported by the futures.
            return
        self._looked = time.monotonic()
        if self._deserted and self._threads:
            self._say(f"Continuing with {self._threads} trials at a time")
        if not self._deserted and not self._threads:
            self._say(
                f"No worker at {self._address}: trials wait for one (dask worker {self._address} --nthreads 1)"
            )
        self._deserted = not self._threads

    def _died_with_workers(self, future: Any, trial: Any, turn: int) -> bool:
        """Return True if a trial must be handed over again because its workers died."""
        from distributed import KilledWorker

        if future.status != "error" or not isinstance(future.exception(), KilledWorker):
            return False
        if turn < _ROUNDS:
            return True
        raise RigsightError(
            f"Every worker that ran trial {trial} died. If they were not ended on purpose, they probably ran out of memory: "
            "see their logs. The same command continues the bench."
        )

    def _result(self, future: Any) -> Any:
        try:
            return future.result()
        except (CancelledError, OSError):
            if future.status == "error":
                raise
            raise self._gone() from None
        except (ModuleNotFoundError, AttributeError) as error:
            # Raised while a task is unpickled, before the task can check anything itself.
            if "rigsight" not in str(error):
                raise
            raise InputError(
                f"A worker at {self._address} does not have the same version of rigsight ({error}). Install "
                f"{source_version()} on the workers."
            ) from None

    def _gone(self) -> RigsightError:
        return RigsightError(
            f"The connection to the Dask scheduler at {self._address} is lost. Start it and its workers again; the same command "
            "continues the bench."
        )


@contextmanager
def _marked(folder: Path | None) -> Iterator[Path | None]:
    """Put a marker file into a folder, by which a worker checks that it sees the same folder."""
    if folder is None:
        yield None
        return
    folder.mkdir(parents=True, exist_ok=True)
    mark = folder.resolve() / f".seen-by-workers-{secrets.token_hex(8)}"
    mark.touch()
    try:
        yield mark
    finally:
        mark.unlink(missing_ok=True)


def _run_on_worker(run_one: Callable[[Name], Result], mark: Path | None, wanted: str, trial: Name) -> Result:
    """Run a trial after checking that the worker has the same code and folder; this also covers workers that join later."""
    if source_version() != wanted:
        raise InputError(
            f"The worker on {socket.gethostname()} runs rigsight {source_version()}, the bench {wanted}: install the same "
            "version on both and start the worker again."
        )
    if mark is not None and not mark.exists():
        raise InputError(
            f"The worker on {socket.gethostname()} does not see the bench's folder {mark.parent}: workers need the same "
            "folder under the same path (a shared file system)."
        )
    return run_one(trial)


@functools.cache
def source_version() -> str:
    """Return rigsight's version with a short hash of all source, which distinguishes two states of development."""
    found = hashlib.sha256()
    for package in (Path(rigsight.__file__).parent, Path(__file__).parents[1]):
        for file in sorted(package.rglob("*.py")):
            found.update(file.relative_to(package).as_posix().encode())
            found.update(file.read_bytes())
    return f"{version('rigsight')} (source {found.hexdigest()[:8]})"

"""Blind trials per minute with one and two workers, by joblib and by Dask, and the extrapolation to 1,000 workers.

    .venv/bin/python benchmarks/blind_scaling.py --trials 4

Every way runs the same trials of the standard design from draw to score, one diagnosis of one thread at a time per worker,
after a pass that compiles the kernels. Dask's scheduler and workers are started by Dask's own commands on this machine.

Efficiency is the rate of two workers over twice that of one; the rate is trials over the time from the first hand-over to the
last result. With few trials the end, where one worker idles while the other finishes, weighs much: "without the end" counts the
time of each worker only until its own last trial ends. Of that, the bench answers for the share of this time in which workers are
at a trial; that a trial takes longer beside another is this machine's, whose processors share memory and clock.

The projection takes from measurements the time of a trial on a Dask worker, what client and scheduler spend on one that does
nothing, and what its row in the store takes. It assumes that workers are as fast as this machine's with both of its workers busy,
that one client and one scheduler serve them all, that the network adds nothing, and that the shared file system bears the traffic
that is printed.
"""

from __future__ import annotations

import argparse
import functools
import itertools
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from rigsight_bench import trial_process
from rigsight_bench.running.execution import finished
from rigsight_bench.running.files import BenchFolder, trial_name
from rigsight_bench.running.scoring import score_trial
from rigsight_bench.running.store import TrialStore
from rigsight_bench.running.trial import diagnose_trial, make_trial
from rigsight_bench.scoring import Outcome

N_EMPTY = 2000
N_ROWS = 200
N_STARTS = 5
START = "import sympy, rigsight.workflow.diagnose"
"""What a process that diagnoses loads before it works."""
WORKERS = 1000
BENCHES = (10_000, 100_000)


@dataclass(frozen=True)
class Ran:
    """One trial as its worker saw it: begin and end [s since 1970], the largest process [MB], and what came out."""

    worker: int
    begin: float
    end: float
    memory: float
    outcome: Outcome | None


def run_trial(folder: BenchFolder, seed: int, number: int) -> Ran:
    begin = time.time()
    make_trial(folder, "standard", seed, number)
    diagnose_trial(folder, trial_name(number), trial_process.START)
    outcome = score_trial(folder, trial_name(number))
    memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / (
        1e6 if sys.platform == "darwin" else 1e3
    )
    return Ran(os.getpid(), begin, time.time(), memory, outcome)


def stand_in(seconds: float, number: int) -> Ran:
    """Keep a processor busy for a time that differs from trial to trial."""
    begin = time.time()
    until = time.process_time() + seconds * (1.0 + 0.5 * (number % 3))
    while time.process_time() < until:
        pass
    return Ran(os.getpid(), begin, time.time(), 0.0, None)


def nothing(number: int) -> int:
    return number


@dataclass(frozen=True)
class Pass:
    """One way through all trials."""

    start: float
    stop: float
    ran: list[Ran]

    @property
    def wall(self) -> float:
        """Time from the first hand-over to the last result [s]."""
        return self.stop - self.start

    @property
    def until_idle(self) -> float:
        """Time of all workers, each until its own last trial ended [s]."""
        last = {one.worker: 0.0 for one in self.ran}
        for one in self.ran:
            last[one.worker] = max(last[one.worker], one.end)
        return sum(end - self.start for end in last.values())

    @property
    def at_trials(self) -> float:
        """Time of all workers at a trial [s]."""
        return sum(one.end - one.begin for one in self.ran)


@contextmanager
def cluster(workers: int) -> Iterator[str]:
    """Start a scheduler and workers, and wait until these are there."""
    with ExitStack() as started:
        place = started.enter_context(tempfile.TemporaryDirectory(prefix="dask-"))
        file = Path(place) / "scheduler.json"
        quiet = {"cwd": place, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        dask = (sys.executable, "-m", "dask")
        options = ("--no-dashboard", "--scheduler-file", str(file))
        commands = [(*dask, "scheduler", "--host", "127.0.0.1", "--port", "0", *options)]
        commands += [(*dask, "worker", "--nthreads", "1", *options)] * workers
        for command in commands:
            process = started.enter_context(subprocess.Popen(command, **quiet))  # type: ignore[call-overload]
            started.callback(process.terminate)
        while not file.exists() or not file.read_text().strip():
            time.sleep(0.1)
        address = json.loads(file.read_text())["address"]
        seen: set[int] = set()
        while len(seen) < workers:
            seen |= set(finished(_which_worker, range(4 * workers), 1, address))
        yield address


def _which_worker(_: int) -> int:
    time.sleep(0.05)
    return os.getpid()


def passed(run_one: Callable[[int], Ran], trials: range, n_jobs: int, address: str | None) -> Pass:
    start = time.time()
    ran = list(finished(run_one, trials, n_jobs, address))
    return Pass(start, time.time(), ran)


def measured(
    trials: range, prepare: Callable[[], Callable[[int], Ran]], ways: Sequence[str], rounds: int
) -> dict[tuple[str, int], list[Pass]]:
    """Run all trials each way; `prepare` returns what runs one of them, from the begin.

    The speed of a machine drifts: one and two workers take turns, in every other round two before one.
    """
    found: dict[tuple[str, int], list[Pass]] = {(way, workers): [] for way in ways for workers in (1, 2)}
    for way, again in itertools.product(ways, range(rounds)):
        for workers in (1, 2) if again % 2 == 0 else (2, 1):
            if way == "joblib":
                # Processes that are up are part of neither way: joblib's are started by a first, empty pass.
                list(finished(_which_worker, range(2 * workers), workers))
                found[way, workers].append(passed(prepare(), trials, workers, None))
            else:
                with cluster(workers) as address:
                    found[way, workers].append(passed(prepare(), trials, workers, address))
            told(way, workers, found[way, workers][-1])
    return found


def told(way: str, workers: int, one: Pass) -> None:
    times = [ran.end - ran.begin for ran in one.ran]
    print(
        f"  {way:7}{workers:3} workers {60.0 * len(times) / one.wall:8.2f} trials/min   a trial {statistics.mean(times):7.1f} s "
        f"on average, {max(times):7.1f} s at most   largest process {max(ran.memory for ran in one.ran):5.0f} MB",
        flush=True,
    )


def time_of_an_empty_trial() -> float:
    """Return what client and scheduler spend on a trial that does nothing, two workers [s]."""
    with cluster(2) as address:
        start = time.perf_counter()
        assert sum(1 for _ in finished(nothing, range(N_EMPTY), 1, address)) == N_EMPTY
        return (time.perf_counter() - start) / N_EMPTY


def time_of_a_row(outcome: Outcome, place: Path) -> float:
    """Return the median time to store one outcome in a transaction of its own [s]."""
    times = []
    with TrialStore(place / "rows.sqlite") as store:
        for number in range(N_ROWS):
            start = time.perf_counter()
            store.add([replace(outcome, trial=trial_name(number))])
            times.append(time.perf_counter() - start)
    return statistics.median(times)


def time_of_a_start() -> float:
    """Return the median time in which a process has loaded what it diagnoses with [s]."""
    times = []
    for _ in range(N_STARTS):
        start = time.perf_counter()
        subprocess.run([sys.executable, "-I", "-c", START], check=True)
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def megabytes(folder: Path) -> float:
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file()) / 1e6


def project(trial: float, longest: float, per_trial: float, traffic: float) -> None:
    """Print the extrapolation to many workers.

    Parameters
    ----------
    trial, longest
        Time of a trial on a worker, on average and at most [s].
    per_trial
        Time of client and scheduler on each [s].
    traffic
        Data per trial [MB].
    """
    rate = min(WORKERS / trial, 1.0 / per_trial)
    busy = WORKERS / trial * per_trial
    print(
        f"{WORKERS} workers: {60.0 * rate:.0f} trials/min; client and scheduler busy {busy:.1%} of the time, enough for "
        f"{trial / per_trial:.0f} workers; {rate * traffic:.1f} MB/s to and from the shared folder"
    )
    for n_trials in BENCHES:
        # At worst the longest trial begins when all others end.
        wall = n_trials / rate + longest
        efficiency = n_trials * trial / WORKERS / wall
        print(f"  {n_trials:7} trials: {wall / 60.0:7.1f} min at most, efficiency {efficiency:.3f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--trials", type=int, default=4)
    parser.add_argument("--seed", type=int, default=1, help="seed of the standard design")
    parser.add_argument(
        "--rounds", type=int, default=1, help="repetitions of each way; an even number cancels drift"
    )
    parser.add_argument("--ways", nargs="+", choices=("joblib", "dask"), default=("joblib", "dask"))
    parser.add_argument(
        "--compiled", action="store_true", help="skip the pass that compiles the kernels of these trials"
    )
    parser.add_argument(
        "--stand-in",
        type=float,
        metavar="SECONDS",
        help="run a loop of this duration instead of trials, to test this script",
    )
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="blind-scaling-") as name:
        place = Path(name)
        number = iter(range(100))

        def prepare() -> Callable[[int], Ran]:
            if options.stand_in is not None:
                return functools.partial(stand_in, options.stand_in)
            folder = BenchFolder(place / f"bench-{next(number)}")
            folder.settle("standard", options.seed)
            return functools.partial(run_trial, folder, options.seed)

        trials = range(options.trials)
        print(f"{options.trials} trials, {os.cpu_count()} processors", flush=True)
        if options.stand_in is None and not options.compiled:
            warm = passed(prepare(), trials, os.cpu_count() or 1, None)
            print(f"  kernels compiled in a first pass of {warm.wall:.0f} s", flush=True)
        found = measured(trials, prepare, options.ways, options.rounds)
        for way in options.ways:
            one, two = found[way, 1], found[way, 2]
            wall, until_idle, at_trials = (
                [sum(getattr(each, time) for each in passes) for passes in (one, two)]
                for time in ("wall", "until_idle", "at_trials")
            )
            print(
                f"  {way:7} efficiency of two workers {wall[0] / (2.0 * wall[1]):.3f}, without the end "
                f"{until_idle[0] / until_idle[1]:.3f}: at a trial {at_trials[1] / until_idle[1]:.1%} of this time (alone "
                f"{at_trials[0] / until_idle[0]:.1%}), which takes {at_trials[1] / at_trials[0]:.3f} times as long beside another"
            )
        empty, start = time_of_an_empty_trial(), time_of_a_start()
        print(f"  client and scheduler need for an empty trial {1e3 * empty:.2f} ms ({N_EMPTY} of them)")
        print(f"  start of a diagnosing process: {start:.2f} s (part of every trial)")
        ran, row, traffic = found[options.ways[-1], 2][-1].ran, 0.0, 0.0
        if ran[0].outcome is not None:
            row = time_of_a_row(ran[0].outcome, place)
            traffic = megabytes(place / "bench-0") / len(ran)
            print(f"  storing its row: {1e3 * row:.2f} ms; {traffic:.1f} MB per trial remain in the folder")
        times = [one.end - one.begin for one in ran]
        # Records are written once and read twice: by the copy for the diagnosis and, those withheld, by the score.
        project(statistics.mean(times), max(times), empty + row, 2.0 * traffic)


if __name__ == "__main__":
    main()

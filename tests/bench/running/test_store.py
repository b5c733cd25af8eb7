"""A row is written once and comes back as it was, whoever dies while it is written."""

from __future__ import annotations

import json
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier

import pytest

from rigsight.errors import InputError
from rigsight_bench.running.store import TrialStore
from rigsight_bench.scoring import Outcome, ParameterError, WithheldError

Like = Callable[..., Outcome]

WRITES_ON = """
import json, sys
from pathlib import Path
from rigsight_bench.scoring import Outcome
from rigsight_bench.running.store import TrialStore
lists = {{"places": (), "named": (), "named_places": (), "withheld": (), "parameters": ()}}
content = json.loads(sys.argv[2]) | {{"effects": ("backlash",)}} | lists
with TrialStore(Path(sys.argv[1])) as store:
    done = store.scored()
    for number in range({total}):
        if f"{{number:03d}}" not in done:
            store.add([Outcome(**(content | {{"trial": f"{{number:03d}}"}}))])
            print(number, flush=True)
"""


def test_every_field_comes_back_as_it_was(tmp_path: Path, outcome_like: Like, wrong_outcome: Like) -> None:
    seen = (
        WithheldError("withheld_1", "multisine", 0.123456789012345, 8000, 1.0 / 3.0),
        WithheldError("withheld_2", "step", 0.85, 3000, None),
    )
    full = outcome_like(trial="001", withheld=seen, held_out=None, message='it\'s "quoted"\nand \u00d7')
    bare = wrong_outcome(
        trial="002",
        gap=None,
        effects=(),
        named=(),
        place_right=None,
        withheld=(),
        parameters=(ParameterError("k", "rig", -1e-300),),
    )
    with TrialStore(tmp_path / "t.sqlite") as store:
        store.add([bare, full])
    with TrialStore(tmp_path / "t.sqlite") as store:
        assert store.outcomes() == [full, bare]
        assert store.scored() == {"001": "", "002": ""}


def test_numbers_come_in_their_order_and_names_in_theirs(tmp_path: Path, outcome_like: Like) -> None:
    with TrialStore(tmp_path / "t.sqlite") as store:
        store.add(outcome_like(trial=name) for name in ("1000", "017", "999", "beta", "alpha"))
        assert [o.trial for o in store.outcomes()] == ["alpha", "beta", "017", "999", "1000"]


def test_a_trial_that_is_scored_again_replaces_its_row(tmp_path: Path, outcome_like: Like) -> None:
    with TrialStore(tmp_path / "t.sqlite") as store:
        store.add([outcome_like(seconds=1.0)])
        store.add([outcome_like(seconds=2.0, fingerprint="other")])
        assert [o.seconds for o in store.outcomes()] == [2.0]


@pytest.mark.slow
def test_a_process_that_is_killed_loses_no_row_and_the_next_doubles_none(
    tmp_path: Path, outcome_like: Like
) -> None:
    total = 120
    file = tmp_path / "t.sqlite"
    content = {n: v for n, v in outcome_like().to_json().items() if not isinstance(v, tuple)}
    command = [sys.executable, "-c", WRITES_ON.format(total=total), str(file), json.dumps(content)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        told = [int(process.stdout.readline()) for _ in range(20)]
        process.send_signal(signal.SIGKILL)
        told += [int(line) for line in process.stdout if line.endswith("\n")]
    with TrialStore(file) as store:
        kept = set(store.scored())
    assert {f"{number:03d}" for number in told} <= kept
    assert len(kept) < total
    again = subprocess.run(command, capture_output=True, text=True, check=True)
    assert len(again.stdout.splitlines()) == total - len(kept)
    with TrialStore(file) as store:
        assert [o.trial for o in store.outcomes()] == [f"{number:03d}" for number in range(total)]


def test_two_that_write_at_once_wait_for_each_other(tmp_path: Path, outcome_like: Like) -> None:
    def write(first: int) -> None:
        with TrialStore(tmp_path / "t.sqlite") as store:
            for number in range(first, first + 20):
                store.add([outcome_like(trial=f"{number:03d}")])

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(write, (0, 20, 40, 60)))
    with TrialStore(tmp_path / "t.sqlite") as store:
        assert len(store.scored()) == 80


def test_of_many_that_begin_a_store_at_once_none_takes_it_for_a_foreign_one(tmp_path: Path) -> None:
    together = Barrier(4)

    def begin(file: Path) -> None:
        together.wait()
        with TrialStore(file) as store:
            assert store.scored() == {}

    with ThreadPoolExecutor(4) as pool:
        for number in range(30):
            list(pool.map(begin, [tmp_path / f"{number}.sqlite"] * 4))


def test_a_damaged_file_and_one_of_another_version_say_how_to_mend_it(tmp_path: Path) -> None:
    damaged = tmp_path / "damaged.sqlite"
    damaged.write_bytes(b"no database" * 500)
    with pytest.raises(InputError, match=r"damaged.*--rescore"):
        TrialStore(damaged)
    later = tmp_path / "later.sqlite"
    with sqlite3.connect(later) as connection:
        connection.execute("CREATE TABLE trials (trial TEXT)")
        connection.execute("PRAGMA user_version = 99")
    with pytest.raises(InputError, match=r"format 99.*--rescore"):
        TrialStore(later)

"""Check that an input ends in a value or one message, in limited time and memory."""

from __future__ import annotations

import hashlib
import json
import resource
import time
import traceback
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from rigsight.errors import RigsightError

LONGEST = 5.0
"""For one input [s of processor time]: other work on the machine is no breach. libFuzzer ends what waits."""
_WARM = 20
"""Inputs of a process, over which libraries are loaded."""
MOST_GROWTH = 500_000_000
"""Of the process over one input [bytes]."""
LONGEST_MESSAGE = 6000
"""In characters; a message is read by somebody."""


@dataclass
class Oracle:
    """What was tried on one target, and what broke the promise; each kind of breach is kept once.

    Attributes
    ----------
    folder
        Where findings go: the input, and what it led to.
    n_inputs, n_accepted
        Inputs tried, and those that were sound.
    kinds
        Kinds of breaches met.
    longest
        For one input [s].
    most_growth
        Of the process over one input [bytes].
    n_here
        Inputs tried in this process.
    """

    folder: Path
    n_inputs: int = 0
    n_accepted: int = 0
    kinds: set[str] = field(default_factory=set)
    longest: float = LONGEST
    most_growth: int = MOST_GROWTH
    n_here: int = 0

    @classmethod
    def resumed(cls, folder: Path) -> Oracle:
        """Return the counts as a run before left them in a folder."""
        file = folder / "counts.json"
        if not file.is_file():
            return cls(folder)
        found = json.loads(file.read_text(encoding="utf-8"))
        return cls(folder, found["inputs"], found["accepted"], set(found["kinds"]))

    def judge(self, data: bytes, try_it: Callable[[bytes], object]) -> None:
        """Try one input and write down a breach."""
        self.n_inputs += 1
        self.n_here += 1
        before, start = _peak(), time.process_time()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                try_it(data)
            self.n_accepted += 1
        except RigsightError as error:
            self._judge_message(data, str(error))
        except (KeyboardInterrupt, SystemExit):
            raise
        except BaseException as error:
            frames = [f for f in traceback.extract_tb(error.__traceback__) if "rigsight" in f.filename]
            last = frames[-1] if frames else None
            where = f"{Path(last.filename).name}:{last.lineno}" if last else "?"
            self.found(
                data,
                f"{type(error).__name__} at {where}",
                "".join(traceback.format_exception(error, limit=-12)),
            )
        seconds, growth = time.process_time() - start, _peak() - before
        if self.n_here <= _WARM:
            self.save()
            return
        if seconds > self.longest:
            self.found(data, "slow", f"{seconds:.1f} s")
        if growth > self.most_growth:
            self.found(data, "memory", f"{growth / 1e6:.0f} MB")
        self.save()

    def _judge_message(self, data: bytes, message: str) -> None:
        if len(message) > LONGEST_MESSAGE:
            self.found(data, "long message", f"{len(message)} characters: {message[:300]}")
        try:
            message.encode()
        except UnicodeEncodeError:
            self.found(data, "message cannot be printed", ascii(message[:300]))
        if any(ord(sign) < 32 and sign not in "\n\t" for sign in message):
            self.found(data, "message steers the terminal", ascii(message[:600]))

    def found(self, data: bytes, kind: str, told: str) -> None:
        """Keep the first input of every kind of breach."""
        if kind in self.kinds:
            return
        self.kinds.add(kind)
        name = hashlib.sha256(kind.encode()).hexdigest()[:10]
        self.folder.mkdir(parents=True, exist_ok=True)
        (self.folder / f"{name}.input").write_bytes(data)
        (self.folder / f"{name}.txt").write_text(
            f"{kind}\n{told}\n", encoding="utf-8", errors="backslashreplace"
        )

    def save(self, at_once: bool = False) -> None:
        """Leave the counts where they outlive a crash of a library in C."""
        if at_once or self.n_inputs % 20 == 0 or self.n_inputs < 20:
            content = {"inputs": self.n_inputs, "accepted": self.n_accepted, "kinds": sorted(self.kinds)}
            self.folder.mkdir(parents=True, exist_ok=True)
            (self.folder / "counts.json").write_text(json.dumps(content), encoding="utf-8")


def _peak() -> int:
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

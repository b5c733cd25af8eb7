"""Progress of a command: finished steps out of a known number, passed to a listener."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Step:
    """One finished step."""

    stage: str  # what is being done
    detail: str  # what has just been finished; empty at the start of a stage
    # Steps of the stage that are finished, and all of them; both 0 for a remark.
    done: int
    total: int


Listener = Callable[[Step], None]


def silent(step: Step) -> None:
    """Ignore a step."""


def tell(remarks: Iterable[str], listener: Listener) -> None:
    """Pass a note to a listener early, while the user can still stop."""
    for remark in remarks:
        listener(Step(remark, "", 0, 0))


class Stage:
    """Counts the steps of one stage and reports them to a listener; more steps than announced raise the total."""

    def __init__(self, name: str, total: int, listener: Listener) -> None:
        self._name = name
        self._total = total
        self._listener = listener
        self._done = 0
        listener(Step(name, "", 0, total))

    def finished(self, detail: str) -> None:
        """Report one more finished step."""
        self._done += 1
        self._total = max(self._total, self._done)
        self._listener(Step(self._name, detail, self._done, self._total))

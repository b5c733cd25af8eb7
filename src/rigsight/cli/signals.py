"""How does a signal that asks rigsight to end become the same clean end as Ctrl-C?"""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType


class Ended(KeyboardInterrupt):
    """The process was asked to end, by kill or by a terminal that goes away; everything that Ctrl-C clears up is cleared up."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


@contextlib.contextmanager
def ended_by_signals() -> Iterator[None]:
    """Turn requests to end into `Ended`, except those that are ignored, as under nohup."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    names = ("SIGTERM", "SIGHUP")
    numbers = [getattr(signal, name) for name in names if hasattr(signal, name)]
    # Who runs the command line inside another program may have handlers of their own.
    mine = [number for number in numbers if signal.getsignal(number) is signal.SIG_DFL]
    for number in mine:
        signal.signal(number, _end)
    try:
        yield
    finally:
        for number in mine:
            signal.signal(number, signal.SIG_DFL)


def exit_code(error: BaseException | None) -> int:
    """Return the exit code after an interruption: 128 and the number of its signal, 130 for Ctrl-C."""
    return 128 + (error.number if isinstance(error, Ended) else int(signal.SIGINT))


def _end(number: int, _: FrameType | None) -> None:
    raise Ended(number)

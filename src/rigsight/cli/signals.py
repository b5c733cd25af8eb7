"""Termination signals end rigsight as cleanly as Ctrl-C."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType

from rigsight.workflow.run.results import ENDING_SIGNALS


class Ended(KeyboardInterrupt):
    """The process was asked to end, by kill or because its terminal was closed; it cleans up as after Ctrl-C."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


@contextlib.contextmanager
def ended_by_signals() -> Iterator[None]:
    """Raise `Ended` on termination signals and Ctrl-C, except on signals that are ignored, as under nohup."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    # A program that runs the command line inside itself may have handlers of its own.
    usual = (signal.SIG_DFL, signal.default_int_handler)
    before = {number: signal.getsignal(number) for number in ENDING_SIGNALS}
    mine = {number: handler for number, handler in before.items() if handler in usual}
    for number in mine:
        signal.signal(number, _end)
    try:
        yield
    finally:
        for number, handler in mine.items():
            signal.signal(number, handler)


def exit_code(error: BaseException | None) -> int:
    """Return the exit code after an interruption: 128 plus the number of its signal, 130 for Ctrl-C."""
    return 128 + (error.number if isinstance(error, Ended) else int(signal.SIGINT))


def _end(number: int, _: FrameType | None) -> None:
    raise Ended(number)

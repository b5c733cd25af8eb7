"""How does a signal that asks rigsight to end become the same clean end as Ctrl-C?"""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType

from rigsight.workflow.run.results import ENDING_SIGNALS

_AGAIN_AFTER = 0.05
"""Seconds after which a request is repeated that came where an exception would be dropped."""
_DROPPING = ("__del__", "_raw_object_cache_notify", "_raw_object_cache_getbuffer")
"""Functions whose callers print an exception and go on: finalizers, and what LLVM calls while it compiles."""


class Ended(KeyboardInterrupt):
    """The process was asked to end, by kill or by a terminal that goes away; everything that Ctrl-C clears up is cleared up."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


@contextlib.contextmanager
def ended_by_signals() -> Iterator[None]:
    """Turn requests to end, Ctrl-C among them, into `Ended`, except those that are ignored, as under nohup."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    # Who runs the command line inside another program may have handlers of their own.
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
    """Return the exit code after an interruption: 128 and the number of its signal, 130 for Ctrl-C."""
    return 128 + (error.number if isinstance(error, Ended) else int(signal.SIGINT))


def _end(number: int, frame: FrameType | None) -> None:
    if _is_dropped(frame):
        later = threading.Timer(_AGAIN_AFTER, _repeat, (number,))
        later.daemon = True
        later.start()
        return
    raise Ended(number)


def _repeat(number: int) -> None:
    # To the main thread, which may be waiting; a signal to this one would not wake it.
    main = threading.main_thread().ident
    if hasattr(signal, "pthread_kill") and main is not None:
        signal.pthread_kill(main, number)
    else:
        signal.raise_signal(number)


def _is_dropped(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_name in _DROPPING:
            return True
        frame = frame.f_back
    return False

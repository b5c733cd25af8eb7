"""End a process when its parent has ended, also if the parent was killed."""

from __future__ import annotations

import atexit
import os
import shutil
import signal
import threading
import time

_LOOK_AGAIN = 1.0
"""Time [s] between two looks."""


def end_with_parent(place: str | None = None) -> None:
    """End this process as soon as its parent process has changed; do nothing on systems where this cannot be observed.

    Parameters
    ----------
    place
        Temporary folder to remove then, which otherwise only the parent would have removed.
    """
    if os.name != "nt":
        threading.Thread(target=_watch, args=(os.getppid(), place), daemon=True).start()


def _watch(parent: int, place: str | None) -> None:
    while os.getppid() == parent:
        time.sleep(_LOOK_AGAIN)
    if place is not None:
        atexit.register(shutil.rmtree, place, ignore_errors=True)
    os.kill(os.getpid(), signal.SIGTERM)

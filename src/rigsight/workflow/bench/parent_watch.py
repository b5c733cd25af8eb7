"""How does a process end when the one that started it is gone, killed before it could say so?"""

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
    """Ask this process to end as soon as another one has become its parent; where that cannot be seen, do nothing.

    Parameters
    ----------
    place
        Folder to remove then: a temporary one that only the parent would have removed.
    """
    if os.name != "nt":
        threading.Thread(target=_watch, args=(os.getppid(), place), daemon=True).start()


def _watch(parent: int, place: str | None) -> None:
    while os.getppid() == parent:
        time.sleep(_LOOK_AGAIN)
    if place is not None:
        atexit.register(shutil.rmtree, place, ignore_errors=True)
    os.kill(os.getpid(), signal.SIGTERM)

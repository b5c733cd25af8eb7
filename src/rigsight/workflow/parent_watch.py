"""How does a process end when the one that started it is gone, killed before it could say so?"""

from __future__ import annotations

import os
import signal
import threading
import time

_LOOK_AGAIN = 1.0
"""Time [s] between two looks."""


def end_with_parent() -> None:
    """Ask this process to end as soon as another one has become its parent; where that cannot be seen, do nothing."""
    if os.name != "nt":
        threading.Thread(target=_watch, args=(os.getppid(),), daemon=True).start()


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(_LOOK_AGAIN)
    os.kill(os.getpid(), signal.SIGTERM)

"""A journal of finished fits on disk, so that an interrupted diagnosis can be continued.

One line of JSON per finished fit, in a file beside the compiled kernels. A kill leaves at most an incomplete last line, which is
ignored. The file is removed at the end of the diagnosis.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import threading
from collections.abc import Callable, Mapping
from importlib.metadata import version
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from rigsight.simulate import cache_folder


class FitJournal:
    """The fits of one diagnosis, kept on disk until it is done.

    Used as a context: the file is removed if the context ends without an error, otherwise it is kept.
    """

    def __init__(self, campaign: Path, going_on: Callable[[int], None] | None = None) -> None:
        name = hashlib.sha256(
            f"{version('rigsight')} {campaign.resolve()}".encode("utf-8", "surrogatepass")
        ).hexdigest()[:24]
        self._path = cache_folder() / "unfinished" / f"{name}.jsonl"
        self._known: dict[str, Mapping[str, Any]] = {}
        self._own: dict[str, Mapping[str, Any]] = {}
        self._lock = threading.Lock()
        self._going_on = going_on
        self._again: set[str] = set()

    @property
    def recalled(self) -> int:
        """Number of reused fits; one that is asked for twice counts once."""
        return len(self._again)

    def __enter__(self) -> Self:
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            lines = self._path.read_text(encoding="utf-8").splitlines() if self._path.exists() else []
        except (OSError, UnicodeDecodeError):
            lines = []
        for line in lines:
            try:
                entry = json.loads(line)
                self._known[entry["key"]] = _checked(entry)
            except (ValueError, KeyError, TypeError, RecursionError):
                continue
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            with contextlib.suppress(OSError):
                self._path.unlink()

    def recall(self, key: str) -> Mapping[str, Any] | None:
        """Return the outcome stored under a key, also of a fit of this process; None if there is none."""
        found = self._known.get(key)
        if found is None:
            found = self._own.get(key)
        else:
            with self._lock:
                # Not earlier: a campaign that was changed since has the same path but none of these fits.
                is_first = not self._again
                self._again.add(key)
            if is_first and self._going_on is not None:
                self._going_on(len(self._known))
        return found

    def remember(self, key: str, outcome: Mapping[str, Any]) -> None:
        """Append an outcome; if it cannot be written, the diagnosis continues without it."""
        self._own[key] = outcome
        line = json.dumps({"key": key, **outcome}) + "\n"
        with self._lock, contextlib.suppress(OSError), self._path.open("a", encoding="utf-8") as file:
            file.write(line)


def _checked(entry: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return an entry whose parts have the types that a fit needs."""
    return {
        "theta": [float(value) for value in entry["theta"]],
        "success": bool(entry["success"]),
        "message": str(entry["message"]),
        "evaluations": int(entry["evaluations"]),
        "substeps": [int(value) for value in entry["substeps"]],
    }

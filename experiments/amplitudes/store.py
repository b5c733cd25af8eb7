"""Results of stages on disk; a kill at any moment loses only the running stage.

A stage works in a hidden folder of its own; one rename makes it the result. A result is used again if the settings written
beside it are those asked for now. Programs are not among the settings: after a change of rigsight, remove the results.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

SETTINGS = "settings.json"


@dataclass(frozen=True)
class Stage:
    """A piece of work with a result.

    Attributes
    ----------
    folder
        Where the result stands once it is whole.
    settings
        All that the result depends on, as JSON knows it.
    work
        Leaves the result in the folder it is given, or raises.
    """

    folder: Path
    settings: Mapping[str, Any]
    work: Callable[[Path], None]

    @property
    def is_finished(self) -> bool:
        try:
            told = json.loads((self.folder / SETTINGS).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return False
        return bool(told["settings"] == json.loads(json.dumps(self.settings)))

    def ensure(self) -> bool:
        """Do the work unless its result is there; return whether it was done now."""
        if self.is_finished:
            return False
        self.folder.parent.mkdir(parents=True, exist_ok=True)
        self._remove_leftovers()
        part = self.folder.with_name(f".{self.folder.name}.{os.getpid()}.part")
        begin = time.monotonic()
        try:
            part.mkdir()
            self.work(part)
            told = {
                "settings": self.settings,
                "seconds": round(time.monotonic() - begin, 1),
                "rigsight": version("rigsight"),
                "made": datetime.now(UTC).isoformat(timespec="seconds"),
            }
            (part / SETTINGS).write_text(json.dumps(told, indent=2) + "\n", encoding="utf-8")
            if self.folder.exists():
                shutil.rmtree(self.folder)
            part.rename(self.folder)
        finally:
            shutil.rmtree(part, ignore_errors=True)
        return True

    def _remove_leftovers(self) -> None:
        """Remove what killed processes left of this stage."""
        for part in self.folder.parent.glob(f".{self.folder.name}.*.part"):
            with contextlib.suppress(ProcessLookupError, ValueError, PermissionError):
                os.kill(int(part.name.split(".")[-2]), 0)
                continue
            shutil.rmtree(part, ignore_errors=True)

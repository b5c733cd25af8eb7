"""A process beside a command that outlives the server and writes down how the command ended: python -m ... FOLDER COMMAND."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

EXIT = "exit"


def main() -> None:
    """Run a command with its output in files of a folder, and write its exit code there."""
    folder, command = Path(sys.argv[1]), sys.argv[2:]
    # Canceling interrupts the whole group. Not ignored: the command would inherit that.
    signal.signal(signal.SIGINT, lambda *_: None)
    with (folder / "stdout").open("wb") as out, (folder / "stderr").open("wb") as err:
        code = subprocess.run(
            command, stdin=subprocess.DEVNULL, stdout=out, stderr=err, check=False
        ).returncode
    part = folder / f"{EXIT}.part"
    part.write_text(str(code), encoding="utf-8")
    part.replace(folder / EXIT)


if __name__ == "__main__":
    main()

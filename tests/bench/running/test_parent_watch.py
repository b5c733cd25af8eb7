"""A diagnosis whose bench was killed does not run on for nobody."""

from __future__ import annotations

import os
import select
import subprocess
import sys
from pathlib import Path

import pytest

CHILD = (
    "import os, time\n"
    "from rigsight.cli.exit_codes import ended_by_signals\n"
    "from rigsight_bench.running.parent_watch import end_with_parent\n"
    "end_with_parent(os.getcwd())\n"
    "with ended_by_signals():\n"
    "    print('ready', flush=True)\n"
    "    time.sleep(600)\n"
)
PARENT = "import subprocess, sys; subprocess.run([sys.executable, '-c', sys.argv[1]], cwd=sys.argv[2])"


@pytest.mark.skipif(sys.platform == "win32", reason="no parent can be seen there")
def test_a_process_ends_with_its_parent_and_its_folder_goes(tmp_path: Path) -> None:
    place = tmp_path / "place"
    place.mkdir()
    (place / "record.csv").write_text("t,u\n")
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT, CHILD, place], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    assert parent.stdout is not None
    with parent.stdout as said:
        assert said.readline() == b"ready\n"
        parent.kill()
        parent.wait()
        # The pipe ends when nobody holds it any more: the child is gone.
        assert select.select([said], [], [], 60.0)[0]
        assert os.read(said.fileno(), 1) == b""
    assert not place.exists()

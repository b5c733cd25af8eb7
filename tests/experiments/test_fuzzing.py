"""What the fuzzer writes is never executed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

FUZZING = Path(__file__).parents[2] / "experiments" / "fuzzing"


@pytest.mark.slow
def test_a_text_that_the_fuzzer_wrote_is_read_and_not_run(tmp_path: Path) -> None:
    run, mark = "import contextlib, targets", tmp_path / "mark"
    text = f"open({str(mark)!r}, 'w').close()"
    code = (
        f"{run}\nwith contextlib.suppress(targets.InputError):\n"
        f"    targets.TARGETS['effect file, text'].try_it({text.encode()!r})\nprint('read')"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=FUZZING, capture_output=True, text=True, check=False
    )
    assert done.stdout == "read\n", done.stderr
    assert not mark.exists()

"""What ``rigsight check`` prints: how records were read, and no table longer than a screen."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ..diagnose.conftest import TWO_MASSES

Run = Callable[..., tuple[int, str, str]]
NUMBERS = {"m": 1.0, "k": 40.0, "c": 20.0, "d": 1.0}


def test_effects_of_several_joints_are_summed_up_and_the_sweep_in_place_of_records_is_told(
    tmp_path: Path, run: Run
) -> None:
    text = TWO_MASSES
    for name, value in NUMBERS.items():
        text = text.replace(f"[parameters.{name}]\n", f"[parameters.{name}]\ndefault = {value}\n")
    rig = tmp_path / "two.toml"
    rig.write_text(text)
    code, stdout, _ = run("check", rig, "-o", tmp_path / "check")
    assert code == 0
    assert stdout.count("There are no records") == 1
    assert "cubic stiffness at between" in " ".join(stdout.split())
    assert "check.html shows which effects and forms are not told apart" in stdout
    assert len(stdout.splitlines()) < 40
    # Of a simulated sweep nothing else is noted, such as a loop that it does not have.
    assert "loop" not in stdout

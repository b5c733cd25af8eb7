"""Film a first use of `rigsight app` for docs/app.md anew: python docs/examples/record_app.py; needs Chromium."""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tests.app.served import Visitor

ROOT = Path(__file__).parents[2]
IMAGES = ROOT / "docs" / "images" / "app"
_COLORS = 128
"""Of a picture; more are not told apart."""


def with_values(text: str) -> str:
    """Fill in the values of the given simulation, and how the drive holds its output."""
    for name, value in {"m": 2.0, "d": 15.0, "k": 800.0}.items():
        text = re.sub(rf"^# {name} = ", f"{name} = {value}", text, flags=re.MULTILINE)
    return text.replace('hold = "foh"', 'hold = "zoh"')


def main() -> None:
    from tests.app.served import Server, Visitor
    from tests.chromium import Chromium, find

    browser = find()
    if browser is None:
        raise SystemExit("No Chromium was found.")
    IMAGES.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make_stage = ROOT / "docs" / "examples" / "make_stage.py"
        subprocess.run([sys.executable, str(make_stage), str(folder / "logger")], check=True)
        (folder / "logger" / "lunch.csv").write_text("day,dish\nMonday,soup\n", encoding="utf-8")
        server = Server(folder / "stage")
        chromium = Chromium(browser, folder / "browser")
        try:
            film(Visitor(chromium, server), sorted((folder / "logger").iterdir()))
        finally:
            chromium.close()
            server.end()


def film(window: Visitor, logged: list[Path]) -> None:
    """Do the tasks, with a picture after each."""
    from PIL import Image
    from tests.app import first_use

    def picture(name: str) -> None:
        window.chromium.settle()
        file = IMAGES / f"{name}.png"
        window.chromium.picture(file, whole=False)
        with Image.open(file) as image:
            image.quantize(_COLORS).save(file, optimize=True)

    first_use.bring(window, logged)
    picture("1-files")
    first_use.remove(window, "lunch.csv")
    first_use.look(window, "sweep_5N.csv")
    picture("2-channels")
    first_use.choose_rig(window, "axis")
    picture("3-rig")
    first_use.begin(window)
    first_use.map_columns(window, with_values)
    picture("4-campaign")
    first_use.correct(window)
    if window.has_step("Check"):
        first_use.check(window)
        picture("5-check")
    first_use.diagnose_halfway(window, lambda: picture("6-running"))
    first_use.diagnose(window)
    picture("7-diagnosis")
    first_use.read_verdict(window, "Coulomb friction")
    if window.has_step("Next experiment"):
        first_use.plan(window)
        picture("8-next-experiment")
    first_use.export(window)
    picture("9-export")


if __name__ == "__main__":
    # The tasks are those of the test.
    sys.path.insert(0, str(ROOT))
    main()

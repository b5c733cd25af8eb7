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
_COLORS = 256
"""Of a picture."""
_LARGEST = 150_000
"""Of a picture, in bytes."""


def with_values(text: str) -> str:
    """Fill in the values of the given simulation, and how the drive holds its output."""
    for name, value in {"m": 2.0, "d": 15.0, "k": 800.0}.items():
        text = re.sub(rf"^# {name} = ", f"{name} = {value}", text, flags=re.MULTILINE)
    return text.replace('hold = "foh"', 'hold = "zoh"')


def main() -> None:
    from tests.app.first_use import FOREIGN
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
        (folder / "logger" / FOREIGN).write_text("day,dish\nMonday,soup\n", encoding="utf-8")
        server = Server(folder / "stage")
        chromium = Chromium(browser, folder / "browser")
        try:
            film(Visitor(chromium, server), sorted((folder / "logger").iterdir()))
        finally:
            chromium.close()
            server.end()


def film(window: Visitor, logged: list[Path]) -> None:
    """Do the tasks, with a picture of each page."""
    from PIL import Image
    from tests.app.first_use import do_all

    def picture(name: str) -> None:
        window.chromium.settle()
        file = IMAGES / f"{name}.png"
        window.chromium.picture(file, whole=False)
        with Image.open(file) as image:
            image.quantize(_COLORS).save(file, optimize=True)
        if (size := file.stat().st_size) > _LARGEST:
            raise SystemExit(f"{file} has {size} bytes; a picture may have {_LARGEST}.")

    do_all(window, logged, with_values, "Coulomb friction", picture)


if __name__ == "__main__":
    # The tasks are those of the test.
    sys.path.insert(0, str(ROOT))
    main()

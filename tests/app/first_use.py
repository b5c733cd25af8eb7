"""Ten tasks of a first use, each as a script of clicks; written down before the pages were tried on anyone.

None needs the command line. The table of `docs/app.md` lists them, and `docs/examples/record_app.py` films them.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from .served import Visitor, wait_for

Show = Callable[[str], object]
"""Called with the name of each picture of the film, when it can be seen."""
FOREIGN = "lunch.csv"
"""The file that does not belong to the others."""
_LONGEST_RUN = 1200.0


def bring(window: Visitor, files: Sequence[Path], show: Show) -> None:
    """Bring four files of a logger, and one that does not belong to them."""
    window.step("Files")
    window.chromium.choose_files("#files", list(files))
    for file in files:
        window.wait_to_see(f"{file.name}: uploaded.")
        window.chromium.wait(f"!!document.querySelector('[aria-label=\"Remove {file.name}\"]')")
    show("1-files")


def remove(window: Visitor, name: str) -> None:
    """Remove the one that does not belong."""
    window.press(f"Remove {name}")
    wait_for(lambda: not (window.server.folder / name).exists(), "the file moved away")


def look(window: Visitor, name: str, show: Show) -> None:
    """Look what the channels of a file are: names, units, plots."""
    window.step("Files")
    window.follow(f"Channels of {name}")
    window.wait_to_see("Its entry in a campaign")
    window.chromium.wait("document.querySelector('main.content img').naturalWidth > 0")
    show("2-channels")


def choose_rig(window: Visitor, rig: str, show: Show) -> None:
    """Say which rig it is, and see whether its picture is that rig."""
    window.step("Rig")
    window.choose(f"{rig}:")
    window.wait_to_see(f"rigsight init . --model {rig}")
    window.chromium.wait("document.querySelector('img.rig')?.naturalWidth > 0")
    show("3-rig")


def begin(window: Visitor) -> None:
    """Begin the campaign."""
    window.press("Begin the campaign")
    window.wait_to_see("Written: campaign.toml")


def map_columns(window: Visitor, change: Callable[[str], str], show: Show) -> None:
    """Say which column is which signal and what the simulation assumes; a slip of the pen is shown with its line."""
    window.step("Campaign")
    window.wait_to_see("Saved; no error")
    text = change((window.server.folder / "campaign.toml").read_text(encoding="utf-8"))
    window.type_campaign("titel = 'slip'\n" + text)
    window.wait_to_see("Not saved yet")
    window.press("Save")
    window.wait_to_see("line 1, column")
    window.press("Go to line 1")
    window.chromium.wait("document.querySelectorAll('.cm-line.wrong').length === 1")
    wait_for(lambda: not window.is_done("Campaign"), "a campaign that is not done")
    show("4-campaign")
    window.type_campaign(text)
    window.press("Save")
    window.wait_to_see("Saved; no error")
    wait_for(lambda: window.is_done("Campaign"), "a campaign that is done")


def check(window: Visitor, show: Show) -> None:
    """Ask what these records allow to find."""
    window.step("Check")
    _run(window)
    show("5-check")


def diagnose(window: Visitor, show: Show) -> None:
    """Diagnose; stop it in the middle, and go on."""
    window.step("Diagnosis")
    window.press("Run")
    window.wait_to_see("Diagnosing (")
    window.wait_to_see(" left in this part")
    show("6-running")
    window.press("Cancel")
    window.wait_to_see("Canceled.")
    assert not (window.server.folder / "diagnosis").exists()
    _run(window)
    show("7-diagnosis")


def read(window: Visitor, effect: str, show: Show) -> None:
    """Read the verdict, and what to record next."""
    # The report is in a frame of its own origin, into which not even the page can look.
    page = "fetch(document.querySelector('iframe').src).then((answer) => answer.text())"
    assert effect in window.chromium.evaluate(page)
    window.step("Next experiment")
    _run(window)
    window.chromium.wait("!!document.querySelector('[aria-label=\"Download plan/plan.csv\"]')")
    window.chromium.evaluate("document.querySelector('iframe').scrollIntoView({block: 'end'})")
    show("8-next-experiment")


def export(window: Visitor, show: Show) -> None:
    """Take the model home as C."""
    window.step("Export")
    window.wait_to_see("runs without rigsight")
    window.choose("c:")
    window.wait_to_see("rigsight export diagnosis --to c")
    window.press("Export")
    window.wait_to_see("Done.")
    show("9-export")
    address = window.chromium.evaluate("document.querySelector('ul.files a').getAttribute('href')")
    code, text = window.server.ask("GET", address)
    assert (code, "double" in text) == (200, True)


TASKS = (bring, remove, look, choose_rig, begin, map_columns, check, diagnose, read, export)


def do_all(
    window: Visitor,
    logged: Sequence[Path],
    change: Callable[[str], str],
    effect: str,
    show: Show = lambda _: None,
) -> None:
    """Do the tasks with files of an axis, whose campaign is changed and in whose verdict an effect is to be found."""
    bring(window, logged, show)
    remove(window, FOREIGN)
    look(window, logged[-1].name, show)
    choose_rig(window, "axis", show)
    begin(window)
    map_columns(window, change, show)
    check(window, show)
    diagnose(window, show)
    read(window, effect, show)
    export(window, show)


def _run(window: Visitor) -> None:
    window.press("Run")
    window.wait_to_see("Done.", _LONGEST_RUN)
    window.chromium.wait("!!document.querySelector('iframe')")
    # The page in the page is drawn by its own process.
    time.sleep(2.0)

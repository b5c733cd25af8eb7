"""Ten tasks of a first use, each as a script of clicks; written down before the pages were tried on anyone.

1. Bring four files of a logger, and one that does not belong to them.
2. Remove the one that does not belong.
3. Look what the channels of a file are: names, units, plots.
4. Say which rig it is, and see whether its picture is that rig.
5. Begin the campaign.
6. Say which column is which signal and what the simulation assumes; a slip of the pen is shown with its line.
7. Ask what these records allow to find (where this rigsight has `check`).
8. Diagnose; stop it in the middle, and go on.
9. Read the verdict, and what to record next (where this rigsight has `plan`).
10. Take the model home as C.

None needs the command line. `docs/examples/record_app.py` films them.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from .served import Visitor, wait_for


def bring(window: Visitor, files: Sequence[Path]) -> None:
    window.step("Files")
    window.chromium.choose_files("#files", list(files))
    for file in files:
        window.wait_to_see(f"{file.name}: uploaded.")
        window.chromium.wait(f"!!document.querySelector('[aria-label=\"Remove {file.name}\"]')")


def remove(window: Visitor, name: str) -> None:
    window.press(f"Remove {name}")
    wait_for(lambda: not (window.server.folder / name).exists(), "the file moved away")


def look(window: Visitor, name: str) -> None:
    window.step("Files")
    window.follow(f"Channels of {name}")
    window.wait_to_see("In a campaign, with the rig")
    window.chromium.wait("document.querySelector('main.content img').naturalWidth > 0")


def choose_rig(window: Visitor, rig: str) -> None:
    window.step("Rig")
    window.choose(f"{rig}:")
    window.wait_to_see(f"rigsight init . --model {rig}")
    window.chromium.wait("document.querySelector('img.rig')?.naturalWidth > 0")


def begin(window: Visitor) -> None:
    window.press("Begin the campaign")
    window.wait_to_see("Written: campaign.toml")


def map_columns(window: Visitor, change: Callable[[str], str]) -> None:
    window.step("Campaign")
    window.wait_to_see("Saved, and every key can be used.")
    text = change((window.server.folder / "campaign.toml").read_text(encoding="utf-8"))
    window.type_campaign("titel = 'slip'\n" + text)
    window.wait_to_see("Not saved yet")
    window.press("Save")
    window.wait_to_see("line 1, column")
    window.press("Go to line 1")
    window.chromium.wait("document.querySelectorAll('.cm-line.wrong').length === 1")


def correct(window: Visitor) -> None:
    text = (window.server.folder / "campaign.toml").read_text(encoding="utf-8")
    window.type_campaign(text.partition("\n")[2])
    window.press("Save")
    window.wait_to_see("Saved, and every key can be used.")


def check(window: Visitor) -> None:
    window.step("Check")
    window.press("Run")
    window.chromium.wait("!!document.querySelector('iframe')")


def diagnose_halfway(window: Visitor, in_between: Callable[[], object] = lambda: None) -> None:
    window.step("Diagnosis")
    window.press("Run")
    window.wait_to_see(" left")
    in_between()
    window.press("Cancel")
    window.wait_to_see("Canceled.")
    assert not (window.server.folder / "diagnosis").exists()


def diagnose(window: Visitor) -> None:
    window.press("Run")
    window.chromium.wait("!!document.querySelector('iframe')")
    # The page in the page is drawn by its own process.
    time.sleep(2.0)


def read_verdict(window: Visitor, effect: str) -> None:
    # The report is in a frame of its own origin, into which not even the page can look.
    page = "fetch(document.querySelector('iframe').src).then((answer) => answer.text())"
    assert effect in window.chromium.evaluate(page)


def plan(window: Visitor) -> None:
    window.step("Next experiment")
    window.press("Run")
    window.chromium.wait("!!document.querySelector('ul.files a')")


def export(window: Visitor) -> None:
    window.step("Export")
    window.wait_to_see("runs without rigsight")
    window.choose("c:")
    window.wait_to_see("rigsight export diagnosis --to c")
    window.press("Export")
    window.wait_to_see("Done.")
    address = window.chromium.evaluate("document.querySelector('ul.files a').getAttribute('href')")
    code, text = window.server.ask("GET", address)
    assert (code, "double" in text) == (200, True)

"""Which steps lead from files to an exported model, with which command each is done, and what of it is there already."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from rigsight.app.workspace import CAMPAIGN, OWN, find_draft
from rigsight.errors import InputError
from rigsight.workflow.campaign.campaign_file import read_campaign_table
from rigsight.workflow.init import measured_files
from rigsight.workflow.run.results import DIAGNOSIS_FILE, REPORT_FILE

RESULTS = "diagnosis"
EXPORTS = "exports"
ROBOT_SUFFIXES = (".xml", ".mjcf", ".urdf")
OWN_EFFECTS = ".py"
SHOWN = (".html", ".png", ".svg")
"""Suffixes of files that a browser shows; others are downloaded."""


@dataclass(frozen=True)
class Run:
    """A step that is one command on the whole campaign."""

    key: str  # address of its page
    title: str
    command: str  # its name, and the folder of its results
    out: str
    page: str  # of its results, to be shown; what the command prints is shown where a browser cannot show it
    words: str  # what it does
    fields: tuple[tuple[str, str], ...] = ()  # options to be typed, each with what is asked for
    is_optional: bool = False  # no later step needs it


RUNS = (
    Run("check", "Check", "check", "check", "check.html",
        "Are the records good enough? Shows their faults, and what they can tell apart, before anything is fitted."),
    Run("diagnosis", "Diagnosis", "diagnose", RESULTS, REPORT_FILE,
        "Which effect, such as friction, play or a delay, does the simulation lack? Every candidate is fitted to the records; "
        "this takes minutes. The page may be closed meanwhile; a canceled diagnosis goes on from its finished fits."),
    Run("plan", "Next experiment", "plan", "plan", "plan.html",
        "What to record next: an input that tells apart what the diagnosis still holds possible, or, before there is one, "
        "what the check leaves open. plan.csv is played on the bench.",
        fields=(("--limit", "Limits in SI units, such as x=0.02 u=3, or d(x)=0.5 for the speed of x (optional)"),
                ("--seconds", "Duration in seconds (optional)"))),
    Run("power", "Smallest effects", "power", "power", "power.json",
        "How small may an effect be and still be named by these records? No later step needs this.", is_optional=True),
    Run("discovery", "Equation", "discover", "discovery", "discovery.svg",
        "Which equation do the records give by sparse regression, without a list of effects? No later step needs this.",
        is_optional=True),
)  # fmt: skip


@dataclass(frozen=True)
class Step:
    """A step of the list on every page."""

    address: str
    title: str
    is_done: bool
    is_optional: bool = False

    @property
    def state(self) -> str:
        """What the list says beside its title."""
        return "done" if self.is_done else "optional" if self.is_optional else ""


@dataclass(frozen=True)
class Site:
    """The folder that the pages show, and the names of the commands that this rigsight has."""

    root: Path
    commands: Collection[str]

    @property
    def runs(self) -> tuple[Run, ...]:
        """The runs that this rigsight can do."""
        return tuple(run for run in RUNS if run.command in self.commands)

    def arguments(self, run: Run, options: Sequence[str] = ()) -> tuple[str, ...]:
        """Return what follows `rigsight` to do a run."""
        diagnosed = run.command == "plan" and (self.root / RESULTS / DIAGNOSIS_FILE).is_file()
        rivals = ("--diagnosis", RESULTS) if diagnosed else ()
        return (run.command, ".", "--out", run.out, *rivals, *options)

    def steps(self) -> list[Step]:
        """Return every step as it is now."""
        campaign = self.root / CAMPAIGN
        is_usable = campaign.is_file() and not self.is_edited() and not campaign_errors(campaign)
        return [
            Step("/", "Files", bool(measured_files(self.root))),
            Step("/rig", "Rig", campaign.is_file()),
            Step("/campaign", "Campaign", is_usable),
            *(Step(f"/{run.key}", run.title, self._is_done(run), run.is_optional) for run in self.runs),
            Step("/export", "Export", bool(self.results(EXPORTS))),
        ]

    def _is_done(self, run: Run) -> bool:
        page = f"{run.out}/{run.page}"
        return (self.root / page).is_file() and not self.is_outdated(page)

    def is_edited(self) -> bool:
        """Return whether text of the campaign waits to be saved."""
        return find_draft(self.root) is not None

    def results(self, folder: str) -> list[str]:
        """Return the files of a folder of results, by their paths in the campaign's folder."""
        found = (self.root / folder).rglob("*")
        return sorted(file.relative_to(self.root).as_posix() for file in found if file.is_file())

    def is_outdated(self, result: str) -> bool:
        """Return whether the campaign was changed after a result."""
        campaign, file = self.root / CAMPAIGN, self.root / result
        return campaign.is_file() and file.is_file() and campaign.stat().st_mtime > file.stat().st_mtime

    def inspection(self, name: str) -> tuple[str, ...]:
        """Return the arguments that describe a file."""
        # A name that begins with a dash would be read as an option.
        file = f"./{name}" if name.startswith("-") else name
        return ("inspect", file, "--json", "--picture", picture_of(name))

    def files(self, *suffixes: str) -> list[str]:
        """Return the names of the files with one of these endings, or of all; without the campaign and hidden ones."""
        return sorted(
            file.name
            for file in self.root.iterdir()
            if (not suffixes or file.suffix.lower() in suffixes)
            and file.name != CAMPAIGN
            and not file.name.startswith(".")
            and file.is_file()
        )


def campaign_errors(file: Path) -> tuple[str, ...]:
    """Return what cannot be used in a campaign, one message per error, without reading its records."""
    try:
        return _errors(file, file.stat().st_mtime_ns)
    except OSError as error:
        return (f"{file.name} cannot be read: {error.strerror}.",)


@lru_cache(maxsize=1)
def _errors(file: Path, _changed: int) -> tuple[str, ...]:
    try:
        read_campaign_table(file)
    except InputError as error:
        return tuple(str(error).splitlines())
    return ()


def picture_of(name: str) -> str:
    """Return where the picture of a file or rig is kept, by its path in the campaign's folder."""
    return f"{OWN}/pictures/{name}.png"


def inspection_key(name: str) -> str:
    """Return the name under which the inspection of a file runs."""
    return f"inspect-{name}"

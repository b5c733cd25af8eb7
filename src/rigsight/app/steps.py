"""Which steps lead from files to an exported model, with which command each is done, and what of it is there already."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

from rigsight.app.workspace import CAMPAIGN, OWN, find_draft
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


RUNS = (
    Run("check", "Check", "check", "check", "check.html", "What do the records allow to find?"),
    Run("diagnosis", "Diagnosis", "diagnose", RESULTS, REPORT_FILE,
        "Which effect does the simulation lack? Finished fits are kept: a canceled diagnosis goes on from there."),
    Run("plan", "Next experiment", "plan", "plan", "plan.html",
        "Which record would tell the rivals of the diagnosis apart, or, before there is one, what the check leaves open? "
        "plan.csv is played on the bench.",
        fields=(("--limit", "Limits, such as x=0.02 u=3 d(x)=0.5"), ("--seconds", "Duration in seconds"))),
    Run("power", "Smallest effects", "power", "power", "power.json",
        "How small may an effect be and still be named by these records?"),
    Run("discovery", "Equation", "discover", "discovery", "discovery.svg",
        "Which equation do the records give by sparse regression, without naming an effect?"),
)  # fmt: skip


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

    def steps(self) -> list[tuple[str, str, bool]]:
        """Return address, title and whether it is done of every step."""
        return [
            ("/", "Files", bool(measured_files(self.root))),
            ("/rig", "Rig", (self.root / CAMPAIGN).is_file()),
            ("/campaign", "Campaign", (self.root / CAMPAIGN).is_file() and not self.is_edited()),
            *((f"/{run.key}", run.title, (self.root / run.out / run.page).is_file()) for run in self.runs),
            ("/export", "Export", bool(self.results(EXPORTS))),
        ]

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
        return ("inspect", name, "--json", "--picture", picture_of(name))

    def files(self, *suffixes: str) -> list[str]:
        """Return the names of the files with one of these endings, without the campaign and hidden ones."""
        return sorted(
            file.name
            for file in self.root.iterdir()
            if file.suffix.lower() in suffixes
            and file.name != CAMPAIGN
            and not file.name.startswith(".")
            and file.is_file()
        )


def picture_of(name: str) -> str:
    """Return where the picture of a file or rig is kept, by its path in the campaign's folder."""
    return f"{OWN}/pictures/{name}.png"


def inspection_key(name: str) -> str:
    """Return the name under which the inspection of a file runs."""
    return f"inspect-{name}"

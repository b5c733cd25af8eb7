"""The work of `rigsight export`: a model -> one file for another tool."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rigsight.effects import Effect
from rigsight.errors import InputError, check_option
from rigsight.export import TARGETS
from rigsight.export.targets import export_model
from rigsight.identify.fit.first_states import first_state
from rigsight.records import Record
from rigsight.rigs import Rig
from rigsight.simulate.input_hold import Hold
from rigsight.simulate.model import Model
from rigsight.workflow.campaign.model_file import named_model
from rigsight.workflow.run.results import check_target, write_together

if TYPE_CHECKING:
    from rigsight.robots import WrittenGap


@dataclass(frozen=True)
class WrittenFile:
    """A written file."""

    path: Path  # the file
    written: tuple[str, ...] = ()  # descriptions of the changed fields of a robot model
    without_field: tuple[str, ...] = ()  # descriptions of what the file has no field for
    gap: tuple[WrittenGap, ...] = ()  # of each sensor, where records were given


ROBOT_TARGETS = {"mjcf": ".xml", "isaac": ".yaml", "usd": ".usda"}
"""Formats of robot models into which parameter values and effects are written back, with their file suffixes."""


def run_export(
    model: str | Path,
    target: str,
    out: str | Path | None = None,
    *,
    hold: Hold | None = None,
    step: float | None = None,
    source_only: bool = False,
    robot: Path | None = None,
    usd: Path | None = None,
    campaign: Path | None = None,
    own_effects: Sequence[Effect] = (),
    own_rigs: Iterable[Rig] = (),
) -> WrittenFile:
    """Write a model for another tool."""
    check_option("Target", target, (*TARGETS, *ROBOT_TARGETS))
    read = named_model(model, own_effects, own_rigs)
    of_robots = (
        ("--usd", usd, ("usd",)),
        ("--mjcf", robot, ROBOT_TARGETS),
        ("--campaign", campaign, ("mjcf",)),
    )
    for option, given, targets in of_robots:
        if given is not None and target not in targets:
            raise InputError(f"{option} applies only to {', '.join(targets)}; leave it out for {target}.")
    if target in ROBOT_TARGETS and (
        hold is not None or source_only or (step is not None and target == "mjcf")
    ):
        raise InputError(f"--hold, --step and --source-only do not apply to {target}. Leave them out.")
    if target in ROBOT_TARGETS:
        records = () if campaign is None else _validation(campaign, own_effects, own_rigs)
        return _robot(read, target, robot, usd, out, step, records)
    chosen = TARGETS[target]
    file = _target_file(read, out, chosen.name, chosen.suffix)
    content = export_model(
        read,
        target,
        source=_source(Path(model)),
        name=file.stem,
        hold=hold,
        step=step,
        source_only=source_only,
    )
    write_together(file.parent, {file.name: content})
    return WrittenFile(file)


def _validation(campaign: Path, own_effects: Sequence[Effect], own_rigs: Iterable[Rig]) -> tuple[Record, ...]:
    """Return the validation records of a campaign."""
    from rigsight.workflow.campaign.read_campaign import read_campaign

    found = read_campaign(campaign, own_effects, own_rigs).validation
    if not found:
        raise InputError(f'{campaign} has no validation record: give one of its records role = "validation".')
    return found


def _robot(
    model: Model,
    target: str,
    robot: Path | None,
    usd: Path | None,
    out: str | Path | None,
    step: float | None,
    records: Sequence[Record],
) -> WrittenFile:
    from rigsight.robots import isaac_settings, usd_layer, write_back
    from rigsight.robots.runs import gap_of_written

    if robot is None:
        raise InputError(
            f"{target} is written from the model of the robot: name the MJCF or URDF file from which rigsight init made the rig "
            "with --mjcf."
        )
    file = _target_file(model, out, target, ROBOT_TARGETS[target])
    if file.resolve() in (robot.resolve(), usd and usd.resolve()):
        raise InputError(
            f"{file} is the model of the robot itself and is not overwritten; name another file with --out."
        )
    if target == "mjcf":
        back = write_back(model, robot)
        # In MuJoCo and in the model, both from the states that the first samples of the records show.
        starts = [first_state(model.structure, r, {**model.values, **r.constants}) for r in records]
        gap = gap_of_written(model, robot, records, starts) if records else ()
        write_together(file.parent, {file.name: back.text})
        return WrittenFile(file, back.written, back.without_field, gap)
    written = (
        isaac_settings(model, robot, step) if target == "isaac" else usd_layer(model, robot, file, usd, step)
    )
    write_together(file.parent, {file.name: written.text})
    return WrittenFile(file, written.written, written.without_field)


def _target_file(model: Model, out: str | Path | None, target: str, suffix: str) -> Path:
    file = Path(f"{model.structure.rig.name}{suffix}" if out is None else out)
    check_target(file)
    if file.suffix != suffix:
        raise InputError(f"{file} has the wrong suffix for {target}: name a file that ends in {suffix}.")
    return file


def _source(model: Path) -> str:
    """Return the name of the model for exported files, without the parent folders."""
    folder = model.absolute() if model.is_dir() else model.absolute().parent
    return f"{folder.name}/{'model.json' if model.is_dir() else model.name}"

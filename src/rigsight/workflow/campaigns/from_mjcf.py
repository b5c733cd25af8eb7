"""What `rigsight init --mjcf` does: a robot's model -> a rig file that moves as MuJoCo does, and a campaign for its records."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from rigsight.errors import InputError
from rigsight.robots import FreeRun, RigDraft, free_run, read_robot, rig_text, with_gears
from rigsight.workflow.campaigns.init import CAMPAIGN_FILE, Draft, measured_files, run_init
from rigsight.workflow.files.results import write_together
from rigsight.workflow.progress import Listener, Stage, silent


@dataclass(frozen=True, eq=False)
class ModelDraft:
    """A rig file as it was written.

    Attributes
    ----------
    path
        The rig file.
    draft
        What it says, and what it leaves out.
    run
        How it moves beside MuJoCo.
    campaign
        The campaign beside it; None where the folder holds no records yet.
    """

    path: Path
    draft: RigDraft
    run: FreeRun
    campaign: Draft | None


def run_init_from_mjcf(
    folder: str | Path,
    model_file: str | Path,
    *,
    gears: Mapping[str, float] | None = None,
    as_it_is: bool = False,
    listener: Listener = silent,
) -> ModelDraft:
    """Write the rig file of a MuJoCo model or URDF, and a campaign if its folder holds measured files.

    Parameters
    ----------
    folder
        Where it is written; created if it does not exist.
    model_file
        MJCF or URDF.
    gears
        Name of a joint -> stiffness of its gear [N m/rad or N/m].
    as_it_is
        Leave the bodies to MuJoCo: contacts, ranges, equalities and tendons too.
    listener
        Told what is being done: equations of many joints take their time.

    Raises
    ------
    InputError
        If the model cannot be read or taken over, a file is in the way, or nothing can be written there.
    """
    folder, source = Path(folder), Path(model_file)
    robot = read_robot(source, gears, as_it_is=as_it_is)
    draft = robot.draft
    stage = Stage(f"Equations of {len(draft.tables['coordinates'])} coordinates", 2, listener)
    rig = draft.rig
    stage.finished("derived")
    path = folder / f"{rig.name}.toml"
    text = rig_text(draft, source.name, folder)
    # Once records are there, the same command goes on with the campaign.
    if path.exists() and path.read_text(encoding="utf-8", errors="replace") != text:
        raise InputError(f"{path} exists already and is not overwritten; remove it, or edit it by hand.")
    campaign_file = folder / CAMPAIGN_FILE
    if campaign_file.exists() or campaign_file.is_symlink():
        raise InputError(
            f"{campaign_file} exists already and is not overwritten; remove it, or edit it by hand."
        )
    run = free_run(with_gears(robot.spec, draft), draft)
    stage.finished("compared with MuJoCo")
    write_together(folder, {path.name: text}, "Make room or ask for the right to write there.")
    campaign = None
    if measured_files(folder):
        campaign = run_init(folder, model=rig.name, rig_files=[path], values=draft.values)
    return ModelDraft(path, draft, run, campaign)

"""What `rigsight export` does: a model -> one file for another tool."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from rigsight.effects import Effect
from rigsight.errors import InputError, check_option
from rigsight.export import TARGETS, export_model
from rigsight.rigs import Rig
from rigsight.simulate.input_hold import Hold
from rigsight.workflow.files.model_file import read_model
from rigsight.workflow.files.results import check_target, write_together


def run_export(
    model: str | Path,
    target: str,
    out: str | Path | None = None,
    *,
    hold: Hold | None = None,
    step: float | None = None,
    source_only: bool = False,
    own_effects: Sequence[Effect] = (),
    own_rigs: Iterable[Rig] = (),
) -> Path:
    """Write a model for another tool.

    Parameters
    ----------
    model
        A ``model.json`` or the folder that holds one.
    target
        A key of `rigsight.export.TARGETS`.
    out
        File to write; default is the rig's name with the target's suffix in this folder. Its name is that of the function, C
        prefix or model.
    hold
        How the input behaves between its samples; default is the model's.
    step
        Longest internal step of a target with a fixed one [s].
    source_only
        True for an FMU without a binary.
    own_effects
        Effects that the model may name beside those of the catalogue.
    own_rigs
        Rigs that it may name beside the built-in ones, where it does not declare its own.

    Returns
    -------
    The file written.

    Raises
    ------
    InputError
        If the model cannot be read, the target cannot say it, or the file cannot be written.
    """
    chosen = TARGETS[check_option("Target", target, TARGETS)]
    read = read_model(model, own_effects, own_rigs)
    file = Path(f"{read.structure.rig.name}{chosen.suffix}" if out is None else out)
    check_target(file)
    if file.suffix != chosen.suffix:
        raise InputError(f"{file} cannot hold {chosen.name}: name a file that ends in {chosen.suffix}.")
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
    return file


def _source(model: Path) -> str:
    """Return how the files call the model: without the folders of whoever wrote it."""
    folder = model.absolute() if model.is_dir() else model.absolute().parent
    return f"{folder.name}/{'model.json' if model.is_dir() else model.name}"

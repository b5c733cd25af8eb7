"""The work of `rigsight difference`: diagnoses or campaigns -> `difference.json` and a picture; which numbers changed?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rigsight.diagnose.trust.patterns import Role
from rigsight.effects import Effect, Family
from rigsight.errors import InputError
from rigsight.identify.record_identification import EstimationOptions
from rigsight.json_data import json_data
from rigsight.plot import GroupPanel, parameters_by_group, png_bytes
from rigsight.rigs import Rig
from rigsight.workflow.campaign.model_file import read_model
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.differing.rows import FALSE_ALARMS, Row, Verdict, rows_of
from rigsight.workflow.differing.units import (
    Unit,
    read_unit,
    refuse_other_rigs,
    unit_of_records,
    with_effects_of,
)
from rigsight.workflow.identification.rig import identify_rig
from rigsight.workflow.run.kernels import checked_jobs
from rigsight.workflow.run.progress import Listener, silent
from rigsight.workflow.run.results import DIAGNOSIS_FILE, check_writable, json_text, write_together

SCHEMA_VERSION = 1
DIFFERENCE_FILE, PICTURE_FILE = "difference.json", "difference.png"
_DPI = 150
_WEAR = frozenset({Role.DAMPING, Family.DRY_FRICTION, Family.DAMPING_LAW, Family.PLAY_AND_STOPS})
"""What wears: a bearing, a guide, a gear."""


@dataclass(frozen=True)
class Difference:
    """Which numbers changed between diagnoses."""

    units: tuple[Unit, ...]
    along: tuple[float, ...]  # axis of the trend, the order of the diagnoses where none was given
    rows: tuple[Row, ...]  # those that changed first

    @property
    def changed(self) -> tuple[Row, ...]:
        """The rows that changed."""
        return tuple(row for row in self.rows if row.verdict is Verdict.CHANGED)

    @property
    def other_effects(self) -> dict[str, tuple[str, ...]]:
        """Effects that some models have and others not, with the diagnoses that have them."""
        names = dict.fromkeys(effect for unit in self.units for effect in unit.effects)
        having = {name: tuple(unit.name for unit in self.units if name in unit.effects) for name in names}
        return {name: own for name, own in having.items() if len(own) < len(self.units)}

    @property
    def conclusion(self) -> str:
        """What the changed numbers have in common, in a sentence or two."""
        others = ", ".join(self.other_effects)
        alone = [unit.name for unit in self.units if unit.has_one_record]
        scatter = (
            f" {', '.join(alone)}: one record, so that the scatter between records is not known; what changed may only look so."
            if alone and self.changed
            else ""
        )
        besides = (
            f" The models differ in {others}: numbers of the rig may differ because of that. Diagnose all with the same --effect."
            if others
            else ""
        ) + scatter
        if not self.changed:
            return f"No number changed beyond what records of one campaign differ.{besides}"
        names = ", ".join(row.name for row in self.changed)
        roles = {
            next(unit.roles[row.name] for unit in self.units if row.name in unit.roles)
            for row in self.changed
        }
        if roles <= _WEAR:
            kind = "all are damping, friction or play, as with wear, temperature or another unit"
        elif {Role.MASS, Role.STIFFNESS} <= roles:
            kind = "masses and stiffnesses moved together, as with another gain of a drive or sensor, or another unit"
        else:
            kind = "they are not only damping, friction or play, so wear alone does not explain them"
        return f"Changed: {names}; {kind}.{besides}"

    def to_json(self) -> dict[str, Any]:
        """Return the content of ``difference.json``."""
        content = {
            "schema_version": SCHEMA_VERSION,
            "diagnoses": [unit.name for unit in self.units],
            "along": self.along,
            "false_alarms": FALSE_ALARMS,
            "conclusion": self.conclusion,
            "effects_not_everywhere": self.other_effects,
            "numbers": [
                {
                    "name": row.name,
                    "unit": row.unit,
                    "verdict": row.verdict,
                    "difference": row.difference,
                    "p_by_errors": row.p_errors,
                    "p_value": row.p_value,
                    "trend": row.trend,
                    "values": [
                        own
                        and {
                            "value": own.value,
                            "std": own.std,
                            "std_with_scatter": own.with_scatter,
                            "entangled_with": own.entangled,
                        }
                        for own in row.values
                    ],
                }
                for row in self.rows
            ],
        }
        return json_data(content)


def run_difference(
    folders: Sequence[str | Path],
    out: str | Path | None = None,
    *,
    at: Sequence[float] | None = None,
    own_effects: Sequence[Effect] = (),
    own_rigs: Sequence[Rig] = (),
    n_jobs: int | None = None,
    listener: Listener = silent,
) -> Difference:
    """Compare the numbers of two or more diagnoses or campaigns of one rig; a campaign is identified first."""
    jobs = checked_jobs(n_jobs)
    if len(folders) < 2:
        raise InputError(f"A difference needs at least two diagnoses or campaigns, got {len(folders)}.")
    if at is not None and len(at) != len(folders):
        raise InputError(f"--at gives {len(at)} values for {len(folders)} diagnoses; give one for each.")
    if at is not None and (len(folders) < 3 or not np.ptp(at) > 0.0):
        raise InputError("--at is the axis of a trend: it needs three or more diagnoses at different values.")
    if out is not None:
        check_writable(Path(out), DIFFERENCE_FILE, PICTURE_FILE)

    units = _units([Path(folder) for folder in folders], own_effects, own_rigs, jobs, listener)
    along = tuple(at) if at is not None else tuple(map(float, range(len(units))))
    found = Difference(tuple(units), along, rows_of(units, along))
    if out is not None:
        files: dict[str, str | bytes] = {DIFFERENCE_FILE: json_text(found.to_json())}
        if panels := _panels(found):
            files[PICTURE_FILE] = png_bytes(parameters_by_group(panels), _DPI)
        write_together(Path(out), files)
    return found


def _units(
    paths: Sequence[Path],
    own_effects: Sequence[Effect],
    own_rigs: Sequence[Rig],
    jobs: int,
    listener: Listener,
) -> list[Unit]:
    """Return what diagnoses found, and what the records of campaigns give with the same effects in all models."""
    read = {path: read_campaign(path, own_effects, own_rigs) for path in paths if _is_campaign(path)}
    found = {path: read_unit(path, own_effects, own_rigs) for path in paths if path not in read}
    refuse_other_rigs({str(path): read[path].rig.name if path in read else found[path].rig for path in paths})
    models = [(campaign.modelled, campaign.given) for campaign in read.values()]
    for model in (read_model(path, own_effects, own_rigs) for path in found):
        models.append((model.effects, model.values))
    for path, campaign in read.items():
        whole = with_effects_of(campaign, models)
        found[path] = unit_of_records(
            str(path), whole, identify_rig(whole, EstimationOptions(), jobs, listener)
        )
    return [found[path] for path in paths]


def _is_campaign(path: Path) -> bool:
    """Return whether a path is a campaign and no folder of a diagnosis."""
    return path.is_file() or ((path / "campaign.toml").is_file() and not (path / DIAGNOSIS_FILE).is_file())


def _panels(found: Difference) -> list[GroupPanel]:
    """Return each number that all models have, by diagnosis."""
    panels = []
    for row in found.rows:
        known = [own for own in row.values if own is not None]
        wide = np.array([own.with_scatter for own in known])
        if len(known) < len(row.values) or not np.all(np.isfinite(wide) & (wide > 0.0)):
            continue
        weights = 1.0 / wide**2
        mean = float(weights @ np.array([own.value for own in known]) / np.sum(weights))
        error = 1.0 / math.sqrt(float(np.sum(weights)))
        paths = [Path(unit.name) for unit in found.units]
        short = [path.name for path in paths]
        names = short if len(set(short)) == len(short) else [str(path) for path in paths]
        groups = tuple((name, own.value, own.with_scatter) for name, own in zip(names, known, strict=True))
        differs = row.verdict is Verdict.CHANGED
        panels.append(GroupPanel(row.name, row.unit, "unit", groups, (mean, error), differs))
    return panels

"""The work of `rigsight difference`: diagnoses or campaigns -> `difference.json` and a picture; which numbers changed?

Each number is judged by its errors, and by the scatter between records that these do not include.

References
----------
S. Holm, Scand. J. Stat. 6 (1979) 65, for several tests. W. G. Cochran, J. R. Stat. Soc. Suppl. 4 (1937) 102, for the test of
homogeneity.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from scipy.stats import chi2, norm

from rigsight.diagnose.trust.patterns import Role
from rigsight.diagnose.trust.trust import adjusted
from rigsight.effects import Effect, Family
from rigsight.errors import InputError
from rigsight.identify.information import POORLY_KNOWN
from rigsight.identify.record_identification import EstimationOptions
from rigsight.json_data import json_data
from rigsight.plot import GroupPanel, parameters_by_group, png_bytes
from rigsight.records.record import Floats
from rigsight.rigs import Rig
from rigsight.workflow.campaign.model_file import read_model
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.differing import (
    Known,
    Unit,
    read_unit,
    refuse_other_rigs,
    unit_of_records,
    with_effects_of,
)
from rigsight.workflow.identification.joint import beyond_noise
from rigsight.workflow.identification.rig import identify_rig
from rigsight.workflow.run.kernels import checked_jobs
from rigsight.workflow.run.progress import Listener, silent
from rigsight.workflow.run.results import DIAGNOSIS_FILE, check_writable, json_text, write_together

SCHEMA_VERSION = 1
DIFFERENCE_FILE, PICTURE_FILE = "difference.json", "difference.png"
_DPI = 150
_WEAR = frozenset({Role.DAMPING, Family.DRY_FRICTION, Family.DAMPING_LAW, Family.PLAY_AND_STOPS})
"""What wears: a bearing, a guide, a gear."""
FALSE_ALARMS = 0.05
"""Probability that any number of a table is called changed if none is (Holm)."""
_Test = TypeVar("_Test")


class Verdict(StrEnum):
    """What can be said of a number."""

    CHANGED = "changed"
    LOOKS_CHANGED = "only looks changed"
    UNKNOWN = "not determined"
    SAME = "same"
    NOT_EVERYWHERE = "not in every model"


@dataclass(frozen=True)
class Trend:
    """Weighted regression of a number over an axis."""

    slope: float
    std: float
    p_value: float  # adjusted for all tests of the table


@dataclass(frozen=True)
class Row:
    """A number in each diagnosis."""

    name: str
    unit: str
    values: tuple[Known | None, ...]
    verdict: Verdict
    # The last minus the first, in standard errors of that difference with the scatter between records; NaN where it is unknown.
    difference: float
    p_errors: float  # of such differences by the standard errors alone, adjusted for all tests; NaN where it was not tested
    p_value: float  # the same with the scatter between records
    trend: Trend | None  # for more than two diagnoses


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
        lacking = [f"{unit.remainder} ({unit.name})" for unit in self.units if unit.remainder]
        if lacking:
            besides += (
                f" The equations leave {', '.join(lacking)}, more than noise: an effect may have changed which they lack. Run "
                "'rigsight diagnose' on each, and compare the results."
            )
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
    found = Difference(tuple(units), along, _rows(units, along))
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
        identified = identify_rig(whole, EstimationOptions(), jobs, listener)
        remainders = beyond_noise(identified.joint.scores, whole.estimation)
        found[path] = replace(
            unit_of_records(str(path), whole, identified), remainder=next(iter(remainders), "")
        )
    return [found[path] for path in paths]


def _is_campaign(path: Path) -> bool:
    """Return whether a path is a campaign and no folder of a diagnosis."""
    if path.is_file():
        return path.suffix != ".json"
    return (path / "campaign.toml").is_file() and not (path / DIAGNOSIS_FILE).is_file()


def _rows(units: Sequence[Unit], along: Sequence[float]) -> tuple[Row, ...]:
    """Return a row for each number of any model, those that changed first."""
    names = list(dict.fromkeys(name for unit in units for name in unit.numbers))
    values = {name: tuple(unit.numbers.get(name) for unit in units) for name in names}
    complete = {
        name: [own for own in known if own is not None]
        for name, known in values.items()
        if all(own is not None and math.isfinite(own.std) and own.std > 0.0 for own in known)
    }
    errors = _holm({name: _homogeneity(known, "std") for name, known in complete.items()})
    slopes = {name: _slope(known, along) for name, known in complete.items()}
    scatter = _holm(
        {(name, "differences"): _homogeneity(known, "with_scatter") for name, known in complete.items()}
        | {(name, "trend"): slope[2] for name, slope in slopes.items() if slope is not None}
    )
    found = []
    for name, known in values.items():
        slope = slopes.get(name)
        p_errors = errors.get(name, math.nan)
        p_value = scatter.get((name, "differences"), math.nan)
        trend = slope and Trend(slope[0], slope[1], scatter[name, "trend"])
        unit = next(unit.units[name] for unit in units if name in unit.units)
        verdict = _verdict(known, p_errors, min(p_value, trend.p_value if trend else math.inf))
        found.append(Row(name, unit, known, verdict, _difference(known), p_errors, p_value, trend))
    order = list(Verdict)
    return tuple(sorted(found, key=lambda row: (order.index(row.verdict), row.p_value)))


def _holm(p_values: Mapping[_Test, float]) -> dict[_Test, float]:
    return dict(zip(p_values, adjusted(list(p_values.values())), strict=True))


def _verdict(known: Sequence[Known | None], p_errors: float, p_value: float) -> Verdict:
    if any(own is None for own in known):
        return Verdict.NOT_EVERYWHERE
    if p_value <= FALSE_ALARMS:
        return Verdict.CHANGED
    if p_errors <= FALSE_ALARMS:
        return Verdict.LOOKS_CHANGED
    loose = [own for own in known if own is not None and not own.with_scatter < POORLY_KNOWN * abs(own.value)]
    return Verdict.UNKNOWN if loose else Verdict.SAME


def _difference(known: Sequence[Known | None]) -> float:
    first, last = known[0], known[-1]
    if first is None or last is None:
        return math.nan
    error = math.hypot(first.with_scatter, last.with_scatter)
    return (last.value - first.value) / error if 0.0 < error < math.inf else math.nan


def _of(known: Sequence[Known], kind: str) -> tuple[Floats, Floats]:
    """Return values and their weights by one kind of standard error."""
    return np.array([own.value for own in known]), 1.0 / np.array([getattr(own, kind) for own in known]) ** 2


def _homogeneity(known: Sequence[Known], kind: str) -> float:
    """Return the probability of such differences if all values are the same."""
    values, weights = _of(known, kind)
    away = values - float(weights @ values) / float(np.sum(weights))
    return float(chi2.sf(weights @ away**2, values.size - 1))


def _slope(known: Sequence[Known], along: Sequence[float]) -> tuple[float, float, float] | None:
    """Return the slope of a weighted regression of several values, its standard error and the probability by chance."""
    values, weights = _of(known, "with_scatter")
    x = np.array(along) - float(weights @ np.array(along)) / float(np.sum(weights))
    size = float(weights @ x**2)
    if values.size < 3 or size == 0.0:
        return None
    slope = float(weights @ (x * values)) / size
    error = 1.0 / math.sqrt(size)
    return slope, error, float(2.0 * norm.sf(abs(slope) / error))


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

"""How is a comparison written: `comparison.json`, and `comparison.csv` with one row per model, record and quantity?"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from typing import Any

from rigsight.compare import QUANTITIES, Column, Comparison
from rigsight.compare.comparison import best
from rigsight.json_data import json_data

SCHEMA_VERSION = 1
_HEAD = (
    "model", "record", "role", "kind", "amplitude", "signal", "quantity", "unit", "value",
    "noise_floor", "n_values", "best", "problem",
)  # fmt: skip


def comparison_json(comparison: Comparison, figures: Mapping[str, str]) -> dict[str, Any]:
    """Return the content of ``comparison.json``."""
    overall = comparison.overall()
    content = {
        "schema_version": SCHEMA_VERSION,
        "title": comparison.title,
        "rig": comparison.rig,
        "method": comparison.method,
        "step_seconds": comparison.step_seconds,
        "window_length": comparison.window_length,
        "quantities": QUANTITIES,
        "models": [
            {"name": c.name, "source": c.source, "model": c.model.to_json()} for c in comparison.competitors
        ],
        "records": [
            {
                "name": r.record.name,
                "role": r.record.role,
                "kind": r.record.kind,
                "amplitude": r.record.amplitude,
                "notes": r.notes,
            }
            for r in comparison.records
        ],
        "noise_floors": [
            {
                "output": f.output,
                "unit": f.unit,
                "std": f.std,
                "method": f.method,
                "lower_bound": f.lower_bound,
            }
            for f in comparison.floors
        ],
        "scores": [
            {
                "model": s.model,
                "record": s.record,
                **_column(s.column),
                "value": s.value,
                "noise_floor": s.noise_floor,
                "n_values": s.n_values,
            }
            for s in comparison.scores
        ],
        "overall": [
            {
                "model": model,
                **_column(column),
                "value": row[column],
                "noise_floor": comparison.floor(column),
                "best": model in best(overall, column),
            }
            for model, row in overall.items()
            for column in row
        ],
        "failures": [
            {
                "model": f.model,
                "record": f.record,
                **_column(f.column),
                "reason": f.reason,
            }
            for f in comparison.failures
        ],
        "notes": comparison.notes,
        "figures": figures,
    }
    return json_data(content)


def comparison_csv(comparison: Comparison) -> str:
    """Return the content of ``comparison.csv``: SI units, an empty value with its problem where a model failed."""
    file = io.StringIO()
    table = csv.writer(file, lineterminator="\n")
    table.writerow(_HEAD)
    for own in comparison.records:
        record = own.record
        facts = (record.name, record.role, record.kind, "" if record.amplitude is None else record.amplitude)
        rows = comparison.table(record.name)
        winners = {column: best(rows, column) for column in comparison.columns(record.name)}
        for s in own.scores:
            floor = "" if s.noise_floor is None else f"{s.noise_floor:.9g}"
            first = "yes" if s.model in winners[s.column] else "no"
            reported = (f"{s.value:.9g}", floor, s.n_values, first, "")
            table.writerow((s.model, *facts, s.column.signal, s.column.quantity, s.column.unit, *reported))
        for f in own.failures:
            missing = [f.column] if f.column else comparison.columns(record.name)
            for column in missing or (None,):
                named = ("", "", "") if column is None else (column.signal, column.quantity, column.unit)
                table.writerow((f.model, *facts, *named, "", "", "", "no", " ".join(f.reason.split())))
    return file.getvalue()


def _column(column: Column | None) -> dict[str, str]:
    if column is None:
        return {}
    return {"signal": column.signal, "quantity": column.quantity, "unit": column.unit}

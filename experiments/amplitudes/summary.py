"""Summary table of all comparisons, and its conclusions."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping
from pathlib import Path

Errors = dict[tuple[str, str], dict[str, float]]
"""(signal, quantity) -> record -> error."""
Failures = dict[tuple[str, str], list[str]]
"""(model, what went wrong) -> records."""

_LABELS = {"identify": "linear", "calibrate": "Bouc-Wen", "discover": "discovered"}
_SHOWN = {
    ("u -> psi", "magnitude_db"): ("dB", "Magnitude u -> psi: RMS error in dB on sweeps", "sweep", "{:.2f}", 1.0),
    ("u -> psi", "phase_rmse"): ("phase", "Phase u -> psi: RMSE (5.1) in rad on sweeps", "sweep", "{:.3f}", 1.0),
    ("u -> psi", "magnitude_rmse"): (
        "magnitude", "Magnitude u -> psi: RMSE (5.1) in 1e-3 rad/A on sweeps", "sweep", "{:.2f}", 1e3
    ),
    ("psi", "step_rmse"): ("step", "Step, psi: RMSE in 1e-3 rad over 4 s", "step", "{:.3f}", 1e3),
    ("psi", "free_run_nrmse"): ("free run", "Free run, psi: NRMSE in % on sweeps", "sweep", "{:.1f}", 100.0),
}  # fmt: skip


def read_errors(out: Path) -> tuple[dict[str, Errors], Errors, Failures]:
    """Return errors by model, noise floors and failures from all comparisons that are finished; the joint config first."""
    models: dict[str, Errors] = {}
    floors: Errors = {}
    failures: Failures = {}
    for file in sorted(out.glob("*/compare/comparison.csv"), key=_order):
        config = file.parents[1].name
        with file.open(encoding="utf-8", newline="") as stream:
            for row in csv.DictReader(stream):
                label = row["model"]
                if label in _LABELS:
                    label = f"{_LABELS[label]}, {config.replace('_', ' ')}"
                if not row["value"]:
                    records = failures.setdefault((label, row["problem"]), [])
                    records += [row["record"]] if row["record"] not in records else []
                    continue
                key = (row["signal"], row["quantity"])
                models.setdefault(label, {}).setdefault(key, {})[row["record"]] = float(row["value"])
                if row["noise_floor"]:
                    floors.setdefault(key, {})[row["record"]] = float(row["noise_floor"])
    return models, floors, failures


def _order(file: Path) -> tuple[bool, str, float]:
    kind, _, number = file.parents[1].name.partition("_")
    return kind != "joint", kind, float(number) if number.replace(".", "").isdigit() else 0.0


def summary_text(out: Path) -> str:
    """Return the tables as Markdown; bold is what prints as the best of its column, the truth itself left out."""
    models, floors, failures = read_errors(out)
    if not models:
        return "Nothing was compared.\n"
    blocks = ["\n".join(_table(models, floors, key)) for key in _SHOWN]
    told = [
        f"- '{model}' failed on {', '.join(records)}: {problem}"
        for (model, problem), records in failures.items()
    ]
    return "\n\n".join([*blocks, "\n".join([*told, *_sentences(models)])]).rstrip() + "\n"


def _table(models: Mapping[str, Errors], floors: Errors, key: tuple[str, str]) -> Iterator[str]:
    _, title, kind, form, factor = _SHOWN[key]
    records = sorted({r for errors in models.values() for r in errors.get(key, {}) if r.startswith(kind)})
    heads = [record.removeprefix(f"{kind}_").replace("A", " A") for record in records]
    yield f"**{title}**\n"
    yield f"| model | {' | '.join(heads)} |"
    yield f"|---{'|---:' * len(heads)}|"
    rivals = [name for name in models if name != "iwan_tables"]
    best = {
        r: form.format(
            factor * min((models[n][key][r] for n in rivals if r in models[n].get(key, {})), default=0.0)
        )
        for r in records
    }
    for name in [*rivals, *(n for n in models if n == "iwan_tables")]:
        errors = models[name].get(key, {})
        cells = [form.format(factor * errors[r]) if r in errors else "failed" for r in records]
        bold = [
            f"**{c}**" if name in rivals and c == best[r] else c for r, c in zip(records, cells, strict=True)
        ]
        yield f"| {'iwan_tables (the truth)' if name == 'iwan_tables' else name} | {' | '.join(bold)} |"
    known = floors.get(key, {})
    yield f"| noise floor | {' | '.join(form.format(factor * known[r]) if r in known else '-' for r in records)} |"


def _sentences(models: Mapping[str, Errors]) -> Iterator[str]:
    """Say where the joint discovered model is beaten: by the joint linear one, or by a set of the thesis."""
    joint = next((name for name in ("discovered, joint", "Bouc-Wen, joint") if name in models), None)
    if joint is None:
        return
    for rival in ("linear, joint", "identified", "hysteresis_r", "hysteresis_b", "hysteresis_p"):
        lost = []
        for key, (short, _, kind, _, _) in _SHOWN.items():
            own, other = models[joint].get(key, {}), models.get(rival, {}).get(key, {})
            places = [r for r in other if r.startswith(kind) and other[r] <= own.get(r, float("inf"))]
            if places:
                lost.append(f"{short} ({', '.join(r.removeprefix(f'{kind}_') for r in places)})")
        told = (
            f"is better than '{joint}' in {', '.join(lost)}" if lost else f"is nowhere better than '{joint}'"
        )
        yield f"- '{rival}' {told}."

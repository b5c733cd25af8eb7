"""A quick campaign on disk, one change for every key of a campaign file, and what each command makes of a campaign."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rigsight.campaign import Campaign
from rigsight.compare.comparison import comparison_json
from rigsight.records import Record
from rigsight.rigs import rig_file_text
from rigsight.workflow.campaign.in_memory import make_model
from rigsight.workflow.compare import compare_campaign, named_competitors
from rigsight.workflow.diagnose import diagnose_campaign
from rigsight.workflow.discover import discover_campaign
from rigsight.workflow.identification.json import identification_json
from rigsight.workflow.identify import checked_options, identify_campaign
from rigsight.workflow.simulate import simulate_model

Tables = dict[str, Any]
Change = Callable[[Tables, Path], None]

DT, N_SAMPLES = 0.01, 240
TRUTH = {"m": 2.0, "d": 12.0, "k": 800.0}
BASE: Tables = {
    "title": "keys",
    "offsets": "shared",
    "rig": {"model": "axis", "effects": [], "constants": {"gain": 1.0}, "parameters": {**TRUTH, "d": 10.0}},
    "records": [
        {"file": "fit.csv", "role": "estimation", "kind": "multisine"},
        {"file": "step.csv", "role": "validation", "kind": "step", "amplitude": 3.0},
    ],
}
COMMANDS: dict[str, Callable[[Campaign], Mapping[str, Any]]] = {
    "identify": lambda c: identification_json(
        identify_campaign(c, checked_options("local_rational", None)), {}
    ),
    "discover": lambda c: discover_campaign(c).to_json(),
    "compare": lambda c: comparison_json(compare_campaign(c, named_competitors(["given"], c)), {}),
    "diagnose": lambda c: diagnose_campaign(c, []).to_json(),
}


def write_records(folder: Path) -> None:
    """Write a multisine and a step of an axis with a sensor offset, and the first once more in other formats."""
    rng = np.random.default_rng(0)
    t = DT * np.arange(N_SAMPLES)
    tones = sum(np.sin(2 * np.pi * k * t / t[-1] + rng.uniform(0, 6.28)) for k in range(1, 25))
    model = make_model("axis", {**TRUTH, "x_off": 1e-3})
    for name, u in (("fit", np.asarray(tones)), ("step", np.where(t > 0.3, 3.0, 0.0))):
        driven = Record(name, DT, {"u": u}, {"u": "N"})
        x = simulate_model(model, driven)["x"] + 1e-5 * rng.normal(size=t.size)
        rows = np.column_stack([t, u, x])
        np.savetxt(folder / f"{name}.csv", rows, delimiter=",", header="t,u,x", comments="", fmt="%.9g")
    (folder / "other.csv").write_text((folder / "step.csv").read_text())


def toml_text(tables: Tables) -> str:
    """Return tables as TOML; everything below the first level is inline."""
    lines = []
    for key, value in tables.items():
        if key == "records":
            lines += [f"[[records]]\n{_pairs(record)}" for record in value]
        elif isinstance(value, dict):
            lines.append(f"[{key}]\n{_pairs(value)}")
        else:
            lines.append(f"{key} = {_value(value)}")
    return "\n".join(lines)


def _pairs(table: Tables) -> str:
    return "".join(f"{key} = {_value(value)}\n" for key, value in table.items())


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {_value(own)}" for key, own in value.items()) + "}"
    return json.dumps(value)


def written(folder: Path, *changes: Change) -> Path:
    """Write the campaign after some changes, with its records, and return its file."""
    folder.mkdir(parents=True, exist_ok=True)
    write_records(folder)
    tables = copy.deepcopy(BASE)
    for change in changes:
        change(tables, folder)
    (folder / "campaign.toml").write_text(toml_text(tables), encoding="utf-8")
    return folder / "campaign.toml"


def of_rig(**values: Any) -> Change:
    return lambda tables, _: tables["rig"].update(values)


def of_fitted(**values: Any) -> Change:
    return lambda tables, _: tables["records"][0].update(values)


def of_scored(**values: Any) -> Change:
    return lambda tables, _: tables["records"][1].update(values)


def of_x(**values: Any) -> Change:
    return of_fitted(columns={"x": {"name": "x", **values}})


def in_text(old: str, new: str) -> Change:
    """Change the text of the fitted record."""

    def change(_: Tables, folder: Path) -> None:
        file = folder / "fit.csv"
        file.write_text(file.read_text().replace(old, new))

    return change


def with_later_times(_: Tables, folder: Path) -> None:
    """Add a column of times that are a tenth of a sample later to the fitted record."""
    rewritten(folder, "t,u,x,later", lambda t, u, x: (t, u, x, t + 0.1 * DT))


def with_a_counter(_: Tables, folder: Path) -> None:
    """Let the displacement of the fitted record begin again at 0 beyond 10 mm."""
    rewritten(folder, "t,u,x", lambda t, u, x: (t, u, x % 0.01))


def rewritten(folder: Path, header: str, row: Callable[[float, float, float], tuple[float, ...]]) -> None:
    numbers = np.loadtxt(folder / "fit.csv", delimiter=",", skiprows=1)
    lines = [",".join(f"{value:.9g}" for value in row(*own)) for own in numbers.tolist()]
    (folder / "fit.csv").write_text("\n".join([header, *lines]) + "\n")


def with_friction(tables: Tables, _: Path) -> None:
    tables["rig"]["effects"] = ["coulomb_friction"]
    tables["rig"]["parameters"]["T_c"] = 0.1


def without_rig(tables: Tables, folder: Path) -> None:
    """Name no rig, and put the file of one beside the campaign."""
    del tables["rig"]["model"]
    (folder / "axis.toml").write_text(rig_file_text("axis"), encoding="utf-8")


def nothing(_: Tables, __: Path) -> None:
    """Leave the campaign as it is."""


CHANGES: dict[str, tuple[Change, Change]] = {
    "title": (nothing, lambda tables, _: tables.update(title="seven keys")),
    "offsets": (nothing, lambda tables, _: tables.update(offsets="per_record")),
    "rig.model": (without_rig, of_rig(model="axis")),
    "rig.file": (without_rig, of_rig(file="axis.toml")),
    "rig.simulator": (nothing, of_rig(simulator="mujoco")),
    "rig.effects": (nothing, with_friction),
    "rig.constants": (nothing, of_rig(constants={"gain": 1.5})),
    "rig.parameters": (nothing, of_rig(parameters={**TRUTH, "d": 11.0})),
    "records.file": (nothing, of_scored(file="other.csv")),
    "records.name": (nothing, of_scored(name="scored seven")),
    "records.role": (nothing, of_scored(role="estimation")),
    "records.kind": (nothing, of_fitted(kind="operation")),
    "records.amplitude": (nothing, of_fitted(amplitude=2.4375)),
    "records.hold": (nothing, of_fitted(hold="zoh")),
    "records.dt": (in_text("t,u,x", "n,u,x"), of_fitted(dt=DT)),
    "records.resample": (nothing, of_fitted(resample=0.5 * DT)),
    "records.start": (nothing, of_fitted(start=0.3)),
    "records.end": (nothing, of_fitted(end=2.1)),
    "records.columns": (in_text("t,u,x", "t,u,travel"), of_fitted(columns={"x": "travel"})),
    "records.separator": (in_text(",", "~"), of_fitted(separator="~")),
    "records.decimal": (nothing, of_fitted(decimal=",")),
    "records.header": (nothing, of_fitted(header=False)),
    "records.comment": (in_text("t,u,x\n", "t,u,x\n! noted\n"), of_fitted(comment="!")),
    "records.constants": (nothing, of_fitted(constants={"gain": 1.2})),
    "records.inputs": (of_fitted(kind="operation"), of_fitted(inputs={"u": 1.0})),
    "columns.name": (in_text("t,u,x", "t,u,travel"), of_fitted(columns={"x": {"name": "travel"}})),
    "columns.scale": (nothing, of_x(scale=2.0)),
    "columns.offset": (nothing, of_x(offset=1.0)),
    "columns.unit": (nothing, of_x(unit="mm")),
    "columns.unwrap": (with_a_counter, of_x(unwrap=0.01)),
    "columns.time": (with_later_times, of_x(time="later")),
    "columns.file": (nothing, of_x(file="other.csv")),
}
"""By key: the campaign in which it matters, and how it is given there."""
TOLD = {
    "title": "seven keys",
    "records.name": "scored seven",
    "records.kind": "operation",
    "records.amplitude": "2.4375",
}
"""Keys whose values results repeat: they are given together, to run each command once for all of them."""

"""Every key of a rig file becomes part of the rig or is refused, as docs/keys.md says: none is ignored."""

from __future__ import annotations

import copy
from dataclasses import fields
from pathlib import Path
from typing import Any, get_args, get_origin

import pytest
from pydantic import BaseModel

from rigsight.errors import InputError
from rigsight.rigs.reading.declaration import RigTable, SimulatorTable
from rigsight.rigs.reading.rig_file import rig_of_tables
from rigsight.simulators import Bodies

Tables = dict[str, Any]

PAGE = (Path(__file__).parents[2] / "docs/keys.md").read_text(encoding="utf-8")
BASE: Tables = {
    "name": "stage",
    "inputs": {"u": {"unit": "V"}, "y": {"unit": "m"}},
    "constants": {"g": {"unit": "N/V"}},
    "parameters": {
        "m": {"unit": "kg"},
        "n": {"unit": "kg"},
        "d": {"unit": "N s/m"},
        "k": {"unit": "N/m"},
        "f": {"unit": "rad/s"},
    },
    "alternatives": {"a": {"unit": "kg", "gives": "m", "value": "a"}},
    "coordinates": {"x": {"unit": "m"}},
    "energy": {"kinetic": "(m + n)*d(x)^2/2"},
    "joints": {"guide": {"motion": "x", "stiffness": "k", "damping": "d"}},
    "drives": {"coil": {"signal": "v", "force": "g*coil", "along": "x"}},
    "sensors": {"travel": {"reads": "x", "unit": "m"}, "lag": {"reads": "x - y", "unit": "m"}},
    "states": {"w": {"rate": "f*(u - w)", "unit": "V"}},
    "signals": {"v": "w"},
}
SIMULATED: Tables = {
    **{key: value for key, value in BASE.items() if key != "energy"},
    "simulator": {"kind": "fmu", "file": "a.fmu", "digest": "0", "parameters": {"m": "mass", "n": "load"}},
}
USED: dict[str, Any] = {
    "name": "other",
    "summary": "A stage.",
    "inputs.u.about": "voltage",
    "inputs.u.unit": "kV",
    "constants.g.about": "gain",
    "constants.g.unit": "mN/V",
    "constants.g.lower": 0.0,
    "constants.g.upper": 9.0,
    "constants.g.default": 2.0,
    "parameters.m.about": "mass",
    "parameters.m.unit": "g",
    "parameters.m.lower": 0.0,
    "parameters.m.upper": 9.0,
    "parameters.m.default": 2.0,
    "parameters.m.log": True,
    "alternatives.a.about": "mass again",
    "alternatives.a.unit": "g",
    "alternatives.a.lower": 0.0,
    "alternatives.a.upper": 9.0,
    "alternatives.a.gives": "n",
    "alternatives.a.value": "2*a",
    "coordinates.x.about": "travel",
    "coordinates.x.unit": "mm",
    "coordinates.x.prescribed_by": "y",
    "coordinates.x.rate": "speed",
    "energy.kinetic": "(m + n)*d(x)^2",
    "energy.potential": "k*x^2",
    "joints.guide.motion": "2*x",
    "joints.guide.stiffness": "2*k",
    "joints.guide.damping": "2*d",
    "joints.guide.rest": 0.1,
    "joints.guide.force": 0.1,
    "joints.guide.inertia": "m",
    "joints.guide.damps_spring": True,
    "joints.guide.about": "guide",
    "drives.coil.signal": "2*v",
    "drives.coil.force": "2*g*coil",
    "drives.coil.along": "2*x",
    "drives.coil.about": "coil",
    "sensors.travel.reads": "2*x",
    "sensors.travel.unit": "mm",
    "sensors.travel.about": "scale",
    "sensors.travel.upper_cut": 80.0,
    "states.w.rate": "2*f*(u - w)",
    "states.w.unit": "kV",
    "states.w.start": 0.1,
    "states.w.about": "filter",
    "signals": {"v": "2*w"},
    "initial": {"x": 0.1},
    "simulator.kind": "python",
    "simulator.file": "b.fmu",
    "simulator.digest": "1",
    "simulator.step": 0.001,
    "simulator.coordinates": {"x": "slide"},
    "simulator.parameters": {"m": "mass", "n": "other"},
    "simulator.rates": {"x": "der(x)"},
    "simulator.forces": {"x": "force"},
}
CHECKED = ("unit", "prescribed_by", "kind")
"""Keys that a check of the whole rig reads: one such key that does not fit the others is refused."""
REFUSED: dict[str, Any] = {
    "alternatives.a.default": 1.0,
    "simulator.without_armature": True,
    "simulator.states": {"w": "base 0"},
}


def _keys(table: type[BaseModel], prefix: str = "") -> list[str]:
    found = []
    for name, field in table.model_fields.items():
        kind = field.annotation
        if get_origin(kind) is dict:
            kind = get_args(kind)[1]
        if name == "simulator":
            kind = SimulatorTable
        inner = isinstance(kind, type) and issubclass(kind, BaseModel)
        found += _keys(kind, f"{prefix}{name}.") if inner else [prefix + name]
    return found


def _without_names(key: str) -> str:
    parts = key.split(".")
    return f"{parts[0]}.{parts[-1]}" if len(parts) > 1 else key


def _read(tables: Tables, key: str = "", value: Any = None) -> str:
    """Return everything that the rig holds but its text."""
    tables = copy.deepcopy(tables)
    *path, last = key.split(".")
    inner = tables
    for part in path:
        inner = inner.setdefault(part, {})
    if last:
        inner[last] = value
    try:
        rig = rig_of_tables(tables, "rig")
    except InputError as refused:
        return f"REFUSED {refused}"
    return repr([getattr(rig, f.name) for f in fields(rig) if f.name != "declaration"])


def test_every_key_of_a_rig_file_is_in_the_table() -> None:
    table = PAGE.split("## Keys of a rig file\n")[1].split("\n## ")[0]
    rows = {
        line.split("`")[1]: line.split("|")[2].strip() for line in table.split("\n") if line.startswith("| `")
    }
    reported = {key.removesuffix(" *"): cell for key, cell in rows.items()}
    remedy = "add a row to 'Keys of a rig file' in docs/keys.md and a line to USED or REFUSED here"
    assert set(reported) == set(_keys(RigTable)), remedy
    expected = {_without_names(key): "used" for key in USED} | {
        _without_names(key): "refused" for key in REFUSED
    }
    assert reported == expected, remedy


@pytest.mark.parametrize("key", [*USED, *REFUSED])
def test_a_key_of_a_rig_file_is_used_or_refused(key: str, monkeypatch: pytest.MonkeyPatch) -> None:
    # Whether the program's model has such names is not asked here.
    monkeypatch.setattr(Bodies, "program", None)
    base = SIMULATED if key.startswith("simulator.") else BASE
    without, given = _read(base), _read(base, key, {**USED, **REFUSED}[key])
    assert not without.startswith("REFUSED"), without
    assert given.startswith("REFUSED") == (key in REFUSED) or key.endswith(CHECKED), given
    assert given != without

"""Where causes are added to measured records: what the motion and the sensors of a rig allow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rigsight.effects import effect_named, family_of, placed
from rigsight.records import Record
from rigsight.rigs import ELEMENT
from rigsight.rigs.reading.rig_file import rig_of_tables
from rigsight.simulate import compose, simulate
from rigsight.workflow.campaign.in_memory import make_campaign
from rigsight_bench.trials.measured.base import base_of
from rigsight_bench.trials.measured.spike import spiked
from rigsight_bench.trials.measured.spots import spots


def test_no_cause_over_a_position_is_added_where_none_is_known() -> None:
    tables = {
        "name": "wheel",
        "inputs": {"u": {"unit": "1"}},
        "parameters": {"J": {"unit": "kg m^2", "log": True}, "b": {"unit": "N m s/rad", "lower": 0.0}},
        "constants": {"k_t": {"unit": "N m", "default": 1.0}},
        "coordinates": {"q": {"unit": "rad"}},
        "energy": {"kinetic": "J*d(q)^2/2"},
        "joints": {"bearing": {"motion": "q", "damping": "b"}},
        "drives": {"motor": {"signal": "u", "force": "k_t*motor", "along": "q"}},
        "sensors": {"speed": {"reads": "d(q)", "unit": "rad/s"}},
    }
    rig, rng, values = rig_of_tables(tables, "wheel"), np.random.default_rng(5), {"J": 0.01, "b": 0.04}
    steps = [np.repeat(rng.uniform(0.2, 1.0, 8), 250) for _ in range(2)]
    records = [
        Record(f"r{n}", 0.01, {"u": u}, {"u": "1"}, role=("estimation", "validation")[n])
        for n, u in enumerate(steps)
    ]
    noise = 0.01 * rng.standard_normal(2000)
    records = [r.with_signals(speed=simulate(compose(rig), values, r)["speed"] + noise) for r in records]
    families = {family_of(s.effect.name) for s in spots(base_of(make_campaign(rig, records)))}
    assert "dry_friction" in families
    assert not families & {"spring_law", "gravity", "play_and_stops"}


def test_a_force_is_read_where_the_motion_is_prescribed() -> None:
    rng = np.random.default_rng(3)
    t = 0.002 * np.arange(4000)
    structure, values = compose(ELEMENT), {"d": 20.0, "k": 500.0, "force_off": 1.0}
    records = []
    for number, size in enumerate((0.01, 0.02, 0.015)):
        x = size * (np.sin(9.0 * t) + 0.5 * np.sin(23.0 * t + number))
        record = Record(
            f"r{number}", 0.002, {"x": x}, {"x": "m"}, role="validation" if number == 2 else "estimation"
        )
        force = simulate(structure, values, record)["force"]
        records.append(record.with_signals(force=force + rng.normal(scale=0.01, size=t.size)))
    base = base_of(make_campaign("element", records))
    offered = {spot.effect.name: spot for spot in spots(base)}
    name = "maxwell_branch" if base.modelled else "presliding_friction"
    spot, own = offered[name], {"k_m": 100.0, "tau_m": 0.1} if base.modelled else {"T_c": 2.0, "x_p": 1e-3}
    changed = spiked(base, spot, own, records[0])
    there = simulate(compose(base.rig, [spot.effect]), {**values, **own}, records[0])
    assert spot.way == "force_in_reading"
    assert np.std(changed["force"] - there["force"]) < 0.03


def test_a_joint_behind_a_gear_is_reached_through_it() -> None:
    tables = {
        "name": "geared",
        "summary": "A motor turns an arm through a gear.",
        "inputs": {"i": {"unit": "A"}},
        "constants": {"k_t": {"unit": "N m/A", "default": 0.1}},
        "parameters": {
            "J": {"unit": "kg m^2", "log": True, "lower": 1e-9},
            "b": {"unit": "N m s/rad", "lower": 0.0},
        },
        "coordinates": {"q": {"unit": "rad"}},
        "energy": {"kinetic": "J*d(q)^2/2"},
        "joints": {"arm": {"motion": "q/50", "damping": "b"}},
        "drives": {"motor": {"signal": "i", "force": "k_t*motor", "along": "q"}},
        "sensors": {"angle": {"reads": "q", "unit": "rad"}},
    }
    rig, t = rig_of_tables(tables, "geared"), 0.002 * np.arange(4000)
    values = {"k_t": 0.1, "J": 1e-3, "b": 20.0}
    currents = [np.sin(8.0 * t + n) + np.sin(3.0 * t) for n in range(2)]
    records = [
        Record(f"r{n}", 0.002, {"i": i}, {"i": "A"}, role=("estimation", "validation")[n])
        for n, i in enumerate(currents)
    ]
    records = [r.with_signals(angle=simulate(compose(rig), values, r)["angle"]) for r in records]
    base = replace(
        base_of(make_campaign(rig, records, parameters={"J": 2e-3, "b": 10.0})), values=values, modelled=()
    )
    spot = next(
        s
        for s in spots(base)
        if s.effect.name == "coulomb_friction@arm" or s.effect.name == "coulomb_friction"
    )
    changed = spiked(base, spot, {"T_c": 1.0}, records[0])
    structure = compose(rig, [placed(effect_named("coulomb_friction"), "arm")])
    there = simulate(structure, {**values, "T_c": 1.0}, changed)
    assert spot.place == "arm"
    assert np.max(np.abs(changed["i"] - records[0]["i"])) == pytest.approx(1.0 / 50.0 / 0.1, rel=1e-6)
    assert np.std(there["angle"] - records[0]["angle"]) < 0.02 * np.std(records[0]["angle"])

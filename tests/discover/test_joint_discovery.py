"""Does a discovery on a rig of several joints complete its equations at the right place, with honest numbers?"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest

from rigsight.campaign import Campaign
from rigsight.discover.discovery import discover
from rigsight.discover.records import DiscoveryData
from rigsight.discover.result import Discovery
from rigsight.effects import effect_named, kind_of, placed
from rigsight.plot import svg_text
from rigsight.plot.fitted_numbers import discovery_figure
from rigsight.records.record import Record
from rigsight.report.terminal import discovery_rows
from rigsight.rigs import Rig
from rigsight.simulate import compose, simulate

pytestmark = pytest.mark.slow

DT, SECONDS = 5e-3, 4.0
T = DT * np.arange(round(SECONDS / DT))
TRAIN = {"J_m": 1e-4, "J_l": 5e-4, "k_s": 2.0, "d_s": 1e-3, "d_m": 1e-3, "d_l": 1e-3, "k_l": 0.5}
DAMPING = 1e-4
Z_MAX = 4.5
"""Standard errors by which an estimate may be off: one in 10^5 by chance."""


DRAG = ("quadratic_damping@motor_bearing",)


def campaign(rig: Rig, values: Mapping[str, float], effects: Sequence[str] = DRAG) -> DiscoveryData:
    structure = compose(
        rig, [placed(effect_named(kind_of(name)), name.partition("@")[2]) for name in effects]
    )
    rng = np.random.default_rng(0)
    runs = []
    for i, (amplitude, role) in enumerate(((0.8, "estimation"), (1.5, "estimation"), (1.1, "validation"))):
        u = amplitude * np.sin(i + 2.0 * np.pi * (0.5 * T + (0.8 if i < 2 else 0.5) * T**2))
        runs.append(
            simulate(
                structure, values, Record(f"run {i}", DT, {"u": u}, {}, hold="foh", role=role), accuracy=1e-6
            )  # type: ignore[arg-type]
        )
    noise = {s.name: 1e-3 * max(float(np.std(r[s.name])) for r in runs) for s in rig.outputs}
    noisy = tuple(
        r.with_signals(**{n: r[n] + rng.normal(scale=std, size=r.n_samples) for n, std in noise.items()})
        for r in runs
    )
    return DiscoveryData(Campaign("train", rig, {"k_t": 0.05}, {}, noisy), noise)


@pytest.fixture(scope="module")
def found(drive_train: Rig) -> Discovery:
    return discover(campaign(drive_train, {**TRAIN, "k_t": 0.05, "c_2": DAMPING}))


@pytest.mark.slow
def test_the_law_stands_in_the_equations_at_its_joint(found: Discovery) -> None:
    (term,) = found.kept
    assert (term.name, term.where) == ("quadratic_damping", "motor_bearing")
    assert term.inclusion > 0.9
    assert any("c_2" in equation for equation in found.equations)
    assert found.held_out_error < 1.1


@pytest.mark.slow
def test_its_numbers_are_as_far_off_as_they_say(found: Discovery) -> None:
    numbers = {**found.rig_parameters, **found.kept[0].coefficients}
    for name, value in {**TRAIN, "c_2": DAMPING}.items():
        assert abs(numbers[name].value - value) < Z_MAX * numbers[name].std, name
    assert numbers["c_2"].value == pytest.approx(DAMPING, rel=0.02)


@pytest.mark.slow
def test_results_say_where(found: Discovery) -> None:
    content = json.loads(json.dumps(found.to_json()))
    assert content["terms"][0]["where"] == "motor_bearing"
    first, *others = content["joints"]
    assert first["where"] == "motor_bearing"
    assert {other["where"] for other in others} == {"shaft", "load_bearing"}
    assert found.model["effects"] == ["quadratic_damping@motor_bearing"]
    assert {run.output for run in found.runs} == {"motor_angle", "load_angle"}
    subjects = [subject for subject, _ in discovery_rows(found)]
    assert "quadratic_damping at motor_bearing" in subjects
    assert "missing at motor_bearing" in subjects
    assert "Missing at motor bearing" in svg_text(discovery_figure(found), "discovery.svg")
    assert {own["record"] for own in content["held_out"]["by_record"]} == {"run 2"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effects", "values"),
    [
        (("cubic_stiffness@load_bearing", *DRAG), {"c_2": DAMPING, "k_3": 0.3}),
        (
            ("bouc_wen_hysteresis@load_bearing",),
            {"k_l": 1.0, "a": 0.3, "A": 1.0, "beta": 2.0, "gamma": 1.0, "n": 1.0},
        ),
    ],
    ids=["at two joints", "with memory"],
)
def test_further_laws_are_found_at_their_joints(
    drive_train: Rig, effects: tuple[str, ...], values: dict[str, float]
) -> None:
    values = {**TRAIN, "k_t": 0.05, **values}
    found = discover(campaign(drive_train, values, effects))
    assert {f"{term.name}@{term.where}" for term in found.kept} == {*effects}
    assert found.held_out_error < 1.1
    for term in found.kept:
        for name, coefficient in term.coefficients.items():
            assert abs(coefficient.value - values[name]) < Z_MAX * coefficient.std, name


def test_where_a_sensor_is_missing_every_term_is_tried_by_a_fit(drive_train: Rig) -> None:
    data = campaign(drive_train, {**TRAIN, "k_t": 0.05, "c_2": DAMPING})
    hidden = tuple(
        replace(record, signals={name: record[name] for name in ("u", "load_angle")})
        for record in data.records
    )
    found = discover(DiscoveryData(replace(data.campaign, records=hidden), data.noise))
    assert [(term.name, term.where) for term in found.kept] == [("quadratic_damping", "motor_bearing")]
    assert found.joints == ()
    assert found.kept[0].inclusion is None

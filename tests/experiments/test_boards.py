"""The rigs of the boards, on records of the same equations that are integrated here."""

from __future__ import annotations

import json
from argparse import Namespace
from pathlib import Path

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.records.record import Floats

from .studies import of_study

RUN = of_study("boards", "run")
FINE = 40


def drives(u: Floats, dt: float) -> Floats:
    """Return the magnitude of the speed of a pulley that a motor drives by a belt."""
    inertia_m, inertia_p, k, d_b, d_m = 0.12, 0.03, 12.0, 0.12, 0.35
    motor = pulley = twist = 0.0
    shown = []
    for voltage in u:
        shown.append(abs(pulley))
        for _ in range(FINE):
            belt = k * twist + d_b * (motor - pulley)
            motor += dt / FINE * (voltage - belt - d_m * motor) / inertia_m
            pulley += dt / FINE * belt / inertia_p
            twist += dt / FINE * (motor - pulley)
    return np.array(shown)


def tanks(u: Floats, dt: float) -> Floats:
    """Return the level of the lower of two tanks, both of which spill at times."""
    upper, lower, shown = 5.0, 4.0, []
    for voltage in u:
        shown.append(lower)
        for _ in range(FINE):
            between, over = 0.32 * np.sqrt(max(upper, 0.0) / 10.0), max(upper - 9.0, 0.0)
            out = 0.3 * np.sqrt(max(lower, 0.0) / 10.0) + max(lower - 9.5, 0.0)
            upper += dt / FINE * (0.075 * voltage - between - over)
            lower += dt / FINE * (between + 0.7 * over - out)
    return np.array(shown)


def written(file: Path, dt: float, u: Floats, y: Floats) -> Path:
    table = np.c_[dt * np.arange(u.size), u, y]
    np.savetxt(file, table, delimiter=",", header="t,u,y", comments="")
    return file


def told(board: str, folder: Path, records: list[Path], test: list[Path] | None) -> Namespace:
    return Namespace(
        board=board, data=None, records=records, validation=None, test=test, judge=False, out=folder
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("board", "plant", "dt", "levels", "noise", "numbers"),
    [
        ("coupled_drives", drives, 0.02, (-2.0, 2.0), 0.01, {"J_m": 0.12, "k": 12.0, "d_m": 0.35, "r": 1.0}),
        (
            "cascaded_tanks",
            tanks,
            4.0,
            (0.5, 6.5),
            0.02,
            {"k_u": 0.075, "k_1": 0.32, "rim": 9.0, "share": 0.7},
        ),
    ],
)
def test_a_board_finds_its_numbers_and_predicts_what_follows(
    board: str, plant: object, dt: float, levels: tuple[float, float], noise: float,
    numbers: dict[str, float], tmp_path: Path,
) -> None:  # fmt: skip
    assert callable(plant)
    rng = np.random.default_rng(0)
    u = np.repeat(rng.uniform(*levels, 160), 5)
    y = plant(u, dt) + rng.normal(scale=noise, size=u.size)
    # The test begins amid the motion, so that its direction is known from the first samples alone.
    edge = 600
    train = written(tmp_path / "train.csv", dt, u[:edge], y[:edge])
    test = written(tmp_path / "test.csv", dt, u[edge:], y[edge:])
    RUN.run(told(board, tmp_path / "out", [train], [test]))
    found = json.loads((tmp_path / "out" / board / "result.json").read_text())
    assert found["test"]["test"] < 1.3 * noise
    for name, value in numbers.items():
        assert abs(found["numbers"][name] - value) < 0.1 * value, name
    with pytest.raises(InputError, match="final run"):
        RUN.run(told(board, tmp_path / "out", [train], [test]))


@pytest.mark.parametrize("text", ["", "t,u\n0,1\n1,2\n", "t,u,y\n0,a,1\n"])
def test_records_that_are_none_end_in_one_message(text: str, tmp_path: Path) -> None:
    file = tmp_path / "train.csv"
    file.write_text(text)
    with pytest.raises(InputError, match=r"train\.csv"):
        RUN.run(told("emps", tmp_path / "out", [file], None))
    assert not (tmp_path / "out").exists()

"""Measured files as other people's reports had them are read as what moved: the record follows from the equations of its rig."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import StateSpace, cont2discrete, dlsim

from rigsight.errors import InputError
from rigsight.records import Record
from rigsight.workflow.campaign.read_campaign import read_campaign

CASES = Path(__file__).parents[2] / "../shared/cases"
M, D, K = 2.0, 12.0, 800.0
J, DAMPING, K_T = 2e-4, 1e-3, 0.05
AXIS = StateSpace([[0.0, 1.0], [-K / M, -D / M]], [[0.0], [1.0 / M]], [[1.0, 0.0]], 0.0)
ROTOR = StateSpace([[0.0, 1.0], [0.0, -DAMPING / J]], [[0.0], [K_T / J]], [[1.0, 0.0]], 0.0)


def case(name: str) -> Path:
    if not CASES.is_dir():
        pytest.skip(f"the cases are not at {CASES}")
    return CASES / name


def error(record: Record, rig: StateSpace, output: str) -> float:
    """Error of the simulation from rest with the true parameters, relative to the motion and apart from a constant."""
    discrete = cont2discrete((rig.A, rig.B, rig.C, rig.D), record.dt)
    _, simulated, _ = dlsim(discrete, record["u"])
    left = record[output] - simulated[:, 0]
    return float(np.std(left) / np.std(record[output]))


@pytest.mark.parametrize(
    ("name", "rig", "output"),
    [
        ("hdf5_packed_integers", AXIS, "x"),
        ("units_in_second_header_row", AXIS, "x"),
        ("sensor_held_over_ten_rows", AXIS, "x"),
        ("mdf_invalid_channel", AXIS, "x"),
        ("angle_wraps", ROTOR, "phi"),
    ],
)
def test_the_record_is_what_moved(name: str, rig: StateSpace, output: str) -> None:
    for record in read_campaign(case(name)).records:
        assert error(record, rig, output) < 3e-4


def test_codes_are_told_with_both_of_their_lines(tmp_path: Path) -> None:
    folder = case("sentinel_values")
    with pytest.raises(InputError, match=r"column 'x': 9\.9e\+37 in lines 4002, 4003"):
        read_campaign(folder)
    for file in ("campaign.toml", "m9999.csv"):
        (tmp_path / file).write_text((folder / file).read_text().replace("e38.csv", "m9999.csv"))
    with pytest.raises(InputError, match=r"column 'x': -9999 in lines 4002, 4003"):
        read_campaign(tmp_path)

"""Records that cannot show everything: told in words, and the rest identified all the same."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.excitation import linear_sweep
from rigsight.workflow.identify import run_identify

from ..virtual_campaign import CONSTANTS, DT, TRUTH, Run, jump, sweep, write_campaign


@pytest.mark.slow
def test_a_record_that_never_drives_the_resonance_gives_its_numbers_by_its_free_motion(
    tmp_path: Path,
) -> None:
    t = DT * np.arange(8000)
    slow = Run("slow", linear_sweep(t, 0.5, 0.1, 1.5), "sweep", "estimation", 0.5)
    found = run_identify(write_campaign(tmp_path, [sweep("good", 0.5), slow]))
    (own,) = [r for r in found.records if r.record.name == "slow"]
    assert own.motion.fit is not None
    for name, (value, error) in own.estimates.items():
        assert abs(value - TRUTH[name]) < 4.0 * error, name
    assert found.joint.fit.fit.values["k_c"] == pytest.approx(81.0, rel=0.01)


def test_a_campaign_without_any_excitation_of_the_resonance_determines_no_inertia(tmp_path: Path) -> None:
    t = DT * np.arange(8000)
    slow = Run("slow", linear_sweep(t, 0.05, 0.1, 0.5), "sweep", "estimation", 0.05)
    found = run_identify(write_campaign(tmp_path, [slow]))
    assert found.identifiability is not None
    assert "k_c" in found.identifiability.determined
    assert "J_z" not in found.identifiability.determined


@pytest.mark.slow
def test_a_sweep_too_short_for_its_peak_is_told_where_the_method_needs_lines_within_it(
    tmp_path: Path,
) -> None:
    sharp = {**CONSTANTS, **TRUTH, "k_d": 0.05}
    campaign = write_campaign(tmp_path, [sweep("short", 0.1, seconds=20.0)], values=sharp)
    (reported,) = [w for w in run_identify(campaign, method="thesis").warnings if "wide (half power)" in w]
    assert "'short'" in reported
    assert "record at least" in reported
    # A form that is fitted to all lines together needs none there.
    found = run_identify(campaign)
    assert not any("wide (half power)" in warning for warning in found.warnings)
    value, error = found.records[0].estimates["k_d"]
    assert abs(value - 0.05) < 4.0 * error < 1e-3


def test_a_resolution_that_a_record_is_too_short_for_is_refused(tmp_path: Path) -> None:
    campaign = write_campaign(tmp_path / "c", [sweep("short", 0.5, seconds=10.0)])
    with pytest.raises(InputError, match=r"too short for a resolution of 0\.5 rad/s. Record at least"):
        run_identify(campaign, tmp_path / "out", resolution=0.5)
    assert not (tmp_path / "out").exists()


def test_a_dead_sensor_of_y_is_told_and_the_yaw_part_identified(tmp_path: Path) -> None:
    def die(name: str, signals: dict[str, np.ndarray]) -> None:
        signals["y"][:] = 0.001

    found = run_identify(write_campaign(tmp_path, [sweep("one", 0.5)], change=die))
    (record,) = found.records
    assert set(record.estimates) == {"J_z", "k_c", "k_d", "psi_off"}
    assert any("y never changes" in w for w in found.warnings)
    assert "l_0" not in found.joint.names


def test_records_without_y_leave_the_lateral_part_out(tmp_path: Path) -> None:
    def lack(name: str, signals: dict[str, np.ndarray]) -> None:
        del signals["y"]

    runs = [sweep("one", 0.5), jump("step", 0.5)]
    found = run_identify(write_campaign(tmp_path, runs, parameters="l_0 = 0.3\nc_y = 0.9", change=lack))
    assert found.joint.conicity is None
    assert set(found.joint.names) == {"J_z", "k_c", "k_d", "psi_off"}
    assert (found.model["parameters"]["l_0"], found.model["parameters"]["c_y"]) == (0.3, 0.9)
    assert any("no y" in w for w in found.warnings)
    assert any("not identified" in w for w in found.warnings)

"""The identification of rigs of every kind: an axis, an element, measured campaigns."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.excitation import linear_sweep, step
from rigsight.records import Record
from rigsight.rigs import AXIS, ELEMENT
from rigsight.workflow.campaign.in_memory import make_campaign
from rigsight.workflow.identify import checked_options, identify_campaign, run_identify

from ..virtual_campaign import DT, Run, write_campaign

AXIS_TRUTH = {"gain": -2.0, "m": 2.0, "d": 5.0, "k": 800.0, "x_off": 1e-3, "force_off": 0.0}


def test_an_axis_gives_mass_damping_and_stiffness_whatever_the_sign_of_its_drive(tmp_path: Path) -> None:
    t = DT * np.arange(6000)
    runs = [Run("one", linear_sweep(t, 2.0, 2.0, 60.0)), Run("step", step(t[:1600], 2.0, 1.0), "step")]
    found = run_identify(write_campaign(tmp_path, runs, AXIS, AXIS_TRUTH))
    for record in found.records:
        for name in ("m", "d", "k", "x_off"):
            value, error = record.estimates[name]
            assert abs(value - AXIS_TRUTH[name]) < 4.0 * error, (record.record.name, name)
    assert found.model["parameters"]["k"] == pytest.approx(800.0, rel=0.01)


def test_an_axis_without_a_spring_keeps_none_and_says_so(tmp_path: Path) -> None:
    t = DT * np.arange(6000)
    free = {"gain": 1.0, "m": 2.0, "d": 8.0, "k": 0.0, "x_off": 0.0, "force_off": 0.0}
    runs = [Run("one", linear_sweep(t, 4.0, 1.0, 40.0)), Run("two", linear_sweep(t, 2.0, 1.0, 40.0))]
    found = run_identify(write_campaign(tmp_path, runs, AXIS, free, "k = 0.0"))
    assert any("k = 0 is held in all fits" in w for w in found.warnings)
    for record in found.records:
        for name in ("m", "d"):
            value, error = record.estimates[name]
            assert abs(value - free[name]) < 4.0 * error, (record.record.name, name)
    assert found.model["parameters"]["k"] == 0.0
    assert found.model["parameters"]["m"] == pytest.approx(2.0, rel=0.01)


def test_an_element_shows_its_dynamic_stiffness(tmp_path: Path) -> None:
    t = DT * np.arange(4000)
    truth = {"d": 3.0, "k": 40.0, "force_off": 0.2}
    runs = [Run("one", linear_sweep(t, 0.01, 2.0, 30.0)), Run("two", linear_sweep(t, 0.02, 2.0, 30.0))]
    found = run_identify(write_campaign(tmp_path / "c", runs, ELEMENT, truth), tmp_path / "out")
    for record in found.records:
        measured = record.motion.measured
        assert measured is not None
        inside = (measured.omega > 4.0) & (measured.omega < 25.0)
        expected = 40.0 + 3.0j * measured.omega[inside]
        np.testing.assert_allclose(measured.values[inside], expected, rtol=0.05)
        for name, value in truth.items():
            assert record.estimates[name][0] == pytest.approx(value, rel=0.02)
    assert (tmp_path / "out" / "bode_one.svg").is_file()
    assert found.model["parameters"]["d"] == pytest.approx(3.0, rel=0.01)


def test_a_method_that_an_element_does_not_have_is_refused() -> None:
    x = np.sin(np.linspace(0.0, 60.0, 300) ** 1.5)
    record = Record("one", DT, {"x": x, "force": 40.0 * x}, {"x": "m", "force": "N"})
    with pytest.raises(InputError, match="'thesis' fits rigs whose input moves a mass"):
        identify_campaign(make_campaign(ELEMENT, [record]), checked_options("thesis", None))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("campaign", "name"),
    [
        ("silverbox", "x"),
        ("boucwen", "x"),
        ("mr_damper/campaign_on.toml", "force"),
        ("mr_damper/campaign_off.toml", "force"),
    ],
)
def test_measured_campaigns_end_in_results(
    campaign: str, name: str, shared_data: Path, tmp_path: Path
) -> None:
    found = run_identify(shared_data / campaign, tmp_path)
    assert (tmp_path / "identification.json").is_file()
    for score in found.joint.scores:
        assert 0.0 < score.nrmse[name] < 0.5

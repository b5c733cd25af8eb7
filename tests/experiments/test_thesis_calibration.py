"""The thesis study's calibration to frequency responses gives a known hysteresis back."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from rigsight.effects import effect_named
from rigsight.errors import InputError
from rigsight.excitation import log_sweep
from rigsight.identify.hysteresis import SpectralRatio
from rigsight.records import Record
from rigsight.rigs import ELEMENT, RUNNING_GEAR
from rigsight.rigs.published import published_sets
from rigsight.simulate import compose, simulate

STUDY = Path(__file__).parents[2] / "experiments/thesis"
CONSTANTS = {"v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27}
LATERAL = {"l_0": 0.25, "c_y": 0.98}
OMEGA = np.geomspace(1.0, 60.0, 48)
BOUC_WEN = compose(RUNNING_GEAR, [effect_named("bouc_wen_hysteresis")], {"n": 1.0})
FREE = ("J_z", "k_c", "k_d", "a", "beta", "gamma")
HYSTERETIC = {
    **published_sets()["hysteresis_r"].values(),
    "J_z": 0.58, "k_d": 0.5, "k_c": 700.0, "a": 0.09, "beta": 2660.0, "gamma": -660.0,
}  # fmt: skip


@pytest.fixture
def to_responses(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """The study's calibration, as its own folder imports it."""
    monkeypatch.syspath_prepend(str(STUDY))
    import to_responses

    yield to_responses
    del sys.modules["to_responses"], sys.modules["swept_response"]


def sweep(amplitude: float) -> Record:
    t = 5e-3 * np.arange(6000)
    u = log_sweep(t, amplitude, 0.5, 100.0)
    return Record(f"sweep {amplitude} A", 5e-3, {"u": u}, {"u": "A", "psi": "rad"}, kind="sweep")


@pytest.mark.slow
def test_a_family_of_swept_responses_gives_the_hysteresis_back(to_responses: ModuleType) -> None:
    rng = np.random.default_rng(1)
    measured = []
    for amplitude in (0.25, 1.0):
        record = sweep(amplitude)
        psi = simulate(BOUC_WEN, HYSTERETIC, record)["psi"] + 2e-5 * rng.standard_normal(record.n_samples)
        response = SpectralRatio("u", "psi", OMEGA)(record.with_signals(psi=psi))
        measured.append(to_responses.SweptResponse(response, record))
    found = to_responses.calibrate_to_responses(
        BOUC_WEN, measured, CONSTANTS, rng, free=FREE, start=LATERAL, n_generations=60, n_sets=64, n_ends=3
    )
    assert found.fit.success
    for name in FREE:
        assert found.values[name] == pytest.approx(HYSTERETIC[name], rel=0.1), name
    assert found.values["beta"] + found.values["gamma"] == pytest.approx(2000.0, rel=0.05)
    for name in ("J_z", "k_c", "a"):
        assert abs(found.values[name] - HYSTERETIC[name]) < 5.0 * found.standard_errors[name]
    assert len(found.derived.loop_areas) == 2


def test_what_cannot_be_calibrated_is_explained(to_responses: ModuleType) -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match="at least one frequency response"):
        to_responses.calibrate_to_responses(BOUC_WEN, [], CONSTANTS, rng, free=FREE)
    measured = SpectralRatio("u", "u", OMEGA)(sweep(1.0))
    swept = to_responses.SweptResponse(measured, sweep(1.0))
    with pytest.raises(InputError, match="prescribes the motion"):
        to_responses.calibrate_to_responses(compose(ELEMENT), [swept], {}, rng, free=["k"])
    with pytest.raises(InputError, match="response is 'u'"):
        to_responses.calibrate_to_responses(BOUC_WEN, [swept], CONSTANTS, rng, free=FREE)

"""Where a disturbance as small as the noise makes another motion, the play is found in windows of a few cycles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.signal import lfilter

from rigsight.campaign import Campaign
from rigsight.diagnose.diagnosis import diagnose
from rigsight.diagnose.result import Diagnosis
from rigsight.effects import Effect, effect_named
from rigsight.excitation import log_sweep
from rigsight.records import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate

DT, NOISE = 5e-3, 1.6e-5
RIG = {"gain": 0.77, "m": 3.06, "d": 8.8, "k": 539.0, "x_off": 0.0, "force_off": 0.0}
RIVALS = [effect_named(name) for name in ("coulomb_friction", "free_play", "cubic_stiffness")]
PLAY = effect_named("backlash")


def measured(effects: Sequence[str], own: dict[str, float], n_samples: int = 8000) -> tuple[Record, ...]:
    """Return records of a rig that a torque disturbance moves by about a tenth of the sensor noise."""
    rng = np.random.default_rng(2)
    structure = compose(AXIS, [effect_named(name) for name in effects])
    t = DT * np.arange(n_samples)
    records = []
    for amplitude, role in ((0.5, "estimation"), (1.0, "estimation"), (0.75, "validation")):
        u = log_sweep(t, amplitude, 2.0, 80.0)
        disturbance = lfilter([0.025], [1.0, -0.975], rng.standard_normal(t.size))
        disturbance *= 0.1 * NOISE * RIG["k"] / RIG["gain"] / np.std(disturbance)
        run = Record(
            f"{amplitude} A", DT, {"u": u + disturbance}, {},
            kind="sweep", role=role, amplitude=amplitude, hold="foh",
        )  # fmt: skip
        x = simulate(structure, {**RIG, **own}, run)["x"] + rng.normal(scale=NOISE, size=t.size)
        records.append(run.with_signals(u=u, x=x))
    return tuple(records)


def diagnosed(records: Sequence[Record], effects: Sequence[Effect]) -> Diagnosis:
    campaign = Campaign("play", AXIS, {"gain": RIG["gain"]}, {}, tuple(records))
    return diagnose(campaign, effects)


@pytest.fixture(scope="module")
def of_play() -> tuple[Record, ...]:
    return measured(["backlash"], {"g": 1.35e-4})


@pytest.mark.slow
def test_the_play_is_named_in_windows_down_to_the_noise(of_play: tuple[Record, ...]) -> None:
    diagnosis = diagnosed(of_play, [PLAY, effect_named("free_play")])
    assert (diagnosis.verdict, diagnosis.effects) == ("effect", ("backlash",))
    assert diagnosis.window_cycles == 4
    best = diagnosis.candidates[0]
    assert best.error_over_noise == pytest.approx(1.0, abs=0.1)
    assert best.parameters["g"].value == pytest.approx(1.35e-4, rel=0.02)
    assert any("windows of 4 cycles" in note for note in diagnosis.notes)
    assert not any("{" in note or "}" in note for note in diagnosis.notes)


@pytest.mark.slow
def test_windows_do_not_make_a_wrong_effect_right(of_play: tuple[Record, ...]) -> None:
    diagnosis = diagnosed(of_play, RIVALS)
    assert diagnosis.verdict == "unknown"
    assert diagnosis.window_cycles is None


@pytest.mark.slow
def test_what_can_be_predicted_is_read_whole() -> None:
    diagnosis = diagnosed(
        measured(["cubic_stiffness"], {"k_3": 4e7}), [effect_named("cubic_stiffness"), PLAY]
    )
    assert diagnosis.effects == ("cubic_stiffness",)
    assert diagnosis.window_cycles is None

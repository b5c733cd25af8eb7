"""Several causes at several places of an arm: the motion names them, and they are fitted together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rigsight.campaign import Campaign
from rigsight.diagnose.diagnosis import diagnose
from rigsight.effects import CATALOGUE, effect_named
from rigsight.records import Record
from rigsight.rigs import RIGS
from rigsight.simulate import compose, simulate

DT, N, NOISE = 2e-3, 3000, 2e-5
T = DT * np.arange(N)
ARM = {
    "l_1": 0.3,
    "g": 9.81,
    "I_1": 0.05,
    "I_2": 0.02,
    "m_2": 0.6,
    "s_1": 0.12,
    "s_2": 0.08,
    "d_1": 0.3,
    "d_2": 0.1,
}
HIDDEN = {
    "quadratic_damping@shoulder": {"c_2": 0.1},
    "coulomb_friction@shoulder": {"T_c": 0.08},
    "input_delay@elbow_motor": {"T_d": 0.007},
}


def run(name: str, seed: int) -> Record:
    rng = np.random.default_rng(seed)
    structure = compose(RIGS["two_link_arm"], [effect_named(effect) for effect in HIDDEN])
    own = {name: value for numbers in HIDDEN.values() for name, value in numbers.items()}

    def drive(size: float) -> np.ndarray:
        tones = zip(rng.uniform(0.3, 2.5, 4), rng.uniform(0.0, 2.0 * np.pi, 4), strict=True)
        return size * sum(np.sin(2.0 * np.pi * f * T + phase) - np.sin(phase) for f, phase in tones)

    driven = Record(name, DT, {"tau_1": drive(0.5), "tau_2": drive(0.15)}, {}, hold="zoh")
    clean = simulate(structure, {**ARM, **own}, driven, np.zeros(4))
    noisy = {s.name: clean[s.name] + NOISE * rng.standard_normal(N) for s in structure.rig.outputs}
    return clean.with_signals(**noisy)


@pytest.mark.slow
def test_two_forces_of_one_joint_and_a_late_drive_are_named_at_their_places() -> None:
    """The sum of two forces of one speed resembles many laws, but along the motion each explains what the other cannot."""
    records = (run("1", 1), run("2", 2), replace(run("3", 3), role="validation"))
    given = {name: value for name, value in ARM.items() if name not in ("l_1", "g")}
    campaign = Campaign("arm", RIGS["two_link_arm"], {"l_1": 0.3, "g": 9.81}, given, records)
    found = diagnose(campaign, CATALOGUE)
    probable = {(str(own.family), own.where) for own in found.families if own.probability > 0.5}
    assert probable == {
        ("damping_law", "shoulder"),
        ("dry_friction", "shoulder"),
        ("delay_or_lag", "elbow_motor"),
    }

"""Are records run free only where the given simulation stays near them?"""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.campaign import Campaign
from rigsight.diagnose.search.horizon import restores
from rigsight.records import Record
from rigsight.rigs import RIGS
from rigsight.simulate import compose, simulate

TRAIN = {"k_t": 0.05, "J_m": 1e-4, "J_l": 5e-4, "k_s": 2.0, "d_s": 1e-3, "d_m": 1e-3, "d_l": 1e-3, "k_l": 0.5}


@pytest.mark.parametrize(("stiffness", "is_free"), [(0.5, True), (1e-3, False)])
def test_several_bodies_that_a_free_run_loses_are_followed(stiffness: float, is_free: bool) -> None:
    rig, time = RIGS["drive_train"], 2e-3 * np.arange(4000)
    (u,) = rig.inputs
    drive = 1.0 + np.sin(2.0 * np.pi * (0.3 * time + 0.4 * time**2))
    run = simulate(compose(rig), TRAIN, Record("run", 2e-3, {u.name: drive}, {}))
    own = {p.name for p in rig.parameters}
    constants = {p.name: TRAIN[p.name] for p in rig.constants if p.name in TRAIN}
    given = {name: value for name, value in {**TRAIN, "k_l": stiffness}.items() if name in own}
    assert restores(Campaign("train", rig, constants, given, (run,))) is is_free

"""A rig may call its coordinates, states and parameters as it likes: no name is one that the simulation has itself."""

from __future__ import annotations

import re

import numpy as np
import pytest

from rigsight.effects import effect_named, placed
from rigsight.records import Record
from rigsight.rigs import rig_file_text
from rigsight.rigs.reading.rig_file import rig_of_text
from rigsight.simulate import compose, simulate

TRAIN = rig_file_text("drive_train")
VALUES = {
    "k_t": 0.05, "J_m": 1e-3, "J_l": 2e-3, "k_s": 5.0, "d_s": 0.01, "d_m": 0.01, "d_l": 0.01, "k_l": 1.0, "T_c": 0.002,
}  # fmt: skip
NAMES = (
    "q0", "d0", "x0", "p_k_s", "mode_0", "rate_0", "input_value", "input_rate", "time", "friction_sign_0", "earlier", "part0",
    "before_0", "deflection_before", "inner0", "x", "v", "k", "T_c", "I", "E", "S", "pi", "lambda",
)  # fmt: skip


def simulated(old: str, new: str) -> np.ndarray:
    rig = rig_of_text(re.sub(rf"\b{old}\b", new, TRAIN))
    structure = compose(rig, [placed(effect_named("coulomb_friction"), "load_bearing")])
    # Where the rig has a parameter T_c of its own, that of the effect is qualified.
    renamed = {new: old} if old in VALUES else {}
    values = {p.name: VALUES[renamed.get(p.name, p.name.rpartition(".")[2])] for p in structure.parameters}
    t = 0.005 * np.arange(200)
    return simulate(structure, values, Record("r", 0.005, {"u": np.sin(10.0 * t)}, {}))["load_angle"]


@pytest.fixture(scope="module")
def reference() -> np.ndarray:
    return simulated("phi_l", "phi_l")


@pytest.mark.parametrize("new", NAMES)
def test_a_coordinate_may_have_any_name(new: str, reference: np.ndarray) -> None:
    assert simulated("phi_l", new) == pytest.approx(reference, abs=1e-9 * np.max(np.abs(reference)))


@pytest.mark.parametrize("new", ["T_c", "q0", "input_value", "m", "p_k_s"])
def test_a_parameter_may_have_any_name(new: str, reference: np.ndarray) -> None:
    assert simulated("k_s", new) == pytest.approx(reference, abs=1e-9 * np.max(np.abs(reference)))

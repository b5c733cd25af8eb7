"""Start values that a rig gives, in the order coordinates, rates, states; all that it does not give starts at rest."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rigsight.effects import effect_named, placed
from rigsight.errors import InputError
from rigsight.records.record import Record
from rigsight.rigs import RIGS, Rig, read_rig_file
from rigsight.simulate import compose, parameter_vector, record_input, rest_state, simulate, simulate_sets

DT, N = 5e-3, 200
T = DT * np.arange(N)

STAGE = """name = "stage"
[inputs.u]
unit = "N"
[parameters.m]
unit = "kg"
[parameters.k]
unit = "N/m"
[parameters.d]
unit = "N s/m"
[constants.x_0]
unit = "m"
default = 0.03
[constants.tau]
unit = "s"
default = 0.1
[coordinates.x]
unit = "m"
[energy]
kinetic = "m*d(x)^2/2"
[joints.guide]
motion = "x"
stiffness = "k"
damping = "d"
[drives.motor]
signal = "u"
force = "motor"
along = "x"
[states.z]
rate = "(x - z)/tau"
unit = "m"
[sensors.x]
reads = "x"
unit = "m"
[sensors.z]
reads = "z"
unit = "m"
"""
VALUES = {"m": 1.0, "k": 100.0, "d": 0.6, "x_0": 0.03}


def stage(folder: Path, initial: str = "", start: str = "") -> Rig:
    path = folder / "stage.toml"
    path.write_text(STAGE.replace("[states.z]\n", f"[states.z]\n{start}") + initial, "utf-8")
    return read_rig_file(path)


@pytest.mark.parametrize(
    ("initial", "start", "state"),
    [
        ('[initial]\nx = "x_0"\n', "", (0.03, 0.0, 0.03)),
        ('[initial]\nx = "x_0"\n"d(x)" = 0.4\n', "", (0.03, 0.4, 0.03)),
        ('[initial]\n"d(x)" = 0.4\nz = "x_0"\n', "", (0.02, 0.4, 0.03)),
        ('[initial]\n"d(x)" = "x_0/tau"\n', "", (0.02, 0.3, 0.02)),
        ("[initial]\nx = 0.0\n", 'start = "2*x_0"\n', (0.0, 0.0, 0.06)),
    ],
    ids=["place", "place and rate", "rate and state", "rate", "place and start of a state"],
)
def test_given_values_are_taken_and_the_others_rest_with_them(
    initial: str, start: str, state: tuple[float, ...], tmp_path: Path
) -> None:
    """A force of 2 N holds the stage at 0.02 m."""
    structure = compose(stage(tmp_path, initial, start))
    assert structure.rig.has_one_motion
    held = record_input(structure, Record("run", DT, {"u": np.full(N, 2.0)}, {}, hold="zoh"))
    found = rest_state(structure, parameter_vector(structure, VALUES), held)
    np.testing.assert_allclose(found, state, rtol=1e-8, atol=1e-12)


def test_a_state_that_starts_twice_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"initial\.z: 'z' has two start values"):
        stage(tmp_path, "[initial]\nz = 0.1\n", 'start = "x_0"\n')


def test_what_friction_holds_decays_without_any_input(tmp_path: Path) -> None:
    """Half a period after the other, 2 T_c/k less each time: 0.03 m, -0.012 m, and -0.006 m, which friction holds."""
    text = STAGE[: STAGE.index("[inputs.u]")] + STAGE[STAGE.index("[parameters.m]") :]
    motor = text.index("[drives.motor]")
    text = text[:motor] + text[text.index("[states.z]") :]
    path = tmp_path / "decay.toml"
    path.write_text(
        text.replace('damping = "d"\n', "").replace('[parameters.d]\nunit = "N s/m"\n', ""), "utf-8"
    )
    path.write_text(path.read_text("utf-8") + '[initial]\nx = "x_0"\n', "utf-8")
    rig = read_rig_file(path)
    structure = compose(rig, [placed(effect_named("coulomb_friction"), "guide")])
    values = {"m": 1.0, "k": 100.0, "T_c": 0.9}
    record = Record("run", DT, {"x": np.zeros(N)}, {})
    found = simulate(structure, values, record)["x"]
    turns = np.floor(T / (np.pi / 10.0))
    first, second = turns == 0, turns <= 1
    cosine = np.cos(10.0 * T)
    exact = np.where(first, 0.009 + 0.021 * cosine, np.where(second, -0.009 + 0.003 * cosine, -0.006))
    np.testing.assert_allclose(found, exact, atol=1e-8)
    assert np.ptp(found[~second]) == 0.0
    held, p = record_input(structure, record), parameter_vector(structure, values)
    state = rest_state(structure, p, held)
    sets = simulate_sets(structure, held, p[:, None], state[:, None], N, 8)[:, 0, 0]
    np.testing.assert_allclose(sets, found, atol=1e-5)


def test_what_was_before_a_record_moves_a_rig_of_two_inputs() -> None:
    values = dict(zip(("l_1", "g", "I_1", "I_2", "m_2", "s_1", "s_2", "d_1", "d_2"),
                      (0.3, 9.81, 0.05, 0.02, 0.6, 0.12, 0.08, 0.05, 0.02), strict=True))  # fmt: skip
    whole = {"tau_1": 0.5 * np.sin(9.0 * T), "tau_2": 0.2 * np.sin(14.0 * T)}
    structure, split = compose(RIGS["two_link_arm"]), 80
    complete = simulate(structure, values, Record("run", DT, whole, {}, hold="foh"))
    second = Record("run", DT, {name: samples[split:] for name, samples in whole.items()}, {}, hold="foh")
    columns = np.column_stack([samples[:split] for samples in whole.values()])
    for before in (columns, {name: samples[:split] for name, samples in whole.items()}):
        found = simulate(structure, values, second, before=before)
        np.testing.assert_allclose(found["angle_2"], complete["angle_2"][split:], rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize(
    "before",
    [np.zeros(9), np.zeros((9, 3)), {"tau_1": np.zeros(9)}, {"tau_1": np.zeros(9), "tau_2": np.zeros(8)}],
)
def test_samples_before_a_record_are_of_each_input(before: object) -> None:
    record = Record("run", DT, {"tau_1": np.zeros(N), "tau_2": np.zeros(N)}, {}, hold="foh")
    with pytest.raises(InputError, match="two_link_arm has the inputs tau_1, tau_2"):
        simulate(compose(RIGS["two_link_arm"]), {}, record, before=before)  # type: ignore[arg-type]

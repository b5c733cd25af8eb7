"""Accelerations found by elimination are those of the formulas: small rigs, which have both."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import sympy as sp
from numpy.typing import NDArray

from rigsight.effects import effect_named, placed
from rigsight.errors import InputError
from rigsight.identify.rig_equations import equations_of
from rigsight.records.record import Hold, Record
from rigsight.rigs import RIGS, Rig, has_short_inverse, mechanism
from rigsight.rigs.reading.rig_file import rig_of_tables
from rigsight.simulate import (
    Structure,
    carries_tangents,
    compose,
    parameter_vector,
    record_input,
    rest_state,
    simulate,
    simulate_sets,
    simulate_tangents,
)
from rigsight.simulate.compiled import kernel_source
from rigsight.simulate.compiled.kernel_equations import KernelEquations
from rigsight.simulate.equations.elimination import Elimination
from rigsight.simulate.equations.kinks import freeze
from rigsight.simulate.equations.straight_line import straight_line
from rigsight.simulate.linearization import linearize

from ...tiers import slow_but

DT, N = 5e-3, 160
VALUES: Mapping[str, Mapping[str, float]] = {
    "drive_train": {
        "k_t": 0.05, "J_m": 1e-3, "J_l": 3e-3, "k_s": 2.0, "d_s": 2e-3, "d_m": 4e-3, "d_l": 4e-3, "k_l": 1.0, "beta": 100.0,
        "gamma": -60.0, "A": 1.0, "a": 0.4, "n": 1.0, "T_d": 0.012,
    },
    "two_link_arm": {
        "l_1": 0.3, "g": 9.81, "I_1": 0.05, "I_2": 0.02, "m_2": 0.6, "s_1": 0.12, "s_2": 0.08, "d_1": 0.05, "d_2": 0.02,
        "coulomb_friction@shoulder.T_c": 0.1, "stribeck_friction@elbow.T_c": 0.02, "T_c": 0.05, "T_s": 0.04,
        "w_s": 0.1, "T_d": 0.012, "c_2": 0.03,
    },
    "quarter_car": {"m_b": 300.0, "m_w": 40.0, "k_b": 2e4, "d_b": 1500.0, "k_t": 2e5, "d_t": 100.0, "k_3": 4e6},
}  # fmt: skip
CASES: list[tuple[str, tuple[str, ...], Hold]] = [
    ("two_link_arm", (), "zoh"),
    ("two_link_arm", ("quadratic_damping@elbow", "input_delay@elbow_motor"), "foh"),
    ("two_link_arm", ("coulomb_friction@elbow",), "zoh"),
    ("two_link_arm", ("coulomb_friction@shoulder", "stribeck_friction@elbow"), "zoh"),
    ("drive_train", ("bouc_wen_hysteresis@shaft", "input_delay@motor"), "zoh"),
    ("quarter_car", ("cubic_stiffness@suspension",), "foh"),
]
"""Free motion, signals that act late, friction at one joint and at two, memories, an input that arrives late and a motion
that is prescribed."""


def both(
    monkeypatch: pytest.MonkeyPatch, rig: Rig, effects: tuple[str, ...] = ()
) -> tuple[Structure, Structure]:
    """A rig with effects whose accelerations are formulas, and the same by elimination."""
    chosen = [placed(effect_named(kind), place) for kind, _, place in (e.partition("@") for e in effects)]
    written = compose(rig, chosen)
    assert written.elimination is None
    monkeypatch.setattr(mechanism, "MOST_COUPLED", 0)
    eliminated = compose(fresh(rig), chosen)
    assert eliminated.elimination is not None
    return written, eliminated


def fresh(rig: Rig) -> Rig:
    """The same rig, of which nothing is known yet."""
    return replace(rig, mechanism=replace(rig.mechanism))


def record_of(rig: Rig, hold: Hold) -> Record:
    t = DT * np.arange(N)
    size = 0.02 if rig.name == "quarter_car" else 0.4
    signals = {s.name: size * np.sin((9.0 + 4.0 * i) * t + i) for i, s in enumerate(rig.inputs)}
    return Record("run", DT, signals, {}, hold=hold)


def assert_same(found: NDArray[np.float64], expected: NDArray[np.float64], limit: float) -> None:
    assert np.max(np.abs(found - expected)) <= limit * np.max(np.abs(expected))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "effects", "hold"), slow_but(CASES[0], CASES[3], CASES[5], of=CASES))
def test_the_motion_is_the_same(
    monkeypatch: pytest.MonkeyPatch, name: str, effects: tuple[str, ...], hold: Hold
) -> None:
    written, eliminated = both(monkeypatch, RIGS[name], effects)
    record = record_of(written.rig, hold)
    for known, other in zip(freeze(written).frictions, freeze(eliminated).frictions, strict=True):
        assert known.velocity == other.velocity
        assert known.alone == other.alone
    expected = simulate(written, VALUES[name], record, accuracy=1e-9)
    found = simulate(eliminated, VALUES[name], record, accuracy=1e-9)
    for signal in written.rig.outputs:
        assert_same(found[signal.name], expected[signal.name], 1e-9)


def test_a_rate_is_read_late_with_the_acceleration(monkeypatch: pytest.MonkeyPatch) -> None:
    arm = RIGS["two_link_arm"]
    first, second = arm.mechanism.sensors
    speed = replace(second, reads=arm.mechanism.free[1].rate, unit="rad/s")
    rig = replace(arm, mechanism=replace(arm.mechanism, sensors=(first, speed)))
    effects = ("actuator_lag@shoulder_motor", "actuator_lag@elbow_motor", "sensor_delay@angle_2")
    values = {**VALUES["two_link_arm"], "T_s": 0.011}
    values |= {f"actuator_lag@{motor}_motor.T_a": 0.02 for motor in ("shoulder", "elbow")}
    structures = both(monkeypatch, rig, effects)
    assert all(len(structure.computed_outputs) == 3 for structure in structures)
    expected, found = (simulate(s, values, record_of(rig, "foh"), accuracy=1e-9) for s in structures)
    assert_same(found["angle_2"], expected["angle_2"], 1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("effects", [("quadratic_damping@elbow",), ("coulomb_friction@elbow",)])
def test_sets_side_by_side_and_their_derivatives_are_the_same(
    monkeypatch: pytest.MonkeyPatch, effects: tuple[str, ...]
) -> None:
    structures = both(monkeypatch, RIGS["two_link_arm"], effects)
    record = record_of(structures[0].rig, "foh")
    held, p = record_input(structures[0], record), parameter_vector(structures[0], VALUES["two_link_arm"])
    x0 = np.array([0.3, -0.2, 0.5, -1.0])
    sets = np.outer(p, 1.0 + 0.01 * np.arange(5))
    expected, found = (simulate_sets(s, held, sets, np.outer(x0, np.ones(5)), N, 3) for s in structures)
    assert_same(found, expected, 1e-9)
    assert carries_tangents(structures[0]) == carries_tangents(structures[1])
    if carries_tangents(structures[0]):
        dp = np.hstack([np.diag(p), np.zeros((p.size, 4))])
        dx0 = np.hstack([np.zeros((4, p.size)), np.eye(4)])
        expected, found = (simulate_tangents(s, held, p, dp, x0, dx0, N, 3) for s in structures)
        for direction in range(expected.shape[2]):
            assert_same(found[:, :, direction], expected[:, :, direction], 1e-9)


def test_the_rig_rests_and_answers_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    written, eliminated = both(monkeypatch, RIGS["two_link_arm"], ("coulomb_friction@elbow",))
    values = VALUES["two_link_arm"]
    held, p = record_input(written, record_of(written.rig, "foh")), parameter_vector(written, values)
    held.coefficients[:2] += 0.2
    assert np.any(rest_state(written, p, held) != 0.0)
    assert_same(rest_state(eliminated, p, held), rest_state(written, p, held), 1e-7)
    for state in (None, np.array([0.4, 0.3, 1.0, -2.0])):
        expected, found = (linearize(s, values, {"tau_1": 0.3}, state) for s in (written, eliminated))
        assert_same(found.state_matrix, expected.state_matrix, 1e-6)
        assert_same(found.input_matrix, expected.input_matrix, 1e-6)


def test_equations_in_numbers_are_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    written = equations_of(RIGS["two_link_arm"])
    # Which of both it is, is found when it is first asked.
    assert compose(RIGS["two_link_arm"]).elimination is None
    monkeypatch.setattr(mechanism, "MOST_COUPLED", 0)
    eliminated = equations_of(fresh(RIGS["two_link_arm"]))
    rng = np.random.default_rng(3)
    z, u, p = rng.normal(size=(4, 7)), rng.normal(size=(6, 7)), rng.uniform(0.5, 1.5, 9)
    assert_same(eliminated.rates(z, u, p), written.rates(z, u, p), 1e-12)
    accelerations = written.accelerations(z, u, p)
    for found, expected in zip(
        eliminated.changes_of_equations(z, u, p, accelerations),
        written.changes_of_equations(z, u, p, accelerations),
        strict=True,
    ):
        assert_same(found, expected, 1e-12)


def test_zeros_of_the_mass_matrix_are_left_out() -> None:
    rng = np.random.default_rng(5)
    numbers = rng.normal(size=(6, 6))
    numbers = numbers @ numbers.T + 6.0 * np.eye(6)
    # A chain of three with a branch, and two masses for themselves.
    apart = [(i, j) for i in range(6) for j in range(i) if (i, j) not in {(1, 0), (2, 1), (3, 1), (5, 4)}]
    for i, j in apart:
        numbers[i, j] = numbers[j, i] = 0.0
    mass = sp.ImmutableMatrix(6, 6, [sp.Float(x) if x != 0.0 else sp.S.Zero for x in numbers.ravel()])
    elimination = Elimination.of(mass)
    loads = rng.normal(size=6)
    known = {symbol: mass[at] for at, symbol in elimination.mass.items()}
    known |= dict(zip(elimination.loads, map(sp.Float, loads), strict=True))
    solved = straight_line(elimination.accelerations, {**known, **elimination.steps}).function([], ["math"])()
    np.testing.assert_allclose(solved, np.linalg.solve(numbers, loads), rtol=1e-12)
    assert not any(f"share {i} {j}" in map(str, elimination.steps) for i in (4, 5) for j in range(4))
    assert not has_short_inverse(mass)
    assert has_short_inverse(sp.ImmutableMatrix(mass[3:, 3:]))


def test_built_in_rigs_have_formulas() -> None:
    """Their sources are those that they were before rigs of more joints came."""
    for rig in RIGS.values():
        assert compose(rig).elimination is None
        assert not compose(rig).steps


def test_an_inertia_that_is_no_formula_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    from rigsight.effects.symbols import m, x

    reading = replace(effect_named("quadratic_damping"), torque=m * x)
    monkeypatch.setattr(mechanism, "MOST_COUPLED", 1)
    rig = fresh(RIGS["two_link_arm"])
    with pytest.raises(InputError, match=r"Set inertia in joints\.elbow"):
        compose(rig, [placed(reading, "elbow")])
    assert not rig.offers(placed(reading, "elbow"))
    joints = tuple(replace(joint, inertia=sp.Symbol("I_2", real=True)) for joint in rig.mechanism.joints)
    reported = replace(rig, mechanism=replace(rig.mechanism, joints=joints))
    assert reported.offers(placed(reading, "elbow"))
    assert compose(reported, [placed(reading, "elbow")]).elimination is not None


@pytest.mark.parametrize(("n_links", "integrated"), [(3, True), (4, False)])
def test_derivatives_of_long_arms_are_differences(
    monkeypatch: pytest.MonkeyPatch, n_links: int, integrated: bool
) -> None:
    monkeypatch.setattr(mechanism, "MOST_COUPLED", 1)
    links = [f"a{i}" for i in range(n_links)]
    moved = [f"d({link})^2" for link in links]
    coupled = [f"d({one})*d({two})*cos({one} - {two})/4" for one, two in pairwise(links)]
    arm = rig_of_tables(
        {
            "name": "chain",
            "summary": "Links that move one another.",
            "inputs": {"u": {"unit": "N m", "about": "torque"}},
            "coordinates": {link: {"unit": "rad"} for link in links},
            "constants": {"J": {"unit": "kg m^2", "about": "inertia", "default": 1.0}},
            "parameters": {"d": {"unit": "N m s/rad", "about": "damping", "default": 1.0}},
            "energy": {"kinetic": f"J*({' + '.join([*moved, *coupled])})/2"},
            "joints": {link: {"motion": link, "damping": "d"} for link in links},
            "drives": {"motor": {"signal": "u", "force": "motor", "along": links[0]}},
            "sensors": {"y": {"reads": links[-1], "unit": "rad"}},
        },
        "chain",
    )
    structure = compose(arm)
    assert structure.elimination is not None
    assert kernel_source.carries_tangents(KernelEquations(structure)) == integrated

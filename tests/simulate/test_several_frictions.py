"""Joints with dry friction that stick, slide and let go together, against an independent solver of bounded least squares."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import lsq_linear

from rigsight import rigs
from rigsight.effects import effect_named, placed
from rigsight.errors import InputError
from rigsight.records.record import Record
from rigsight.rigs import Rig, read_rig_file
from rigsight.simulate import (
    Structure,
    compose,
    parameter_vector,
    record_input,
    simulate,
    simulate_sets,
)
from rigsight.simulate.input_hold import Hold

Floats = NDArray[np.float64]
FILES = Path(rigs.__file__).parent / "files"
DT, N = 5e-3, 250
T = DT * np.arange(N)


def with_friction(
    rig: Rig, levels: Mapping[str, float], values: Mapping[str, float]
) -> tuple[Structure, dict[str, float]]:
    structure = compose(rig, [placed(effect_named("coulomb_friction"), joint) for joint in levels])
    own = {structure.parameter_name(e, "T_c"): levels[str(e.at)] for e in structure.effects}
    return structure, {**values, **own}


@dataclass
class LeastConstraint:
    """A mechanism whose frictions come nearest to holding it, from reversal to reversal.

    ``min |F - J' f|`` in the metric of the masses' inverse, each friction within its level: the dual of Gauss's principle.

    `mass`, `force` and `along` (the slopes J of the joints' motions) are functions of the coordinates, the rates and the inputs;
    `turning` is what J changes by: ``J' q'``.
    """

    mass: Callable[[Floats], Floats]
    force: Callable[[Floats, Floats, Floats], Floats]
    along: Callable[[Floats], Floats]
    turning: Callable[[Floats, Floats], Floats]
    level: Floats
    inputs: Floats

    def __post_init__(self) -> None:
        self.way = np.zeros(self.level.size)

    def acceleration(self, t: float, x: Floats) -> Floats:
        n = x.size // 2
        q, v = x[:n], x[n:]
        u = np.array([np.interp(t, T, column) for column in self.inputs])
        mobility, along, rests = np.linalg.inv(self.mass(q)), self.along(q), self.way == 0.0
        force = self.force(q, v, u) - along.T @ (self.level * self.way)
        if rests.any():
            root = np.linalg.cholesky(mobility).T
            pushes = root @ along[rests].T
            wanted = root @ force + np.linalg.pinv(pushes.T) @ self.turning(q, v)[rests]
            bounds = (-self.level[rests], self.level[rests])
            force = force - along[rests].T @ lsq_linear(pushes, wanted, bounds, "bvls", tol=1e-15).x
        return np.asarray(mobility @ force)

    def speeds(self, x: Floats) -> Floats:
        n = x.size // 2
        return np.asarray(self.along(x[:n]) @ x[n:])

    def leaving(self, t: float, x: Floats) -> Floats:
        """Return the acceleration of each joint at rest."""
        n = x.size // 2
        slopes = self.along(x[:n]) @ self.acceleration(t, x) + self.turning(x[:n], x[n:])
        return np.where(self.way == 0.0, slopes, 0.0)

    def sort(self, t: float, x: Floats) -> Floats:
        """Let go what accelerates, hold what has come to rest: its velocity becomes zero."""
        n = x.size // 2
        self.way = np.where(np.abs(self.speeds(x)) < 1e-8, 0.0, self.way)
        slopes = self.leaving(t, x)
        self.way = np.where(np.abs(slopes) > 1e-6, np.sign(slopes), self.way)
        rests = self.along(x[:n])[self.way == 0.0]
        return np.r_[x[:n], x[n:] - np.linalg.pinv(rests) @ (rests @ x[n:])] if rests.size else x

    def run(self, x: Floats) -> tuple[Floats, Floats]:
        """Return the states, and how many joints rest, at every sample."""
        n, rows, resting = x.size // 2, [x], [self.level.size]

        def rates(t: float, x: Floats) -> Floats:
            return np.r_[x[n:], self.acceleration(t, x)]

        def reversal(t: float, x: Floats) -> float:
            return float(np.min(np.where(self.way == 0.0, 1.0, self.way * self.speeds(x)))) + 1e-12

        def release(t: float, x: Floats) -> float:
            return float(np.max(np.abs(self.leaving(t, x)))) - 1e-5

        reversal.terminal = release.terminal = True  # type: ignore[attr-defined]
        reversal.direction, release.direction = -1.0, 1.0  # type: ignore[attr-defined]
        events = (reversal, release)
        x = self.sort(0.0, x)
        for k in range(N - 1):
            t, end = T[k], T[k + 1]
            while t < end - 1e-13:
                step = solve_ivp(rates, (t, end), x, "DOP853", rtol=1e-9, atol=1e-12, events=events)
                t, x = step.t[-1], step.y[:, -1]
                if step.status == 1:
                    x = self.sort(t, x)
            rows.append(x)
            resting.append(int(np.sum(self.way == 0.0)))
        return np.array(rows), np.array(resting)


def assert_same(found: Record, expected: Mapping[str, Floats]) -> None:
    for name, column in expected.items():
        assert np.max(np.abs(found[name] - column)) < 1e-6 * np.ptp(column), name


TRAIN = {"k_t": 0.05, "J_m": 2e-3, "J_l": 6e-3, "k_s": 1.5, "d_s": 2e-3, "d_m": 1e-3, "d_l": 1e-3, "k_l": 0.4}
JOINTS = {"motor_bearing": (1.0, 0.0), "load_bearing": (0.0, 1.0), "shaft": (1.0, -1.0)}
CURRENT = 2.2 * np.sin(7.0 * T) * np.sin(1.3 * T) + 0.5 * np.sin(17.0 * T)
TWO = {"motor_bearing": 0.03, "load_bearing": 0.02}
THREE = {"motor_bearing": 0.015, "load_bearing": 0.03, "shaft": 0.02}


def train_force(q: Floats, v: Floats, u: Floats) -> Floats:
    shaft = TRAIN["k_s"] * (q[0] - q[1]) + TRAIN["d_s"] * (v[0] - v[1])
    motor = TRAIN["k_t"] * u[0] - shaft - TRAIN["d_m"] * v[0]
    return np.array([motor, shaft - TRAIN["k_l"] * q[1] - TRAIN["d_l"] * v[1]])


def train_reference(levels: Mapping[str, float]) -> LeastConstraint:
    return LeastConstraint(
        mass=lambda _: np.diag([TRAIN["J_m"], TRAIN["J_l"]]),
        force=train_force,
        along=lambda _: np.array([JOINTS[name] for name in levels]),
        turning=lambda *_: np.zeros(len(levels)),
        level=np.array(list(levels.values())),
        inputs=CURRENT[None],
    )


@pytest.fixture
def train() -> Rig:
    return read_rig_file(FILES / "drive_train.toml")


def driven(signals: Mapping[str, Floats], hold: Hold = "foh") -> Record:
    return Record("run", DT, dict(signals), {}, hold=hold)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("levels", "counts"), [(TWO, {0, 1, 2}), (THREE, {0, 1, 3})], ids=["bearings", "bearings and shaft"]
)
def test_joints_stick_and_let_go_as_the_least_constraint_has_it(
    train: Rig, levels: dict[str, float], counts: set[int]
) -> None:
    expected, resting = train_reference(levels).run(np.zeros(4))
    assert set(resting) >= counts
    structure, values = with_friction(train, levels, TRAIN)
    found = simulate(structure, values, driven({"u": CURRENT}), np.zeros(4))
    assert_same(found, {"motor_angle": expected[:, 0], "load_angle": expected[:, 1]})


CART = {"g": 9.81, "m_c": 0.8, "m_p": 0.3, "s": 0.09, "I_p": 0.035, "k_u": 1.0, "d_c": 0.2, "d_p": 0.005}
VOLTAGE = 6.0 * np.sin(9.0 * T) * np.cos(1.9 * T)
TIP = 0.4
"""Distance of the tip of the pendulum from its pivot [m]."""


def cart_force(q: Floats, v: Floats, u: Floats) -> Floats:
    swing = CART["s"] * np.sin(q[1])
    cart = CART["k_u"] * u[0] - CART["d_c"] * v[0] + swing * v[1] ** 2
    return np.array([cart, -CART["d_p"] * v[1] - CART["g"] * swing])


def cart_mass(q: Floats) -> Floats:
    coupling = CART["s"] * np.cos(q[1])
    return np.array([[CART["m_c"] + CART["m_p"], coupling], [coupling, CART["I_p"]]])


@pytest.mark.slow
@pytest.mark.parametrize(
    "levels", [{"track": 1.5}, {"track": 1.5, "tip": 0.5}], ids=["track", "track and tip"]
)
def test_friction_holds_where_masses_couple_and_a_motion_turns(
    levels: dict[str, float], tmp_path: Path
) -> None:
    """What holds the cart moves the pendulum; what holds its tip along the track turns with its angle."""
    path = tmp_path / "cart.toml"
    more = f'[constants.r]\nunit = "m"\ndefault = {TIP}\n[joints.tip]\nmotion = "x + r*sin(phi)"\n'
    path.write_text((FILES / "cart_pendulum.toml").read_text("utf-8") + more, "utf-8")
    rig = read_rig_file(path)
    slopes = {"track": lambda q: (1.0, 0.0), "tip": lambda q: (1.0, TIP * np.cos(q[1]))}
    turning = {"track": lambda q, v: 0.0, "tip": lambda q, v: -TIP * np.sin(q[1]) * v[1] ** 2}
    reference = LeastConstraint(
        mass=cart_mass,
        force=cart_force,
        along=lambda q: np.array([slopes[name](q) for name in levels]),
        turning=lambda q, v: np.array([turning[name](q, v) for name in levels]),
        level=np.array(list(levels.values())),
        inputs=VOLTAGE[None],
    )
    start = np.array([0.0, 0.9, 0.0, 0.0])
    expected, resting = reference.run(start)
    assert set(resting) == set(range(len(levels) + 1))
    found = simulate(*with_friction(rig, levels, CART), driven({"u": VOLTAGE}), start)
    assert_same(found, {"cart": expected[:, 0], "angle": expected[:, 1]})


@pytest.mark.parametrize("levels", [TWO, THREE], ids=["bearings", "bearings and shaft"])
def test_sets_side_by_side_come_nearer_with_more_substeps(train: Rig, levels: dict[str, float]) -> None:
    structure, values = with_friction(train, levels, TRAIN)
    record = driven({"u": CURRENT})
    exact = simulate(structure, values, record, np.zeros(4), accuracy=1e-8)["load_angle"]
    held = record_input(structure, record)
    # Sets that never move, and that never stick, stand beside.
    sets = [values, {**values, "k_t": 0.0}, {**values, **{n: 0.0 for n in values if n.endswith("T_c")}}]
    p = np.column_stack([parameter_vector(structure, own) for own in sets])

    def error(substeps: int) -> float:
        found = simulate_sets(structure, held, p, np.zeros((4, 3)), N, substeps)[:, 1]
        assert not np.any(found[:, 1])
        alone = simulate_sets(structure, held, p[:, :1], np.zeros((4, 1)), N, substeps)[:, 1, 0]
        np.testing.assert_array_equal(found[:, 0], alone)
        return float(np.max(np.abs(found[:, 0] - exact)) / np.ptp(exact))

    assert error(1) < 2e-4
    assert error(16) < 1e-8


@pytest.mark.parametrize("levels", [TWO, THREE], ids=["bearings", "bearings and shaft"])
def test_a_fit_sees_no_jumps_as_joints_let_go(train: Rig, levels: dict[str, float]) -> None:
    """A joint lets go when it must, not at the next substep: differences by a level are as steady as a derivative."""
    structure, values = with_friction(train, levels, TRAIN)
    changed = next(name for name in values if name.endswith("T_c"))
    steps = 1e-4 * np.arange(-4, 5)
    sets = [{**values, changed: values[changed] * (1.0 + step)} for step in steps]
    p = np.column_stack([parameter_vector(structure, own) for own in sets])
    held = record_input(structure, driven({"u": CURRENT}))
    found = simulate_sets(structure, held, p, np.zeros((4, steps.size)), N, 1)[:, 0]
    slopes = np.diff(found, axis=1) / np.diff(steps)
    assert np.max(np.ptp(slopes, axis=1)) < 1e-2 * np.max(np.abs(slopes))


@pytest.mark.parametrize("seed", range(3))
def test_joints_that_let_go_at_the_same_instant_move_from_there(tmp_path: Path, seed: int) -> None:
    """Four frictions on two motions: one that lets go is held by the others until all of them let go, within the same substep."""
    path = tmp_path / "train.toml"
    more = '[joints.sum]\nmotion = "phi_m + 2*phi_l"\n'
    path.write_text((FILES / "drive_train.toml").read_text("utf-8") + more, "utf-8")
    rng = np.random.default_rng(seed)
    levels = {name: float(rng.uniform(3e-3, 3e-2)) for name in (*JOINTS, "sum")}
    structure, values = with_friction(read_rig_file(path), levels, TRAIN)
    record = driven({"u": rng.uniform(0.5, 1.0) * CURRENT})
    exact = simulate(structure, values, record, np.zeros(4), accuracy=1e-8)
    p = parameter_vector(structure, values)[:, None]
    found = simulate_sets(structure, record_input(structure, record), p, np.zeros((4, 1)), N, 4)
    for i, name in enumerate(("motor_angle", "load_angle")):
        assert np.max(np.abs(found[:, i, 0] - exact[name])) < 1e-7 * np.ptp(exact[name]), name


def test_what_holds_joints_at_rest_moves_nothing(train: Rig) -> None:
    structure, values = with_friction(train, THREE, TRAIN)
    weak = driven({"u": 0.25 * np.sin(9.0 * T)}, hold="zoh")
    found = simulate(structure, values, weak, np.zeros(4))
    # The third joint rests with the other two but for rounding; a current that moved them would turn them by 0.01.
    assert np.max(np.abs(found["motor_angle"])) < 1e-17
    assert np.max(np.abs(found["load_angle"])) < 1e-17


@pytest.mark.parametrize(
    ("u", "angles"),
    [(0.5, (0.0, 0.0)), (0.9, (0.01, 0.0)), (1.5, (0.0925, 0.0625)), (-3.0, (-0.33, -0.25))],
    ids=["both hold", "the load holds", "none holds", "backwards"],
)
def test_a_record_starts_where_frictions_hold_a_slow_rise(
    train: Rig, u: float, angles: tuple[float, float]
) -> None:
    """Motor: ``k_t u -+ T_m = k_s (phi_m - phi_l)``, load: ``k_s (phi_m - phi_l) -+ T_l = k_l phi_l``."""
    found = simulate(*with_friction(train, TWO, TRAIN), driven({"u": np.full(N, u)}))
    for name, angle in zip(("motor_angle", "load_angle"), angles, strict=True):
        np.testing.assert_allclose(found[name], angle, rtol=1e-9, atol=1e-15)


def test_more_frictions_than_can_be_tried_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "train.toml"
    joints = "".join(f'[joints.j{i}]\nmotion = "phi_m + {i + 2}*phi_l"\n' for i in range(9))
    path.write_text((FILES / "drive_train.toml").read_text("utf-8") + joints, "utf-8")
    structure, values = with_friction(read_rig_file(path), {f"j{i}": 0.01 for i in range(9)}, TRAIN)
    with pytest.raises(InputError, match="dry friction at 9 joints; at most 8"):
        simulate(structure, values, driven({"u": CURRENT}), np.zeros(4))


def test_a_sensor_shows_the_force_that_friction_holds_with(tmp_path: Path) -> None:
    """At rest the bearing carries all that the motor gives and the spring takes; as a held input jumps, what it carries then."""
    path = tmp_path / "train.toml"
    sensor = '[sensors.torque]\nreads = "force(motor_bearing)"\nunit = "N m"\n'
    path.write_text((FILES / "drive_train.toml").read_text("utf-8") + sensor, "utf-8")
    structure, values = with_friction(read_rig_file(path), TWO, TRAIN)
    signals = {"u": np.where(T < 0.4, 0.3, -0.5)}
    record = driven(signals, hold="zoh")
    found = simulate(structure, values, record, np.zeros(4))["torque"]
    np.testing.assert_allclose(found, TRAIN["k_t"] * signals["u"], rtol=1e-12)
    held, p = record_input(structure, record), parameter_vector(structure, values)
    side_by_side = simulate_sets(structure, held, p[:, None], np.zeros((4, 1)), N, 1)[:, 2, 0]
    np.testing.assert_allclose(side_by_side, found, rtol=1e-12)

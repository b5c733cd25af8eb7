"""Where sensors show the whole state, a record begins in the same one whatever the parameters are."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.effects import effect_named
from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.identify.fit.first_states import rig_state
from rigsight.identify.fit.fit_problem import Evaluation
from rigsight.identify.rig_equations import equations_of
from rigsight.records import Record
from rigsight.rigs import AXIS
from rigsight.rigs.reading.rig_file import rig_of_text
from rigsight.simulate import compose, simulate

MOTOR = """
name = "motor"
summary = "A motor whose current follows its voltage late."
[inputs.u]
unit = "V"
[parameters.L]
unit = "H"
[parameters.R]
unit = "V/A"
[parameters.K]
unit = "N m/A"
[parameters.J]
unit = "kg m^2"
[parameters.d]
unit = "N m s/rad"
[coordinates.phi]
unit = "rad"
[energy]
kinetic = "J*d(phi)^2/2"
[states.i]
unit = "A"
rate = "(voltage - R*i - K*d(phi))/L"
[joints.bearing]
motion = "phi"
damping = "d"
[drives.voltage]
signal = "u"
force = "K*i"
along = "phi"
[sensors.angle]
reads = "phi"
unit = "rad"
[sensors.current]
reads = "i"
unit = "A"
"""
VALUES = {"L": 0.05, "R": 1.0, "K": 0.5, "J": 0.01, "d": 0.02}


@pytest.fixture
def run() -> Record:
    t = 1e-3 * np.arange(400)
    drive = Record("run", 1e-3, {"u": np.sin(9.0 * t)}, {})
    return simulate(compose(rig_of_text(MOTOR, "motor.toml")), VALUES, drive, initial_state=[0.3, 4.0, 0.7])


def test_it_is_found_once_and_right(run: Record) -> None:
    equations = equations_of(rig_of_text(MOTOR, "motor.toml"))
    found = rig_state(equations, run, VALUES)
    np.testing.assert_allclose(found, [0.3, 4.0, 0.7], rtol=0.05)
    np.testing.assert_array_equal(rig_state(equations, run, {**VALUES, "R": 5.0}), found)


@pytest.mark.parametrize("asked_first", [0.02, 2.0])
def test_beside_a_sensor_of_the_rate_it_does_not_depend_on_the_numbers_that_came_first(
    run: Record, asked_first: float
) -> None:
    """The slope of a rate is an acceleration, which follows from the numbers."""
    gyro = MOTOR + '[sensors.rate]\nreads = "d(phi)"\nunit = "rad/s"\n'
    equations = equations_of(rig_of_text(gyro, "motor.toml"))
    record = run.with_signals(rate=np.gradient(run["angle"], run.dt))
    rig_state(equations, record, {**VALUES, "d": asked_first, "J": 1e-5})
    np.testing.assert_allclose(rig_state(equations, record, VALUES), [0.3, 4.0, 0.7], rtol=0.05)


@pytest.mark.parametrize("begin", [40, 200])
def test_in_the_middle_of_a_bent_path_its_speed_is_right(run: Record, begin: int) -> None:
    """A straight line through seven samples would err by the acceleration times three samples."""
    own = run.slice(begin, run.n_samples)
    speed = rig_state(equations_of(rig_of_text(MOTOR, "motor")), own, VALUES)[1]
    around = run["angle"][begin - 1 : begin + 2]
    assert speed == pytest.approx((around[2] - around[0]) / 2e-3, rel=1e-2)


def test_a_far_equilibrium_does_not_move_what_the_sensors_show(run: Record) -> None:
    spring = MOTOR.replace('damping = "d"', 'damping = "d"\nstiffness = "k"\nforce = "T"').replace(
        "[coordinates.phi]",
        '[parameters.k]\nunit = "N m/rad"\n[parameters.T]\nunit = "N m"\n[coordinates.phi]',
    )
    values = {**VALUES, "k": 1e-9, "T": 1.0}
    state = rig_state(equations_of(rig_of_text(spring, "motor")), run.slice(40, 400), values)
    assert state[0] == pytest.approx(run["angle"][40], abs=1e-6)


def test_without_a_sensor_of_the_current_it_goes_by_the_parameters(run: Record) -> None:
    equations = equations_of(rig_of_text(MOTOR, "motor.toml"))
    record = Record("run", run.dt, {"u": run["u"], "angle": run["angle"]}, {})
    assert not equations.shows_all_states(set(record.signals))
    assert rig_state(equations, record, VALUES)[1] == pytest.approx(4.0, rel=0.05)


@pytest.fixture(scope="module")
def stuck() -> GreyBoxFit:
    """Fit of a mass that dry friction holds for the first 0.4 s."""
    t, noise = 2e-3 * np.arange(4000), 5e-4
    force = np.interp(t, [0.0, 0.4, 1.5, 3.2, 4.5, 6.2, 7.3], [0.0, 0.0, 0.1, 0.1, -0.1, -0.1, 0.0])
    structure = compose(AXIS, (effect_named("coulomb_friction"),))
    begin = Record("run", 2e-3, {"u": force}, {})
    clean = simulate(structure, FRICTION, begin, initial_state=[1.5e-3, 0.0])
    measured = clean["x"] + noise * np.random.default_rng(0).standard_normal(t.size)
    run = begin.with_signals(x=measured)
    return GreyBoxFit(structure, [run], characteristic_scales(AXIS, [run], FRICTION), {"x": noise})


FRICTION = {
    "gain": 1.0, "m": 0.14, "d": 0.06, "k": 4.6, "x_off": 0.0, "force_off": 0.0, "T_c": 0.011,
}  # fmt: skip


@pytest.mark.parametrize("state", [[4.5e-3, 0.1], [1.5e-3, 0.0]], ids=["moving", "at rest"])
def test_a_mass_that_sticks_at_first_is_fitted_wherever_the_search_begins(
    stuck: GreyBoxFit, state: list[float]
) -> None:
    """From a velocity with which the mass slides past its place, a descent stopped at three times the noise."""
    start = {**FRICTION, "m": 0.15, "d": 0.05, "k": 4.8, "T_c": 0.008}
    found = stuck.fit(start, ["m", "d", "k", "T_c"], [np.array(state)])
    assert found.cost / found.n_samples == pytest.approx(1.0, abs=0.05)
    assert found.values["T_c"] == pytest.approx(0.011, rel=0.02)


def test_a_coordinate_without_effect_keeps_its_value_and_stops_no_other() -> None:
    slopes = np.array([[2.0, 0.0], [1.0, 0.0], [0.5, 0.0]])
    left = np.array([1.0, -1.0, 2.0])
    here = Evaluation(np.zeros(2), float(left @ left), slopes.T @ slopes, slopes.T @ left)
    root, projection = here.compressed
    step = np.linalg.solve(root, -projection)
    np.testing.assert_allclose(step, [-(slopes[:, 0] @ left) / (slopes[:, 0] @ slopes[:, 0]), 0.0])


TWO_PATHS = """
name = "two_paths"
summary = "Two motions are imposed, the forces are measured."
[inputs.a]
unit = "m"
[inputs.b]
unit = "m"
[parameters.k]
unit = "N/m"
[parameters.d]
unit = "N s/m"
[parameters.c]
unit = "N/m"
[coordinates.x]
unit = "m"
prescribed_by = "a"
[coordinates.y]
unit = "m"
prescribed_by = "b"
[joints.between]
motion = "x - y"
stiffness = "k"
damping = "d"
[joints.ground]
motion = "y"
stiffness = "c"
[sensors.upper]
reads = "force(between)"
unit = "N"
[sensors.lower]
reads = "force(ground)"
unit = "N"
"""


def test_a_rig_without_states_is_fitted() -> None:
    rig, t = rig_of_text(TWO_PATHS, "two_paths.toml"), 0.01 * np.arange(600)
    truth = {"k": 100.0, "d": 2.0, "c": 50.0}
    moved = Record("run", 0.01, {"a": np.sin(5.0 * t), "b": 0.3 * np.sin(3.0 * t)}, {}, role="estimation")
    run = simulate(compose(rig), truth, moved)
    fit = GreyBoxFit(
        compose(rig), [run], characteristic_scales(rig, [run], truth), {"upper": 1e-3, "lower": 1e-3}
    )
    found = fit.fit({"k": 80.0, "d": 1.0, "c": 60.0}, list(truth))
    assert found.values == pytest.approx(truth, rel=1e-6)

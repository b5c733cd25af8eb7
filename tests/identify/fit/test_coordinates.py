"""Search coordinates are another way to write the same parameters."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.effects import effect_named
from rigsight.identify.fit.coordinates import Coordinates
from rigsight.rigs import AXIS, RUNNING_GEAR
from rigsight.simulate import compose, parameter_vector, special_values

STRUCTURE = compose(AXIS, [effect_named("bouc_wen_hysteresis")], {"n": 1.0})
SCALES = {"x": 0.02, "force": 3.0, "drive": 2.0, "input": 2.0, "time": 0.1, "length": 1.0}
VALUES = {
    "gain": 1.0, "m": 1.5, "d": 0.6, "k": 150.0, "x_off": 1e-3, "force_off": -0.1,
    "A": 1.0, "a": 0.4, "beta": 300.0, "gamma": -180.0,
}  # fmt: skip
FREE = ("m", "d", "k", "x_off", "a", "beta", "gamma")


@pytest.fixture
def coordinates() -> Coordinates:
    return Coordinates.of(STRUCTURE, FREE, VALUES, SCALES)


def test_parameters_come_back_unchanged(coordinates: Coordinates) -> None:
    back = coordinates.to_parameters(coordinates.from_values(VALUES))
    np.testing.assert_allclose(back, parameter_vector(STRUCTURE, VALUES), rtol=1e-12)


def test_coordinates_come_back_unchanged(coordinates: Coordinates) -> None:
    theta = coordinates.from_values(VALUES) + 0.01 * np.arange(len(FREE))
    values = dict(zip(STRUCTURE.names, coordinates.to_parameters(theta), strict=True))
    np.testing.assert_allclose(coordinates.from_values(values), theta, rtol=1e-12)


def test_what_is_not_free_keeps_its_value(coordinates: Coordinates) -> None:
    p = coordinates.to_parameters(coordinates.from_values(VALUES) + 0.3)
    for name in set(STRUCTURE.names) - set(FREE):
        assert p[STRUCTURE.names.index(name)] == VALUES[name]


def test_a_linear_coordinate_is_the_value_in_characteristic_units(coordinates: Coordinates) -> None:
    theta = coordinates.from_values(VALUES)
    stiffness = SCALES["force"] / SCALES["x"]
    assert theta[FREE.index("d")] == pytest.approx(VALUES["d"] / (stiffness * SCALES["time"]), rel=1e-12)
    assert theta[FREE.index("x_off")] == pytest.approx(VALUES["x_off"] / SCALES["x"], rel=1e-12)


def test_a_logarithmic_coordinate_steps_by_factors(coordinates: Coordinates) -> None:
    theta = coordinates.from_values(VALUES)
    moved = theta.copy()
    moved[FREE.index("m")] += np.log(2.0)
    index = STRUCTURE.names.index("m")
    ratio = coordinates.to_parameters(moved)[index] / coordinates.to_parameters(theta)[index]
    assert ratio == pytest.approx(2.0, rel=1e-12)


def test_a_pair_moves_as_sum_and_difference(coordinates: Coordinates) -> None:
    theta = coordinates.from_values(VALUES)
    first, second = FREE.index("beta"), FREE.index("gamma")
    beta, gamma = VALUES["beta"] * SCALES["x"], VALUES["gamma"] * SCALES["x"]
    assert theta[first] == pytest.approx(beta + gamma, rel=1e-12)
    assert theta[second] == pytest.approx(beta - gamma, rel=1e-12)


def test_half_a_pair_is_searched_as_itself() -> None:
    alone = Coordinates.of(STRUCTURE, ("m", "beta"), VALUES, SCALES)
    assert alone.pairs == ()
    assert alone.from_values(VALUES)[1] == pytest.approx(VALUES["beta"] * SCALES["x"], rel=1e-12)


def test_a_spring_with_memory_moves_as_two_stiffnesses(coordinates: Coordinates) -> None:
    theta = coordinates.from_values(VALUES)
    whole, elastic = FREE.index("k"), FREE.index("a")
    stiffness = SCALES["force"] / SCALES["x"]
    # The records move 0.02 m; the loop yields at 1/(beta + gamma).
    secant = 1.0 / (1.0 + 0.02 * (VALUES["beta"] + VALUES["gamma"]))
    assert np.exp(theta[whole]) == pytest.approx(0.6 * secant * VALUES["k"] / stiffness, rel=1e-12)
    assert theta[elastic] == pytest.approx(0.4 * VALUES["k"] / stiffness, rel=1e-12)


def test_a_spring_that_yields_far_below_the_motion_keeps_its_yield_force_as_other_numbers_of_it_move() -> (
    None
):
    structure = compose(RUNNING_GEAR, [effect_named("iwan_hysteresis")])
    values = {p.name: 1.0 if p.default is None else p.default for p in structure.parameters}
    values |= {"k_c": 2e3, "a": 0.02, "x_s": 5e-3, "q": -0.4}
    free = ("k_c", "a", "x_s", "q")
    searched = Coordinates.of(structure, free, values, {**SCALES, "x": 0.05})

    def yield_force(theta: np.ndarray) -> float:
        p = dict(zip(structure.names, searched.to_parameters(theta), strict=True))
        reaches = p["x_s"] * 10.0 ** (-2.7 * (11.0 - 2.0 * np.arange(6)) / 12.0)
        weights = reaches ** p["q"]
        return float((1.0 - p["a"]) * p["k_c"] * (weights @ reaches) / np.sum(weights))

    begin = searched.from_values(values)
    assert yield_force(begin + np.array([0.0, 0.0, 0.0, 0.5])) == pytest.approx(yield_force(begin), rel=0.02)
    assert yield_force(begin + np.array([0.0, 0.0, 0.5, 0.0])) == pytest.approx(yield_force(begin), rel=0.02)


def test_a_loop_that_nothing_bounds_is_searched_by_its_own_stiffness() -> None:
    values = {**VALUES, "gamma": -VALUES["beta"]}
    searched = Coordinates.of(STRUCTURE, FREE, values, SCALES)
    stiffness = SCALES["force"] / SCALES["x"]
    own = searched.from_values(values)[FREE.index("k")]
    assert np.exp(own) == pytest.approx(0.6 * VALUES["k"] / stiffness, rel=1e-9)


def test_more_memory_leaves_the_stiffness_without_it(coordinates: Coordinates) -> None:
    theta = coordinates.from_values(VALUES)
    theta[FREE.index("k")] += 3.0
    p = dict(zip(STRUCTURE.names, coordinates.to_parameters(theta), strict=True))
    assert p["a"] * p["k"] == pytest.approx(VALUES["a"] * VALUES["k"], rel=1e-12)
    assert p["k"] > 10.0 * VALUES["k"]


def test_a_spring_whose_stiffness_is_searched_by_its_logarithm_may_be_far_stiffer_than_the_loop() -> None:
    structure = compose(RUNNING_GEAR, [effect_named("iwan_hysteresis")])
    values = {p.name: 1.0 if p.default is None else p.default for p in structure.parameters}
    values |= {"k_c": 2e4, "a": 1e-3}
    free = ("k_c", "a")
    searched = Coordinates.of(structure, free, values, {**SCALES, "force": 1.0, "x": 0.01})
    p = dict(zip(structure.names, searched.to_parameters(searched.from_values(values)), strict=True))
    assert p["k_c"] == pytest.approx(2e4, rel=1e-9)
    assert p["a"] == pytest.approx(1e-3, rel=1e-9)


def test_a_share_whose_stiffness_is_held_is_searched_as_itself() -> None:
    alone = Coordinates.of(STRUCTURE, ("m", "a"), VALUES, SCALES)
    assert alone.from_values(VALUES)[1] == pytest.approx(VALUES["a"], rel=1e-12)


@pytest.mark.parametrize(
    ("name", "below", "above"),
    [("a", -0.5, 1.5), ("d", -3.0, None), ("k", -10.0, None)],
)
def test_values_beyond_the_bounds_are_moved_inside(
    coordinates: Coordinates, name: str, below: float | None, above: float | None
) -> None:
    parameter = STRUCTURE.parameters[STRUCTURE.names.index(name)]
    for value in (below, above):
        if value is None:
            continue
        theta = coordinates.from_values({**VALUES, name: value})
        assert np.all(theta > coordinates.lower)
        assert np.all(theta < coordinates.upper)
        moved = coordinates.to_parameters(theta)[STRUCTURE.names.index(name)]
        assert parameter.lower <= moved <= parameter.upper


def test_the_corners_of_the_box_are_admissible_parameters(coordinates: Coordinates) -> None:
    parameters = [STRUCTURE.parameters[i] for i in coordinates.index]
    for corner in (coordinates.lower, coordinates.upper):
        own = coordinates.to_parameters(corner)[coordinates.index]
        for parameter, value in zip(parameters, own, strict=True):
            slack = 1e-9 * abs(value)
            assert parameter.lower - slack <= value <= parameter.upper + slack, parameter.name


def test_a_positive_quantity_at_zero_gets_a_finite_coordinate(coordinates: Coordinates) -> None:
    assert np.all(np.isfinite(coordinates.from_values({**VALUES, "m": 0.0})))


def test_jacobian_agrees_with_central_differences(coordinates: Coordinates) -> None:
    theta = coordinates.from_values(VALUES)
    jacobian = coordinates.jacobian(theta)
    assert jacobian.shape == (len(FREE), len(FREE))
    step = 1e-3
    for i in range(len(FREE)):
        change = step * np.eye(len(FREE))[i]
        difference = coordinates.to_parameters(theta + change) - coordinates.to_parameters(theta - change)
        column = difference[coordinates.index] / (2.0 * step)
        # The exponential's third derivative leaves step^2/6, rounding of the one-sided difference about 1e-6.
        np.testing.assert_allclose(jacobian[:, i], column, rtol=2e-6, atol=1e-6 * np.max(np.abs(column)))


def test_no_free_parameter() -> None:
    none = Coordinates.of(STRUCTURE, (), VALUES, SCALES)
    assert none.from_values(VALUES).shape == (0,)
    np.testing.assert_array_equal(none.to_parameters(np.zeros(0)), parameter_vector(STRUCTURE, VALUES))
    assert none.jacobian(np.zeros(0)).shape == (0, 0)


@pytest.mark.parametrize("fixed", [{"n": 1.0}, {}])
def test_derivatives_are_those_of_the_parameters(fixed: dict[str, float]) -> None:
    free = (*FREE, *(() if fixed else ("n",)))
    structure = compose(AXIS, [effect_named("bouc_wen_hysteresis")], fixed)
    coordinates = Coordinates.of(structure, free, {**VALUES, "n": 1.6}, SCALES)
    theta = coordinates.from_values({**VALUES, "n": 1.6}) + 0.01 * np.arange(len(free))
    found = coordinates.derivatives(theta)
    steps = 1e-6 * np.eye(len(free))
    expected = [
        (coordinates.to_parameters(theta + step) - coordinates.to_parameters(theta - step)) / 2e-6
        for step in steps
    ]
    size = np.max(np.abs(expected), axis=0) + 1e-300
    np.testing.assert_allclose(found.T / size, np.array(expected) / size, atol=1e-8)
    np.testing.assert_array_equal(coordinates.jacobian(theta), found[coordinates.index])


def test_a_pair_and_its_exponent_are_known_by_their_names_in_the_structure() -> None:
    """The exponent of a power law is called n too, so that both are qualified."""
    effects = [effect_named("bouc_wen_hysteresis"), effect_named("power_law_stiffness")]
    structure = compose(AXIS, effects)
    values = {
        **VALUES, "bouc_wen_hysteresis.n": 1.7, "power_law_stiffness.n": 2.5, "k_p": 30.0, "x_r": 0.01,
    }  # fmt: skip
    free = [name for name in structure.names if name not in ("gain", "A", "x_r")]
    coordinates = Coordinates.of(structure, free, values, SCALES)
    (pair,) = coordinates.pairs
    assert pair.exponent == "bouc_wen_hysteresis.n"
    back = coordinates.to_parameters(coordinates.from_values(values))
    np.testing.assert_allclose(back, parameter_vector(structure, values), rtol=1e-12)


def test_special_values_go_by_the_names_of_the_structure() -> None:
    effects = [effect_named("bouc_wen_hysteresis"), effect_named("power_law_stiffness")]
    structure = compose(AXIS, effects, special_values(AXIS, effects))
    assert dict(structure.fixed) == {"bouc_wen_hysteresis.n": 1.0}
    assert "power_law_stiffness.n" in structure.names
    assert structure.special_cases == {("bouc_wen_hysteresis", "n")}


def test_a_parameter_that_was_freed_in_one_structure_stays_free_in_a_larger_one() -> None:
    hysteresis, power = effect_named("bouc_wen_hysteresis"), effect_named("power_law_stiffness")
    freed = compose(AXIS, [hysteresis])
    assert special_values(AXIS, [hysteresis, power], like=freed) == {}
    fixed = compose(AXIS, [hysteresis], special_values(AXIS, [hysteresis]))
    assert special_values(AXIS, [hysteresis, power], like=fixed) == {"bouc_wen_hysteresis.n": 1.0}


def test_of_ordered_parameters_the_larger_one_moves_as_its_excess() -> None:
    """Static friction is never below sliding friction, wherever a search goes."""
    structure = compose(AXIS, [effect_named("stribeck_friction")])
    values = {**VALUES, "T_c": 0.3, "T_s": 0.5, "w_s": 0.02}
    free = ("m", "d", "T_c", "T_s", "w_s")
    coordinates = Coordinates.of(structure, free, values, SCALES)
    theta = coordinates.from_values(values)
    np.testing.assert_allclose(
        coordinates.to_parameters(theta), parameter_vector(structure, values), rtol=1e-12
    )
    assert theta[3] == pytest.approx(0.2 / SCALES["drive"], rel=1e-9)
    slopes = coordinates.derivatives(theta)
    for i in range(len(free)):
        step = 1e-6 * np.eye(len(free))[i]
        found = (coordinates.to_parameters(theta + step) - coordinates.to_parameters(theta - step)) / 2e-6
        np.testing.assert_allclose(slopes[:, i], found, rtol=1e-6, atol=1e-6)
    lowest = coordinates.to_parameters(np.where(np.arange(len(free)) == 3, coordinates.lower, theta))
    assert lowest[structure.names.index("T_s")] == lowest[structure.names.index("T_c")]
    turned = Coordinates.of(structure, free, values, SCALES).from_values({**values, "T_s": 0.1})
    assert coordinates.to_parameters(turned)[structure.names.index("T_s")] == pytest.approx(0.3, rel=1e-6)

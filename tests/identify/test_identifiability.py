"""What is said to be identifiable: of functions whose combinations are known, and of a rig that is not by construction."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.identify.identifiability import Identifiability, identifiability
from rigsight.identify.information import Information, information, percent
from rigsight.records.record import Record
from rigsight.rigs import read_rig_file
from rigsight.simulate import compose, simulate

Floats = NDArray[np.float64]
T = np.linspace(0.0, 10.0, 400)
NOISE = 1e-3


def wave(decay: float, omega: float = 3.0) -> Floats:
    return np.exp(-decay * T) * np.sin(omega * T)


def said(function: Callable[..., Floats], size: float = 0.0, **values: float) -> Identifiability:
    """Return what is said of a function of parameters that is measured with noise; smaller ones than `size` may be negative."""
    names, place = tuple(values), np.array(list(values.values()))
    sizes = np.maximum(place, size)
    base = function(*place)
    columns = []
    for i in range(len(names)):
        step = np.zeros(len(names))
        step[i] = 1e-5 * sizes[i]
        columns.append((function(*(place + step)) - function(*(place - step))) / 2e-5 / NOISE)
    return identifiability(
        Information(
            names=names,
            units=("kg",) * len(names),
            values=place,
            sizes=sizes,
            lower=np.where(place < size, -np.inf, 0.0),
            upper=np.full(len(names), np.inf),
            asked=place,
            root=np.linalg.qr(np.column_stack(columns), mode="r"),
            change=lambda moved: float(np.linalg.norm(function(*(moved[n] for n in names)) - base)) / NOISE,
        )
    )


@pytest.mark.parametrize(
    ("function", "words", "text", "value"),
    [
        (lambda k, m, d: k / m * wave(d), "k and m only as their ratio k/m.", "k/m", 0.25),
        (lambda k, m, d: k * m * wave(d), "k and m only as their product k*m.", "k*m", 1.0),
        (lambda k, m, d: k * m**2 * wave(d), "k and m only as their product k*m^2.", "k*m^2", 2.0),
        (lambda k, m, d: (k + m) * wave(d), "k and m only as their sum k + m.", "k + m", 2.5),
        (lambda k, m, d: (k - m) * wave(d), "k and m only as their difference k - m.", "k - m", -1.5),
        (lambda k, m, d: (k + 0.09 * m) * wave(d), "k and m only as k + 0.09 m.", "k + 0.09 m", 0.68),
    ],
)  # fmt: skip
def test_two_parameters_that_follow_each_other_are_named_with_what_they_make(
    function: Callable[..., Floats], words: str, text: str, value: float
) -> None:
    found = said(function, k=0.5, m=2.0, d=0.3)
    assert found.statements == (words,)
    assert found.determined == ("d",)
    assert found.sentence == f"The records determine d. {words}"
    (combination,) = found.combinations
    assert (combination.text, combination.members) == (text, ("k", "m"))
    assert combination.value == pytest.approx(value)
    assert 0.0 < combination.std < 0.01 * abs(value)
    assert found.free_directions == 1


@pytest.mark.parametrize("m", [-1e-4, -0.9e-4, 0.0, 1e-4])
def test_a_sum_that_is_zero_by_chance_is_as_certain_as_its_terms(m: float) -> None:
    found = said(lambda k, m, d: (k + m) * wave(d) + wave(d), size=0.1, k=1e-4, m=m, d=0.3)
    assert found.sentence == "The records determine d. k and m only as their sum k + m."
    (combination,) = found.combinations
    assert combination.value == pytest.approx(1e-4 + m)
    alone = said(lambda k, d: k * wave(d) + wave(d), size=0.1, k=1e-4, d=0.3)
    assert combination.std == pytest.approx(0.1 * alone.relative_errors["k"], rel=1e-6)


def test_the_error_of_a_combination_is_that_of_the_parameter_it_stands_for() -> None:
    together = said(lambda k, m, d: (k + m) * wave(d), k=0.5, m=2.0, d=0.3)
    alone = said(lambda k, d: k * wave(d), k=2.5, d=0.3)
    assert together.combinations[0].std == pytest.approx(2.5 * alone.relative_errors["k"], rel=1e-6)
    assert together.relative_errors["d"] == pytest.approx(alone.relative_errors["d"], rel=1e-6)


def test_all_that_scales_together_lacks_one_number() -> None:
    found = said(lambda g, m, d, k: g / m * wave(d / m, k / m), g=0.5, m=2.0, d=0.3, k=3.0)
    assert found.determined == ()
    assert found.statements[0].startswith("g, m, d and k only up to a common factor")
    assert {c.text: c.value for c in found.combinations} == pytest.approx(
        {"m/g": 4.0, "d/g": 0.6, "k/g": 6.0}
    )


def test_a_sum_may_be_part_of_what_scales_together() -> None:
    found = said(
        lambda g, a, b, d, k: g / (a + b) * wave(d / (a + b), k / (a + b)), g=0.5, a=1.5, b=0.5, d=0.3, k=3.0
    )
    assert found.statements[0] == "a and b only as their sum a + b."
    assert found.statements[1].startswith("g, d, k and a + b only up to a common factor")
    assert found.free_directions == 2


def test_three_parameters_may_make_two_sums() -> None:
    found = said(
        lambda i, m, s: (i + 0.09 * m) * wave(0.3) + (s + 0.3 * m) * wave(0.5, 7.0), i=0.05, m=0.6, s=0.12
    )
    assert found.statements == ("i, m and s only as i + 0.09 m and s + 0.3 m.",)


@pytest.mark.parametrize(("influence", "words"), [(0.0, "it has no influence"), (1e-5, "times its value")])
def test_a_parameter_that_does_next_to_nothing_is_named_alone(influence: float, words: str) -> None:
    found = said(lambda k, m, d: k * (1.0 + influence * m) * wave(d), k=0.5, m=2.0, d=0.3)
    assert found.determined == ("k", "d")
    assert found.statements[0].startswith("m is not determined")
    assert words in found.statements[0]


@pytest.mark.parametrize("part", [0.05, 0.2])
def test_what_alone_is_not_determined_is_not_named_with_others(part: float) -> None:
    """Part of its influence is that of others, which are determined beside it."""

    def function(k: float, m: float, s: float, o: float) -> Floats:
        others = [wave(0.3, omega) for omega in (3.0, 7.0, 11.0)]
        return (
            k * others[0] + m * others[1] + s * others[2] + 0.0052 * o * (part * sum(others) + wave(0.7, 5.0))
        )

    found = said(function, k=0.5, m=0.4, s=0.3, o=0.1)
    assert found.sentence == "The records determine k, m and s. o is not determined (standard error 53 %)."


@pytest.mark.parametrize(
    ("error", "text"),
    [(0.016, "1.6 %"), (0.99, "99 %"), (0.998, "1 times its value"), (3.3, "3.3 times its value")],
)
def test_a_relative_error_is_written_without_powers_of_ten(error: float, text: str) -> None:
    assert percent(error) == text


def test_what_is_all_determined_is_said_in_one_sentence() -> None:
    found = said(lambda k, d, w: k * wave(d, w), k=0.5, d=0.3, w=3.0)
    assert found.statements == ()
    assert found.sentence.startswith("The records determine all parameters; the least certain is d (")


RIG = """
name = "stage"
summary = "A motor moves a mass against a spring; its gain is not known."
[inputs.u]
unit = "A"
[parameters.gain]
unit = "N/A"
log = true
[parameters.m]
unit = "kg"
log = true
[parameters.d]
unit = "N s/m"
lower = 0.0
[parameters.k]
unit = "N/m"
lower = 0.0
[parameters.x_off]
unit = "m"
[coordinates.x]
unit = "m"
[energy]
kinetic = "m*d(x)^2/2"
[joints.guide]
motion = "x"
damping = "d"
stiffness = "k"
[drives.motor]
signal = "u"
force = "gain*motor"
along = "x"
[sensors.position]
reads = "x - x_off"
unit = "m"
"""
VALUES = {"gain": 2.0, "m": 1.5, "d": 4.0, "k": 300.0, "x_off": 0.0}


def test_gain_and_inertia_of_a_rig_are_not_both_identifiable(tmp_path: Path) -> None:
    (tmp_path / "stage.toml").write_text(RIG, "utf-8")
    rng = np.random.default_rng(4)
    structure = compose(read_rig_file(tmp_path / "stage.toml"))
    t = 0.01 * np.arange(2000)
    given = Record("sweep", 0.01, {"u": np.sin(2.0 * t + 1.0 * t**2)}, {}, kind="sweep")
    clean = simulate(structure, VALUES, given, accuracy=1e-8)
    noise = 0.003 * float(np.std(clean["position"]))
    record = clean.with_signals(position=clean["position"] + noise * rng.standard_normal(t.size))
    scales = characteristic_scales(structure.rig, [record], VALUES)
    fit = GreyBoxFit(structure, [record], scales, {"position": noise})
    start = {**VALUES, "gain": 2.3, "m": 1.6, "d": 3.6}
    all_free = identifiability(information(fit, fit.fit(start, tuple(VALUES))))
    assert all_free.determined == ("x_off",)
    assert all_free.statements[0].startswith("gain, m, d and k only up to a common factor")
    ratios = {c.text: (c.value, c.std) for c in all_free.combinations}
    for text, truth in (("m/gain", 0.75), ("d/gain", 2.0), ("k/gain", 150.0)):
        value, std = ratios[text]
        assert 0.0 < std < 0.01 * truth
        assert abs(value - truth) < 4.0 * std
    result = fit.fit({**start, "gain": 2.0}, ("m", "d", "k", "x_off"))
    known = identifiability(information(fit, result))
    assert known.statements == ()
    for name in ("m", "d", "k"):
        # One sensor: residuals are white, and the two ways to a standard error agree.
        assert known.relative_errors[name] * result.values[name] == pytest.approx(
            result.standard_errors[name], rel=0.3
        )


MOTOR = """
name = "motor"
summary = "A motor turns its rotor freely; its speed is measured."
[inputs.u]
unit = "N m"
[parameters.J]
unit = "kg m^2"
log = true
[parameters.b]
unit = "N m s/rad"
lower = 0.0
[parameters.tau_off]
unit = "N m"
[coordinates.q]
unit = "rad"
[energy]
kinetic = "J*d(q)^2/2"
[joints.bearing]
motion = "q"
damping = "b"
force = "tau_off"
[drives.motor]
signal = "u"
force = "motor"
along = "q"
[sensors.speed]
reads = "d(q)"
unit = "rad/s"
"""


def test_a_constant_force_that_is_none_is_determined_beside_the_forces_that_move_the_rig(
    tmp_path: Path,
) -> None:
    (tmp_path / "motor.toml").write_text(MOTOR, "utf-8")
    values, rng = {"J": 0.01, "b": 0.04, "tau_off": 0.0}, np.random.default_rng(5)
    structure = compose(read_rig_file(tmp_path / "motor.toml"))
    u = np.repeat(rng.uniform(-0.2, 0.2, 8), 50)
    clean = simulate(structure, values, Record("steps", 0.02, {"u": u}, {}, hold="zoh"), accuracy=1e-8)
    record = clean.with_signals(speed=clean["speed"] + 0.1 * rng.standard_normal(u.size))
    scales = characteristic_scales(structure.rig, [record], values)
    fit = GreyBoxFit(structure, [record], scales, {"speed": 0.1})
    result = fit.fit(values, tuple(values))
    assert result.standard_errors["tau_off"] > 0.5 * abs(result.values["tau_off"])
    found = identifiability(information(fit, result))
    assert found.determined == ("J", "b", "tau_off")
    assert found.relative_errors["tau_off"] < 0.05


def test_a_small_part_of_a_sum_is_named_with_the_large_one_it_adds_to() -> None:
    found = said(
        lambda i, m, s: (i + 0.09 * m) * wave(0.3) + (s + 0.3 * m) * wave(0.5, 7.0), i=0.05, m=0.02, s=0.12
    )
    assert found.statements == ("i, m and s only as i + 0.09 m and s + 0.3 m.",)

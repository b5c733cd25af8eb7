"""Power-law damping: its limits are known laws, and a digressive damper is found with its power."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

from rigsight.effects import effect_named
from rigsight.effects import symbols as canonical
from rigsight.effects.symbols import derivative
from rigsight.excitation import linear_sweep
from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.records import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate

EFFECT = effect_named("power_law_damping")
SPEED = np.linspace(-3.0, 3.0, 61)


def force(power: float, speed: np.ndarray) -> np.ndarray:
    assert EFFECT.torque is not None
    numbers = {"c_p": 4.0, "n": power, "v_r": 2.0}
    law = EFFECT.torque.subs({sp.Symbol(name, real=True): value for name, value in numbers.items()})
    return np.asarray(sp.lambdify(canonical.v, law, "numpy")(speed))


@pytest.mark.parametrize(
    ("power", "known"),
    [
        (1.0, 4.0 * SPEED),
        (2.0, 4.0 / 2.0 * np.abs(SPEED) * SPEED),
        (0.0, 4.0 * 2.0 * np.sign(SPEED)),
    ],
)
def test_limits_are_viscous_damping_drag_and_dry_friction(power: float, known: np.ndarray) -> None:
    moves = np.abs(SPEED) > 0.09
    np.testing.assert_allclose(force(power, SPEED[moves]), known[moves], rtol=1e-3)
    assert force(power, np.zeros(1))[0] == 0.0


def test_a_digressive_damper_has_a_finite_slope_at_rest() -> None:
    assert EFFECT.torque is not None
    slope = derivative(EFFECT.torque, canonical.v).subs(
        {
            canonical.v: 0.0,
            **{sp.Symbol(k, real=True): x for k, x in (("c_p", 4.0), ("n", 0.5), ("v_r", 2.0))},
        }
    )
    assert 0.0 < float(slope) < 200.0


def test_the_power_of_a_digressive_damper_is_found_beside_viscous_damping() -> None:
    t, noise, rng = 0.005 * np.arange(1200), 1e-4, np.random.default_rng(0)
    numbers = {"gain": 1.0, "m": 1.2, "d": 1.5, "k": 400.0, "x_off": 0.0, "force_off": 0.0}
    structure, records = compose(AXIS, [EFFECT]), []
    for number, amplitude in enumerate((2.0, 10.0)):
        run = Record(f"sweep {number}", 0.005, {"u": linear_sweep(t, amplitude, 1.0, 6.0)}, {}, hold="zoh")
        moved = simulate(structure, {**numbers, "c_p": 6.0, "n": 0.6, "v_r": 1.0}, run)
        records.append(moved.with_signals(x=moved["x"] + noise * rng.standard_normal(t.size)))
    fit = GreyBoxFit(structure, records, characteristic_scales(AXIS, records, numbers), {"x": noise})
    start = {**numbers, "d": 5.0, "c_p": 2.0, "n": 1.3, "v_r": 1.0}
    found = fit.fit(start, ["m", "d", "k", "c_p", "n"])
    assert found.weighted_rms < 1.1
    assert found.values["n"] == pytest.approx(0.6, abs=4.0 * found.standard_errors["n"])
    assert found.values["c_p"] == pytest.approx(6.0, rel=0.1)

"""States that follow a motion linearly are those that the engine gives, whatever effect declares them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp

from rigsight.discover.library import is_filter, offered_effects, states_along
from rigsight.discover.motion import Motion
from rigsight.effects import CATALOGUE, Effect, effect_named
from rigsight.effects.effect import State
from rigsight.effects.symbols import u
from rigsight.records import Record
from rigsight.records.record import Hold
from rigsight.rigs import AXIS
from rigsight.simulate import compose, record_input, simulate_outputs

LAG = effect_named("actuator_lag")
T_a, u_a, u_rate = sp.symbols("T_a u_a u_rate", real=True)
RESONANT = replace(
    LAG,
    name="resonant_valve",
    drive=u_a,
    states=(
        State(u_a, u_rate, "input"),
        State(u_rate, (u - u_a) / T_a**2 - u_rate / T_a, "input time^-1"),
    ),
)
"""A lag of second order, which no file of the catalogue declares."""


def motion_under(signal: np.ndarray, hold: Hold) -> Motion:
    record = Record(name="run", dt=5e-3, signals={"u": signal}, units={}, hold=hold)
    nothing = np.zeros_like(signal)
    return Motion(record, nothing, nothing, nothing, signal, nothing)


@pytest.mark.parametrize("effect", [LAG, RESONANT], ids=lambda effect: effect.name)
@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_a_filter_of_the_drive_is_what_the_engine_gives(
    effect: Effect, hold: Hold, sweep: Callable[[float, float], np.ndarray]
) -> None:
    signal = 0.3 + sweep(1.0, 5.0)
    values = {"T_a": 0.03}
    motion = motion_under(signal, hold)
    # A velocity that is the drive over the damping, on an axis almost without inertia and without a spring.
    structure = compose(AXIS, [effect])
    numbers = {
        "gain": 1.0,
        "m": 1.0,
        "d": 0.0,
        "k": 0.0,
        "x_off": 0.0,
        "force_off": 0.0,
        **values,
    }
    p = np.array([numbers[name] for name in structure.names])
    start = np.zeros(len(structure.states))
    start[[state.name.split(".")[-1] for state in structure.states].index("u_a")] = signal[0]
    x = simulate_outputs(structure, record_input(structure, motion.record), p, start, signal.size, 1e-9)[:, 0]
    drive = states_along(effect, values, motion)["u_a"]
    assert drive[0] == pytest.approx(signal[0])
    # Twice integrated by the free mass.
    bend = (x[2:] - 2.0 * x[1:-1] + x[:-2]) / motion.dt**2
    assert np.sqrt(np.mean((bend - drive[1:-1]) ** 2)) < 0.005 * np.std(drive)


def test_what_the_declaration_says_decides_what_is_a_filter() -> None:
    assert is_filter(RESONANT)
    filters = {effect.name for effect in CATALOGUE if is_filter(effect)}
    assert filters >= {"actuator_lag", "flexible_mode", "maxwell_branch"}
    assert filters.isdisjoint({"bouc_wen_hysteresis", "backlash", "sensor_lag", "cubic_stiffness"})
    (state,) = LAG.states
    assert not is_filter(replace(LAG, states=(replace(state, rate=state.rate * sp.Abs(u)),)))
    assert not is_filter(replace(LAG, states=(replace(state, limit=T_a),)))


def test_a_mass_that_rides_along_is_not_offered() -> None:
    names = {effect.name for effect in offered_effects(AXIS, has_stiffness=True)}
    assert "actuator_lag" in names
    assert "flexible_mode" not in names

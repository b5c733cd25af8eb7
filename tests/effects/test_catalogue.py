"""What every effect of the catalogue promises, measured on one mass with a spring."""

from __future__ import annotations

import importlib
import itertools
import pkgutil

import numpy as np
import pytest
from numpy.typing import NDArray

import rigsight.effects
from rigsight.effects import CATALOGUE, Effect, Energy, GainTrend, Place, effect_named
from rigsight.errors import InputError, SimulationError
from rigsight.records.record import Record
from rigsight.rigs import AXIS, RIGS
from rigsight.simulate import compose, simulate
from rigsight.units import characteristic_value, parse_dimension

VALUES = {"gain": 1.0, "m": 1.0, "d": 2.0, "k": 100.0, "x_off": 0.0, "force_off": 0.0}
RESONANCE = 10.0
PER_PERIOD = 200
OMEGA = 0.25 * RESONANCE
"""Low enough that the third harmonic of stick-slip does not meet the resonance."""
FULL, SMALL = 1.0, 0.3
"""Amplitudes of the two sine tests."""

each_effect = pytest.mark.parametrize("effect", CATALOGUE, ids=lambda effect: effect.name)
each_effect_of_an_axis = pytest.mark.parametrize(
    "effect", [effect for effect in CATALOGUE if AXIS.offers(effect)], ids=lambda effect: effect.name
)
"""Those of the lateral motion are tested in test_lateral.py."""


def linear_amplitude(omega: float = OMEGA) -> float:
    return FULL / abs(VALUES["k"] - VALUES["m"] * omega**2 + 1j * VALUES["d"] * omega)


def scales() -> dict[str, float]:
    x = linear_amplitude()
    return {"x": x, "force": VALUES["k"] * x, "drive": FULL, "input": FULL, "time": 1.0 / RESONANCE}


def sine_record(amplitude: float, n_periods: int, omega: float = OMEGA) -> Record:
    dt = 2.0 * np.pi / omega / PER_PERIOD
    time = dt * np.arange(n_periods * PER_PERIOD + 1)
    return Record(name="sine", dt=dt, signals={"u": amplitude * np.sin(omega * time)}, units={"u": "input"})


def start_values(effect: Effect) -> list[dict[str, float]]:
    """All combinations of the effect's first two start values."""
    choices = []
    for p in effect.parameters:
        size = characteristic_value(p.dimension, scales())
        starts = [start * size for start in p.starts[:2]] if p.starts else [p.default]
        choices.append([(p.name, value) for value in starts])
    return [{**VALUES, **dict(choice)} for choice in itertools.product(*choices)]


def box_values(effect: Effect) -> list[dict[str, float]]:
    """Corners of the search box and random points in it, as far as a search goes there."""
    rng = np.random.default_rng(11)
    fitted = [p for p in effect.parameters if p.fitted]
    corners = list(itertools.product(*[p.search for p in fitted]))
    inside = [tuple(rng.uniform(*p.search) for p in fitted) for _ in range(5)]
    points = []
    for point in corners + inside:
        own = {
            p.name: c * characteristic_value(p.dimension, scales())
            for p, c in zip(fitted, point, strict=True)
        }
        own |= {p.name: p.default for p in effect.parameters if not p.fitted}
        # A negative sum lets the memory grow without end; a search moves the sum itself, from zero upwards.
        if all(own[pair.first] + own[pair.second] >= 0.0 for pair in effect.searched_as):
            points.append({**VALUES, **own})
    return points


def last_period(samples: NDArray[np.float64]) -> NDArray[np.float64]:
    return samples[-PER_PERIOD - 1 : -1]


@each_effect_of_an_axis
def test_null_values_give_the_rig_exactly(effect):
    record = sine_record(FULL, 3)
    values = {**start_values(effect)[0], **effect.null_values()}
    assert effect.null_values()
    with_effect = simulate(compose(AXIS, [effect]), values, record)["x"]
    np.testing.assert_array_equal(with_effect, simulate(compose(AXIS), VALUES, record)["x"])


@each_effect_of_an_axis
def test_effect_vanishes_towards_its_null_values(effect):
    """Close to null the response is close to the rig's; leaving the effect out there is no jump."""
    record = sine_record(FULL, 3)
    values = dict(start_values(effect)[0])
    for name, null in effect.null_values().items():
        values[name] = null - 1e-6 if null == 1.0 else (null / 2.0 if null else 1e-4 * values[name])
    near = simulate(compose(AXIS, [effect]), values, record)["x"]
    np.testing.assert_allclose(
        near, simulate(compose(AXIS), VALUES, record)["x"], atol=1e-3 * linear_amplitude()
    )


@each_effect_of_an_axis
def test_energy_over_a_cycle(effect):
    """In a steady cycle the drive's work is the damper's loss and the effect's: the effect never gives."""
    if effect.place is not Place.DYNAMICS:
        pytest.skip("no force on the mass")
    for omega in (0.4 * RESONANCE, 0.9 * RESONANCE):
        record = sine_record(SMALL, 40, omega)
        for values in start_values(effect):
            x = simulate(compose(AXIS, [effect]), values, record)["x"]
            cycle, before = last_period(x), x[-2 * PER_PERIOD - 1 : -PER_PERIOD - 1]
            if np.max(np.abs(cycle - before)) > 1e-3 * np.ptp(cycle):
                continue
            dt = record.dt
            step = np.diff(np.append(cycle, cycle[0]))
            force = last_period(record["u"])
            work = np.sum(0.5 * (force + np.roll(force, -1)) * step)
            damper = VALUES["d"] * np.sum(step**2) / dt
            size = abs(work) + damper
            if effect.energy is Energy.DISSIPATIVE:
                assert work - damper >= -5e-3 * size
            elif effect.energy is Energy.CONSERVATIVE:
                assert abs(work - damper) <= 5e-3 * size


@each_effect_of_an_axis
def test_finite_on_the_whole_search_box(effect):
    record = sine_record(FULL, 3)
    structure = compose(AXIS, [effect])
    may_escape = any(p.null is not None and p.search[0] < p.null for p in effect.parameters)
    for values in box_values(effect):
        try:
            x = simulate(structure, values, record)["x"]
        except SimulationError:
            # A spring that softens to nothing lets the mass go: told, and only where the sign is free.
            assert may_escape, values
            assert effect.energy is Energy.CONSERVATIVE, values
        else:
            assert np.all(np.isfinite(x))


@each_effect_of_an_axis
def test_accuracy_wish_is_met(effect):
    record = sine_record(FULL, 4)
    structure = compose(AXIS, [effect])
    for values in start_values(effect)[:2]:
        exact = simulate(structure, values, record, accuracy=1e-9)["x"]
        for accuracy in (1e-4, 1e-6):
            error = simulate(structure, values, record, accuracy=accuracy)["x"] - exact
            assert np.sqrt(np.mean(error**2)) <= accuracy * np.std(exact)


def harmonics(effect: Effect, amplitude: float) -> NDArray[np.complex128]:
    values = start_values(effect)[0]
    if effect.name == "gravity_pendulum":
        # This axis turns through a hundredth of a radian only.
        values["k_g"] *= 20.0
    x = simulate(compose(AXIS, [effect]), values, sine_record(amplitude, 40))["x"]
    return np.fft.rfft(last_period(x))[:4] / (PER_PERIOD / 2) / amplitude


@each_effect_of_an_axis
def test_signature_is_the_measured_one(effect):
    small, full = harmonics(effect, SMALL), harmonics(effect, FULL)
    change = abs(full[1]) / abs(small[1]) - 1.0
    trend = GainTrend.RISES if change > 1e-4 else GainTrend.FALLS if change < -1e-4 else GainTrend.STEADY
    assert trend is effect.signature.gain_trend, change
    even = max(abs(full[0]) / 2.0, abs(full[2])) / abs(full[1])
    assert (even > 1e-3) == effect.signature.even_harmonics, even


def test_softening_spring_shows_the_other_trend():
    """The declared signature is that of the first start value; the sign of a stiffness turns it round."""
    cubic = effect_named("cubic_stiffness")
    values = start_values(cubic)[1]
    assert values["k_3"] < 0.0
    gains = [
        np.ptp(last_period(simulate(compose(AXIS, [cubic]), values, sine_record(a, 40))["x"])) / a
        for a in (SMALL, FULL)
    ]
    assert gains[1] > gains[0]


@each_effect
def test_declaration_is_complete(effect):
    module = importlib.import_module(f"rigsight.effects.{effect.name}")
    assert getattr(module, effect.name.upper()) is effect
    text = module.__doc__ or ""
    for heading in ("Equation\n--------", "Applies to", "Signature:", "References:"):
        assert heading in text, heading
    assert text.count("``") >= 2
    assert effect.summary.endswith(".")
    parts = (effect.torque, effect.spring, effect.deflection, effect.drive, effect.delay)
    parts += (effect.lateral, effect.measured, effect.measured_late)
    equations = [part for part in parts if part is not None] + [state.rate for state in effect.states]
    equations += [state.limit for state in effect.states if state.limit is not None]
    assert equations
    used = {symbol.name for equation in equations for symbol in equation.free_symbols}
    for p in effect.parameters:
        assert p.name in used, f"{p.name} is declared but in no equation"
        assert f"{p.name} " in text or f"{p.name}:" in text, f"{p.name} is not explained"
        assert p.lower < p.upper
        if p.fitted:
            assert p.starts
            assert all(p.search[0] <= start <= p.search[1] for start in p.starts)
            assert p.default is not None or p.null is not None or p.logarithmic or p.search[0] < p.search[1]
        for value in (p.null, p.default):
            assert value is None or p.lower <= value <= p.upper
    assert all(parent != effect.name and effect_named(parent) for parent in effect.parents)
    names = {p.name for p in effect.parameters}
    assert set(effect.special_cases) <= names
    assert all({pair.first, pair.second} <= names for pair in effect.searched_as)


def test_no_effect_is_missed():
    shared = {"catalogue", "effect", "symbols"}
    files = {module.name for module in pkgutil.iter_modules(rigsight.effects.__path__)} - shared
    assert files == {effect.name for effect in CATALOGUE}
    assert len(CATALOGUE) == len({effect.name for effect in CATALOGUE})


@pytest.mark.parametrize("rig", RIGS.values(), ids=lambda rig: rig.name)
@each_effect
def test_units_render_on_every_rig_that_offers_the_effect(effect, rig):
    if not rig.offers(effect):
        with pytest.raises(InputError, match=effect.name):
            compose(rig, [effect])
        return
    for p in effect.parameters:
        unit = rig.with_unit(p).unit
        assert unit
        for base in parse_dimension(p.dimension):
            assert base not in unit.split() or rig.units[base] == base, unit


def test_unknown_effect_names_the_nearest():
    with pytest.raises(InputError, match="Did you mean 'coulomb_friction'"):
        effect_named("colomb_friction")

"""The checks that every effect of the catalogue passes, measured on one mass with a spring."""

from __future__ import annotations

import importlib
import pkgutil

import numpy as np
import pytest
from numpy.typing import NDArray

import rigsight.effects
from rigsight.effects import CATALOGUE, Effect, Energy, GainTrend, Place, effect_named, placed
from rigsight.errors import InputError
from rigsight.rigs import AXIS, RIGS
from rigsight.simulate import compose, simulate
from rigsight.units import parse_dimension
from rigsight.workflow.own.effect_benches import bench_of
from rigsight.workflow.own.effect_checks import (
    CHECKS,
    FULL,
    PER_PERIOD,
    SMALL,
    energy_of_cycles,
    is_found_again,
    last_period,
    sine_record,
    start_values,
)
from rigsight.workflow.own.effect_declaration import declaration_faults

each_effect = pytest.mark.parametrize("effect", CATALOGUE, ids=lambda effect: effect.name)
each_effect_of_one_motion = pytest.mark.parametrize(
    "effect", [effect for effect in CATALOGUE if effect.lateral is None], ids=lambda effect: effect.name
)
"""Those of the lateral motion are tested in test_lateral.py."""


@each_effect_of_one_motion
@pytest.mark.parametrize(
    "check", [p for p in CHECKS if p is not is_found_again], ids=lambda check: check.__name__
)
def test_a_check_is_passed(effect, check):
    """The checks that a user's own effect has to pass too; tests/identify/test_recovery.py holds the last."""
    assert check(effect) is None


@pytest.mark.parametrize(
    "effect",
    [e for e in CATALOGUE if e.place is Place.DYNAMICS and e.energy is not Energy.ACTIVE],
    ids=lambda effect: effect.name,
)
def test_the_energy_of_most_cycles_is_judged(effect):
    """The check of energy passes over motions that do not settle: it would pass if none did."""
    n_cases = 2 * len(start_values(effect))
    assert len(energy_of_cycles(effect)) >= 0.5 * n_cases


@each_effect_of_one_motion
def test_accuracy_wish_is_met(effect):
    bench = bench_of(effect)
    record = sine_record(FULL, 4, bench=bench)
    structure = compose(bench.rig, [effect])
    for values in start_values(effect)[:2]:
        exact = simulate(structure, values, record, accuracy=1e-9)[bench.output]
        for accuracy in (1e-4, 1e-6):
            error = simulate(structure, values, record, accuracy=accuracy)[bench.output] - exact
            assert np.sqrt(np.mean(error**2)) <= accuracy * np.std(exact)


def harmonics(effect: Effect, amplitude: float) -> NDArray[np.complex128]:
    values, bench = start_values(effect)[0], bench_of(effect)
    if effect.name == "gravity_pendulum":
        # This axis turns through a hundredth of a radian only.
        values["k_g"] *= 20.0
    x = simulate(compose(bench.rig, [effect]), values, sine_record(amplitude, 40, bench=bench))[bench.output]
    return np.fft.rfft(last_period(x))[:4] / (PER_PERIOD / 2) / amplitude


@each_effect_of_one_motion
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
    assert declaration_faults(effect) == ()
    text = module.__doc__ or ""
    for heading in ("Equation\n--------", "Applies to", "Signature:", "References:"):
        assert heading in text, heading
    assert text.count("``") >= 2
    assert effect.summary.endswith(".")
    for p in effect.parameters:
        assert f"{p.name} " in text or f"{p.name}:" in text, f"{p.name} is not explained"
    assert all(parent != effect.name and effect_named(parent) for parent in effect.parents)


def test_no_effect_is_missed():
    shared = {"catalogue", "effect", "kinds", "placed", "symbols"}
    files = {module.name for module in pkgutil.iter_modules(rigsight.effects.__path__)} - shared
    assert files == {effect.name for effect in CATALOGUE}
    assert len(CATALOGUE) == len({effect.name for effect in CATALOGUE})


@pytest.mark.parametrize(
    "rig", [rig for rig in RIGS.values() if rig.has_one_motion], ids=lambda rig: rig.name
)
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


def test_an_encoder_of_speed_has_no_error_over_position() -> None:
    car, eccentric = RIGS["quarter_car"], effect_named("encoder_eccentricity")
    assert car.offers(placed(eccentric, "travel"))
    assert not car.offers(placed(eccentric, "body"))


@pytest.mark.parametrize(
    ("name", "holds"),
    [("directional_friction", True), ("directional_damping", False), ("asymmetric_stiffness", False)],
)
def test_only_the_mean_of_a_force_of_the_direction_alone_is_that_of_a_constant_force(
    name: str, holds: bool
) -> None:
    assert effect_named(name).holds_constant_force is holds

"""Noise of a measured input: what it leaves in a free run, and terms that imitate it there."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.campaign import Campaign
from rigsight.discover.along_motion import AlongMotion
from rigsight.discover.bench import Attempt, Bench
from rigsight.discover.input_noise import error_of_inputs
from rigsight.discover.selection import _Search, select
from rigsight.discover.terms import known_terms
from rigsight.excitation import linear_sweep
from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.records import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate

KNOWN = known_terms()
CUBIC, LAG, DELAY, DRAG = (
    KNOWN[name] for name in ("cubic_stiffness", "actuator_lag", "input_delay", "quadratic_damping")
)
VALUES = {"gain": 1.0, "m": 1.2, "d": 1.5, "k": 400.0, "x_off": 0.0, "force_off": 0.0}
T = 5e-3 * np.arange(1600)
NOISE = {"x": 2e-5}


def records(effects: dict[str, float], of_input: float, seed: int) -> tuple[Record, ...]:
    """Sweeps of two amplitudes, with noise of the sensors of input and position."""
    rng, found = np.random.default_rng(seed), []
    structure = compose(AXIS, [e for e in (CUBIC, LAG, DRAG) if e.parameters[0].name in effects])
    for amplitude in (3.0, 8.0):
        u = linear_sweep(T, amplitude, 2.0, 40.0)
        run = simulate(
            structure, {**VALUES, **effects}, Record(f"{amplitude} N", 5e-3, {"u": u}, {}, hold="foh")
        )
        noisy = {
            n: run[n] + rng.normal(scale=s, size=T.size) for n, s in (("u", of_input), ("x", NOISE["x"]))
        }
        found.append(run.with_signals(**noisy))
    return tuple(found)


def bench_of(measured: tuple[Record, ...], names: tuple[str, ...]) -> tuple[Bench, AlongMotion]:
    effects = {name: KNOWN[name] for name in names}
    along = AlongMotion.of(
        Campaign("axis", AXIS, {"gain": 1.0}, {}, measured), VALUES, list(effects.values())
    )
    assert along is not None
    bench = Bench(
        rig=AXIS, estimation=measured, held_out=measured, values=VALUES, scales=characteristic_scales(AXIS, measured, VALUES),
        noise=NOISE, held=frozenset({"gain", "force_off"}), effects=effects,
    )  # fmt: skip
    return bench, along


@pytest.mark.parametrize("of_input", [0.0, 0.2])
def test_the_error_that_noise_of_the_input_leaves_is_known_from_its_fastest_changes(of_input: float) -> None:
    measured = records({}, of_input, 0)
    fit = GreyBoxFit(compose(AXIS), measured, characteristic_scales(AXIS, measured, VALUES), NOISE).fit(
        VALUES, []
    )
    of_inputs = error_of_inputs(fit, measured, NOISE)
    assert fit.weighted_rms == pytest.approx(np.hypot(1.0, of_inputs), rel=0.25)
    assert (of_inputs > 5.0) == (of_input > 0.0)


@pytest.mark.parametrize(
    ("damping", "kept"),
    [({}, {"cubic_stiffness"}), ({"c_2": 3.0}, {"cubic_stiffness", "quadratic_damping"})],
)
def test_what_imitates_noise_of_the_input_is_no_term_and_what_acts_is_one(
    damping: dict[str, float], kept: set[str]
) -> None:
    # In this draw a damper of the third power takes a sixth of the error of free runs.
    names = (
        "cubic_stiffness",
        "quadratic_damping",
        "monomial_x0_v3",
        "monomial_x1_v2",
        "asymmetric_stiffness",
    )
    bench, along = bench_of(records({"k_3": 4e5, **damping}, 0.2, 17), names)
    (linear,) = bench.trials_of([Attempt(frozenset(), [VALUES])])
    selection = select(bench, linear, along, lambda _: None)
    assert selection.best.support == kept
    assert selection.best.error_over_noise > 10.0


def test_a_delay_is_exchanged_for_a_lag_as_late_and_neither_is_asked_in_draws(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    lagging = {"k_3": 5e4, "T_a": 0.012}
    bench, along = bench_of(records(lagging, 0.0, 0), (CUBIC.name, LAG.name, DELAY.name))
    start = Attempt(frozenset({CUBIC.name, DELAY.name}), [{**VALUES, "k_3": 5e4, "T_d": 0.012}])
    (delayed,) = bench.trials_of([start])
    (attempt,) = _Search(bench, along, lambda _: None).exchanged(delayed)
    assert attempt.support == {CUBIC.name, LAG.name}
    assert attempt.starts[0]["T_a"] == pytest.approx(delayed.fit.values["T_d"])
    # The cubic spring may have made up for the difference of both.
    assert [own["k_3"] == 0.0 for own in attempt.starts] == [False, True]
    (lagged,) = bench.trials_of([attempt])
    assert lagged.error_over_noise < 1.1 < 3.0 < delayed.error_over_noise
    assert lagged.fit.values["T_a"] == pytest.approx(0.012, rel=0.01)
    # What is late looks like smoothing to the regression, so its share of draws says nothing.
    monkeypatch.setattr(
        "rigsight.discover.along_motion.inclusion_probabilities", lambda terms, *_: np.ones(terms.shape[1])
    )
    assert along.inclusion(lagged.fit, np.random.default_rng(0)).keys() == {CUBIC.name}


def test_at_its_end_the_search_exchanges_a_term_for_every_form_that_contains_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    wider = ("bouc_wen_hysteresis", "iwan_hysteresis", "lugre_friction")
    bench, along = bench_of(records({}, 0.0, 0), ("coulomb_friction", "presliding_friction", *wider))
    start = Attempt(frozenset({"presliding_friction"}), [{**VALUES, "T_c": 0.1, "x_p": 1e-4}])
    (rubbing,) = bench.trials_of([start])
    monkeypatch.setattr(_Search, "_instead", lambda _, trial, *names: [Attempt(frozenset(names), [])])
    found = _Search(bench, along, lambda _: None).generalized(rubbing)
    assert {attempt.support for attempt in found} == {
        frozenset({"presliding_friction", form}) for form in wider
    }

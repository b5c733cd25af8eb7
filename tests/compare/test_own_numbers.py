"""What one record asks of one number: the change that was made, with the scatter that further records show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rigsight.compare import check_numbers, free_run, own_numbers, suspects
from rigsight.excitation import linear_sweep
from rigsight.records import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate
from rigsight.simulate.model import Model

VALUES = {"gain": 1.0, "m": 2.0, "d": 5.0, "k": 800.0, "x_off": 0.0, "force_off": 0.0}
NOISE = {"x": 5e-5}
MODEL = Model.of(compose(AXIS), VALUES, "foh")


def record(seed: int, gain: float = 1.0, **changed: float) -> Record:
    """Return a sweep with a slow disturbing force and noise."""
    rng, t = np.random.default_rng(seed), 0.01 * np.arange(1500)
    u = linear_sweep(t, 2.0 + rng.random(), 3.0, 50.0)
    slow = np.convolve(rng.standard_normal(t.size + 19), np.full(20, 0.05), "valid")
    moved = simulate(MODEL.structure, {**VALUES, **changed}, Record("r", 0.01, {"u": u + 0.3 * slow}, {}))
    return moved.with_signals(u=u, x=gain * moved["x"] + rng.normal(0.0, NOISE["x"], t.size))


@pytest.fixture(scope="module")
def known() -> list:
    return [own_numbers(MODEL, [record(seed)], NOISE) for seed in range(6)]


@pytest.mark.parametrize(
    ("name", "change", "changed"),
    [("k", 8.0, {"k": 808.0}), ("d", 0.4, {"d": 5.4}), ("gain of x", 0.06, {"gain": 1.06})],
)
def test_a_small_change_is_found_with_its_size(name: str, change: float, changed: dict, known: list) -> None:
    own = own_numbers(MODEL, [record(12, **changed)], NOISE)
    checks = {check.number.name: check for check in check_numbers("r", own, known, 0.01)}
    found = checks[name]
    assert found.closed
    assert found.p_value < 0.01
    assert found.number.change == pytest.approx(change, abs=found.allowed)


def test_true_records_rarely_ask_for_a_change(known: list) -> None:
    p_values = [
        check.p_value
        for seed in range(20, 60)
        for check in check_numbers("r", own_numbers(MODEL, [record(seed)], NOISE), known, 0.05)
    ]
    assert np.mean(np.array(p_values) < 0.05) < 0.08
    assert np.mean(np.array(p_values) < 0.5) > 0.2


def test_what_a_record_does_not_determine_is_not_compared(known: list) -> None:
    own = own_numbers(MODEL, [record(400)], NOISE)
    faint = [replace(number, information=1e-12 * number.information, change=1e9) for number in own]
    assert check_numbers("r", faint, known, 0.05) == []
    assert len(check_numbers("r", own, known, 0.05)) == len(own)


def test_windows_add_up(known: list) -> None:
    one = record(3, k=820.0)
    whole = {own.name: own for own in own_numbers(MODEL, [one], NOISE)}
    halves = {own.name: own for own in own_numbers(MODEL, [one.slice(0, 750), one.slice(750, 1500)], NOISE)}
    assert halves["k"].change == pytest.approx(whole["k"].change, rel=0.1)
    assert halves["k"].information < whole["k"].information * 1.01


def test_the_changed_number_explains_the_gap() -> None:
    one = record(5, k=720.0)
    found = suspects(MODEL, [one], free_run(MODEL, one, [one], NOISE), NOISE)
    assert (found[0].what, found[0].where) == ("k", "dynamics")
    assert found[0].share > 0.95
    assert found[0].after == pytest.approx(720.0, rel=0.01)

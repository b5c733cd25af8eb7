"""Held-out records choose nothing: they only show what the chosen equation leaves of them."""

from __future__ import annotations

import numpy as np

from rigsight.discover.bench import Attempt, Bench
from rigsight.discover.selection import select
from rigsight.effects import effect_named
from rigsight.excitation import linear_sweep
from rigsight.identify import characteristic_scales
from rigsight.records import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate

CUBIC = effect_named("cubic_stiffness")
VALUES = {"gain": 1.0, "m": 1.0, "d": 3.0, "k": 400.0, "x_off": 0.0, "force_off": 0.0}
NOISE = 1e-5


def test_a_held_out_record_of_another_rig_chooses_no_term() -> None:
    t, rng, records = 5e-3 * np.arange(400), np.random.default_rng(1), []
    for amplitude, role, k_3 in (
        (1.0, "estimation", 4e6),
        (4.0, "estimation", 4e6),
        (4.0, "validation", 0.0),
    ):
        drawn = Record(role, 5e-3, {"u": linear_sweep(t, amplitude, 2.0, 40.0)}, {}, hold="foh", role=role)
        run = simulate(compose(AXIS, [CUBIC]), {**VALUES, "k_3": k_3}, drawn)
        records.append(run.with_signals(x=run["x"] + rng.normal(scale=NOISE, size=t.size)))
    bench = Bench(
        rig=AXIS, estimation=tuple(records[:2]), held_out=tuple(records[2:]), values=VALUES,
        scales=characteristic_scales(AXIS, records[:2], VALUES), noise={"x": NOISE},
        held=frozenset({"gain", "force_off"}), effects={CUBIC.name: CUBIC},
    )  # fmt: skip
    # The held-out record has no cubic spring, so it would choose the equation without it, at these numbers.
    start = Attempt(frozenset(), [VALUES])
    (linear,) = bench.trials_of([start])
    selection = select(bench, linear, None, lambda _: None)
    assert selection.best.support == {CUBIC.name}
    assert selection.best.error_over_noise < 1.1
    errors = bench.held_out_errors(selection.trials)
    assert errors.keys() == {frozenset(), frozenset({CUBIC.name})}
    assert errors[selection.best.support] > errors[frozenset()] > 10.0

"""The stretches of the records at which candidates are first looked at."""

from __future__ import annotations

import numpy as np

from rigsight.diagnose.fit_context import FitContext
from rigsight.effects import effect_named
from rigsight.excitation import linear_sweep
from rigsight.identify import characteristic_scales
from rigsight.identify.fit.windows import liveliest
from rigsight.records import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate

VALUES = {"gain": 1.0, "m": 1.0, "d": 1.0, "k": 100.0, "x_off": 0.0, "force_off": 0.0}
MODE = {"m_a": 0.02, "w_a": 40.0, "zeta_a": 0.02}
DT, N = 0.01, 12_000


def at_rate(record: Record) -> float:
    """Return the angular frequency of the sweep in the middle of a stretch of the record."""
    middle = record.t0 + 0.5 * record.n_samples * DT
    return 2.0 + (50.0 - 2.0) * middle / (N * DT)


def test_one_more_effect_is_looked_for_where_the_model_leaves_most() -> None:
    """The motion is strongest at 10 rad/s, the missing resonance is at 40 rad/s."""
    t = DT * np.arange(N)
    u = linear_sweep(t, 1.0, 2.0, 50.0)
    swept = Record("sweep", DT, {"u": u}, {}, role="estimation", hold="foh")
    record = simulate(compose(AXIS, [effect_named("flexible_mode")]), VALUES | MODE, swept)
    scales = characteristic_scales(AXIS, (record,), VALUES)
    look = liveliest((record,), AXIS, 2000)
    context = FitContext(AXIS, (record,), (record,), look, scales, {"x": 1e-5}, frozenset({"force_off"}))
    fit = context.problem(context.composed(), (record,)).fit(VALUES, ["m", "d", "k"])
    (seen,), (left,) = context.look, context.looking_at_residual(fit).look
    assert 5.0 < at_rate(seen) < 15.0
    assert 30.0 < at_rate(left) < 50.0
    assert left.n_samples == 8000


def test_without_residuals_the_most_excited_stretches_stay() -> None:
    t = DT * np.arange(3000)
    record = Record("sweep", DT, {"u": linear_sweep(t, 1.0, 2.0, 50.0), "x": np.sin(t)}, {}, hold="foh")
    scales = {"time": 0.1, "x": 1.0, "input": 1.0, "drive": 1.0}
    context = FitContext(AXIS, (record,), (record,), (record,), scales, {"x": 1e-5}, frozenset())
    fit = context.problem(context.composed(), (record.slice(0, 100),)).fit({**VALUES, "k": -1e9}, [])
    assert not fit.residuals
    assert context.looking_at_residual(fit) is context

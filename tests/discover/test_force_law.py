"""The equation of a hysteretic force comes from the rate that its effect declares."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp

from rigsight.discover.bench import Bench
from rigsight.discover.ensembles import ForceLaw, force_equation
from rigsight.discover.hysteresis import is_loop
from rigsight.discover.motion import Motion, Rows
from rigsight.discover.one_motion import regressed_force
from rigsight.discover.regression import Projected, Regressed
from rigsight.effects import CATALOGUE, effect_named
from rigsight.effects.symbols import deflection_rate
from rigsight.identify import FitResult
from rigsight.records import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose

BOUC_WEN = effect_named("bouc_wen_hysteresis")
(Z,) = BOUC_WEN.states
A, beta = sp.symbols("A beta", real=True)
DAHL = replace(
    BOUC_WEN,
    name="dahl_hysteresis",
    states=(replace(Z, rate=A * deflection_rate - beta * sp.Abs(deflection_rate) * Z.symbol**3),),
)
"""A law of another form, which no file of the catalogue declares."""


def test_the_terms_are_those_of_the_declared_rate() -> None:
    law = ForceLaw.of(BOUC_WEN)
    assert law is not None
    assert list(law.terms) == ["x'", "|x'| |F|^(n-1) F", "x' |F|^n", "F", "x"]
    assert law.parameters == {"x'": "A", "|x'| |F|^(n-1) F": "beta", "x' |F|^n": "gamma"}


def test_only_a_force_of_one_free_state_has_a_law() -> None:
    loops, laws = ({e.name for e in CATALOGUE if found(e)} for found in (is_loop, ForceLaw.of))
    assert laws <= loops
    assert loops >= {"bouc_wen_hysteresis", "iwan_hysteresis"}
    assert loops.isdisjoint({"maxwell_branch", "coulomb_friction", "backlash", "cubic_stiffness"})
    assert "bouc_wen_hysteresis" in laws
    assert "iwan_hysteresis" not in laws


def test_another_declaration_is_regressed_without_new_code() -> None:
    law = ForceLaw.of(DAHL)
    assert law is not None
    # A force of that law, driven back and forth at a rising amplitude.
    dt, fine = 1e-3, 20
    t = dt / fine * np.arange(8000 * fine)
    v = (0.5 + 0.2 * t) * np.cos(5.0 * t)
    x = np.cumsum(v) * dt / fine
    stiffness, softening = 40.0, 0.02
    force = np.zeros_like(t)
    for i in range(1, t.size):
        rate = stiffness * v[i - 1] - softening * abs(v[i - 1]) * force[i - 1] ** 3
        force[i] = force[i - 1] + dt / fine * rate
    x, v, force = x[::fine], v[::fine], force[::fine]
    force += np.random.default_rng(0).normal(scale=1e-3 * np.std(force), size=force.size)
    record = Record(name="run", dt=dt, signals={"u": x}, units={})
    motion = Motion(record, x, v, np.gradient(v, dt), x, x)
    found = force_equation(law, [motion], Rows(0.1), [force], {"n": 1.0}, np.random.default_rng(0))
    shown = {name for name, share in found.inclusion.items() if share > 0.9}
    assert shown == {"x'", "|x'| F^3"}
    assert found.coefficients["x'"] == pytest.approx(stiffness, rel=0.02)
    assert found.coefficients["|x'| F^3"] == pytest.approx(softening, rel=0.02)


def test_springs_act_about_the_rest_that_was_fitted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever rest the motion was smoothed about, the force that is left for the loop is the same."""
    seen: list[np.ndarray] = []

    def kept(_law: ForceLaw, _motions: object, _rows: object, forces: list[np.ndarray], *_: object) -> None:
        seen.extend(forces)

    monkeypatch.setattr("rigsight.discover.one_motion.force_equation", kept)
    structure = compose(AXIS, [BOUC_WEN, effect_named("cubic_stiffness")])
    values = {"gain": 0.8, "m": 0.5, "d": 1.5, "k": 120.0, "x_off": 2e-3, "force_off": 0.0}
    values |= {"k_3": 4e5, "a": 0.25, "A": 1.0, "beta": 1200.0, "gamma": 500.0, "n": 1.0}
    fit = FitResult(structure, True, "", values, {}, (), 1.0, 1, 1, (), np.zeros((0, 0)), ())
    x, v, acceleration, u = np.random.default_rng(0).normal(scale=5e-3, size=(4, 50))
    for rest in (0.0, 2e-3):
        projected = Projected(np.ones((4, 1)), np.ones(4), 4.0)
        bench = Bench(AXIS, (), (), {**values, "x_off": rest}, {}, {}, frozenset())
        motion = Motion(Record("run", 1e-3, {"u": u}, {}), x - rest, v, acceleration, u, x - rest)
        regressed = Regressed([motion], Rows(0.1), projected, {}, driven=True)
        regressed_force(bench, fit, regressed, np.random.default_rng(0))
    np.testing.assert_allclose(seen[0], seen[1], rtol=1e-9)

"""Lagrange's equations against sympy's own and against the conservation of energy."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from sympy.physics.mechanics import LagrangesMethod, dynamicsymbols

from rigsight.effects import effect_named
from rigsight.effects.placed import placed
from rigsight.rigs import RIGS, Rig, read_rig_file
from rigsight.simulate import compose

FILES = Path(__file__).parent / "files"


def accelerations_by_sympy(rig: Rig, numbers: dict[sp.Symbol, float]) -> list[sp.Expr]:
    mechanism, time = rig.mechanism, dynamicsymbols._t
    moving = [dynamicsymbols(c.name) for c in mechanism.free]
    to_time = {c.symbol: q for c, q in zip(mechanism.free, moving, strict=True)}
    to_time |= {c.rate: q.diff(time) for c, q in zip(mechanism.free, moving, strict=True)}
    lagrangian = (mechanism.kinetic - mechanism.potential).subs(numbers).subs(to_time)
    method = LagrangesMethod(lagrangian, moving)
    method.form_lagranges_equations()
    rates = method.mass_matrix.LUsolve(method.forcing)
    back = {q.diff(time): c.rate for c, q in zip(mechanism.free, moving, strict=True)}
    return [
        rate.subs(back).subs({q: c.symbol for c, q in zip(mechanism.free, moving, strict=True)})
        for rate in rates
    ]


@pytest.mark.parametrize("name", ["cart_pendulum", "two_link_arm", "servo"])
def test_accelerations_are_those_of_sympy(name: str) -> None:
    rig, rng = RIGS[name], np.random.default_rng(1)
    numbers = {sp.Symbol(p.name, real=True): rng.uniform(0.5, 1.5) for p in (*rig.constants, *rig.parameters)}
    mechanism = rig.mechanism
    own = mechanism.mass_matrix.subs(numbers).LUsolve(sp.Matrix(mechanism.generalized_forces).subs(numbers))
    place = {s: rng.normal() for c in mechanism.free for s in (c.symbol, c.rate)}
    for ours, theirs in zip(own, accelerations_by_sympy(rig, numbers), strict=True):
        assert float(ours.subs(place)) == pytest.approx(float(theirs.subs(place)), rel=1e-10)


def test_an_arm_without_damping_keeps_its_energy() -> None:
    rig = RIGS["two_link_arm"]
    mechanism = rig.mechanism
    values = {"l_1": 0.3, "g": 9.81, "I_1": 0.05, "I_2": 0.02, "m_2": 0.6, "s_1": 0.12, "s_2": 0.08}
    numbers = {sp.Symbol(name, real=True): value for name, value in values.items()}
    symbols = [s for c in mechanism.free for s in (c.symbol, c.rate)]
    mass = sp.lambdify(symbols, mechanism.mass_matrix.subs(numbers))
    forces = sp.lambdify(symbols, [f.subs(numbers) for f in mechanism.generalized_forces])
    energy = sp.lambdify(symbols, (mechanism.kinetic + mechanism.potential).subs(numbers))

    def rates(_: float, x: np.ndarray) -> list[float]:
        first, second = np.linalg.solve(mass(*x), forces(*x))
        return [x[1], first, x[3], second]

    run = solve_ivp(rates, (0.0, 5.0), [1.5, 0.0, -0.7, 2.0], method="DOP853", rtol=1e-11, atol=1e-12)
    energies = energy(*run.y)
    assert np.ptp(energies) < 1e-8 * np.ptp(run.y[1]) ** 2
    assert np.ptp(run.y[0]) > 1.0


@pytest.mark.slow
def test_the_equations_of_a_large_arm_come_in_seconds_and_keep_its_energy() -> None:
    """Measured: 2.6 s of processor time; with simplified symbols it takes many minutes."""
    start = time.process_time()
    mechanism = read_rig_file(FILES / "six_joint_arm.toml").mechanism
    mass, forces = mechanism.mass_matrix, mechanism.generalized_forces
    assert time.process_time() - start < 20.0
    energy = mechanism.kinetic + mechanism.potential
    places, rates = [c.symbol for c in mechanism.free], [c.rate for c in mechanism.free]
    numbers = sorted(energy.free_symbols - {*places, *rates}, key=str)
    slopes = [sp.diff(energy, symbol) for symbol in (*places, *rates)]
    function = sp.lambdify([numbers, places, rates], [mass, sp.Matrix(forces), sp.Matrix(slopes)], cse=True)
    rng = np.random.default_rng(3)
    moving = rng.normal(size=6)
    matrix, force, slope = function(rng.uniform(0.5, 1.5, len(numbers)), rng.normal(size=6), moving)
    powers = np.concatenate((slope[:6, 0] * moving, slope[6:, 0] * np.linalg.solve(matrix, force[:, 0])))
    assert abs(np.sum(powers)) < 1e-10 * np.sum(np.abs(powers))


def test_no_inertia_is_worked_out_before_an_effect_reads_it(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = RIGS["two_link_arm"]
    asked: list[sp.Expr] = []
    monkeypatch.setattr(type(rig.mechanism), "inertia_along", lambda _, motion: asked.append(motion))
    compose(rig, [placed(effect_named("coulomb_friction"), "elbow")])
    assert not asked


def test_the_inertia_along_a_joint() -> None:
    train = RIGS["drive_train"].mechanism
    motor, load = sp.symbols("J_m J_l", real=True)
    assert sp.simplify(train.inertia_along(train.joints[0].motion) - motor * load / (motor + load)) == 0
    assert RIGS["element"].mechanism.inertia_along(RIGS["element"].mechanism.joints[0].motion) is None

"""The tree of composed equations: several degrees of freedom, delays, and the equations without definitions."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

from rigsight.effects import CATALOGUE, effect_named
from rigsight.rigs import AXIS, ELEMENT, RIGS
from rigsight.simulate import compose
from rigsight.simulate.equations.structure import INPUT
from rigsight.simulate.equations.tree import (
    Definition,
    EquationsOfMotion,
    EquationTree,
    FirstOrderState,
    Kind,
    late,
)

ONE_MOTION = [name for name, rig in RIGS.items() if rig.has_one_motion]

q_1, q_2, w_1, w_2 = sp.symbols("q_1 q_2 w_1 w_2", real=True)
I_1, I_2, s, g = sp.symbols("I_1 I_2 s g", real=True)


def test_a_mass_matrix_may_depend_on_the_coordinates():
    """A two-link arm: what the solved equations say is what Lagrange's do."""
    kinetic = I_1 * w_1**2 / 2 + I_2 * (w_1 + w_2) ** 2 / 2 + s * sp.cos(q_2) * w_1 * (w_1 + w_2)
    potential = -g * sp.cos(q_1) - g * sp.cos(q_1 + q_2)
    coordinates, velocities = (q_1, q_2), (w_1, w_2)
    momenta = [sp.diff(kinetic, w) for w in velocities]
    mass = sp.ImmutableMatrix([[sp.diff(momentum, w) for w in velocities] for momentum in momenta])
    terms = tuple(
        (
            sp.diff(kinetic - potential, q),
            *(-sp.diff(momentum, other) * w for other, w in zip(coordinates, velocities, strict=True)),
        )
        for q, momentum in zip(coordinates, momenta, strict=True)
    )
    motion = EquationsOfMotion(coordinates, velocities, mass, terms)
    numbers = {q_1: 0.3, q_2: -0.8, w_1: 1.1, w_2: -0.4, I_1: 0.7, I_2: 0.2, s: 0.15, g: 9.81}
    found = np.array([a.subs(numbers) for a in motion.accelerations], dtype=float)
    # By hand: M a = -C - G with the Coriolis terms of the textbook.
    cross = 0.15 * np.sin(-0.8)
    M = np.array(
        [[0.7 + 0.2 + 2 * 0.15 * np.cos(-0.8), 0.2 + 0.15 * np.cos(-0.8)], [0.2 + 0.15 * np.cos(-0.8), 0.2]]
    )
    C = np.array([-cross * (2 * 1.1 * -0.4 + 0.4**2), cross * 1.1**2])
    G = 9.81 * np.array([np.sin(0.3) + np.sin(-0.5), np.sin(-0.5)])
    np.testing.assert_allclose(found, np.linalg.solve(M, -C - G), rtol=1e-12)


def test_delays_of_one_signal_add_up():
    first, second, T_1, T_2 = sp.symbols("first second T_1 T_2", real=True)
    definitions = (
        Definition(first, late(INPUT, T_1), Kind.DRIVE, "a"),
        Definition(second, late(first, T_2), Kind.DRIVE, "b"),
    )
    tree = EquationTree((INPUT,), definitions, EquationsOfMotion(), (), ())
    assert tree.lateness(second) == (INPUT, T_1 + T_2)
    assert tree.lateness(INPUT) == (INPUT, None)
    assert tree.flattened(2 * second) == 2 * INPUT


@pytest.mark.parametrize("rig", ONE_MOTION)
def test_flat_equations_hold_no_definition(rig):
    for effect in CATALOGUE:
        if RIGS[rig].offers(effect):
            structure = compose(RIGS[rig], [effect])
            definitions = {d.symbol for d in structure.tree.definitions}
            assert all(d.owner == effect.name for d in structure.tree.definitions)
            assert definitions, effect.name
            flat = [*(e.rate for e in structure.equations), *structure.outputs]
            assert not definitions & set().union(*(expression.free_symbols for expression in flat))


def test_a_definition_refers_to_those_in_front_of_it_only():
    for rig in map(RIGS.__getitem__, ONE_MOTION):
        structure = compose(rig, [effect for effect in CATALOGUE if rig.offers(effect)])
        symbols = [d.symbol for d in structure.tree.definitions]
        for i, definition in enumerate(structure.tree.definitions):
            assert not definition.expression.free_symbols & set(symbols[i:])


def test_a_prescribed_motion_has_no_equation_of_motion():
    tree = compose(ELEMENT, [effect_named("backlash")]).tree
    assert tree.motion.coordinates == ()
    assert tree.motion.accelerations == ()
    assert compose(ELEMENT).velocity_index is None


def test_a_state_rests_at_the_end_it_is_driven_against():
    z, g, v = sp.symbols("z g v", real=True)
    state = FirstOrderState(z, (v,), "x", g, "backlash")
    assert state.limited_rate == v * (1 - sp.sign(z * sp.sign(v) - g)) / 2
    for place, velocity, moved in ((1.1, 2.0, 0.0), (1.1, -2.0, -2.0), (-1.1, -2.0, 0.0), (0.5, 2.0, 2.0)):
        assert float(state.limited_rate.subs({z: place, v: velocity, g: 1.0})) == moved


def test_an_axis_moves_by_the_sum_of_its_terms():
    motion = compose(AXIS, [effect_named("cubic_stiffness")]).tree.motion
    assert motion.mass.shape == (1, 1)
    assert sp.Add(*motion.terms[0]) == motion.forces[0]
    assert motion.accelerations[0] * motion.mass[0, 0] == motion.forces[0]

"""Are laws that no catalogue has handed on as effects: the shape of what is missing, and the powers of an equation?"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp

from rigsight.campaign import Campaign
from rigsight.discover.along_motion import AlongMotion
from rigsight.discover.bench import Attempt, Bench, Trial
from rigsight.discover.own_laws import offered_shape, own_laws
from rigsight.discover.result import OfferedShape
from rigsight.discover.terms import known_terms
from rigsight.effects import Effect, Energy, GainTrend, Place, Signature, placed
from rigsight.effects.symbols import sigmoid, x
from rigsight.excitation import linear_sweep
from rigsight.identify import characteristic_scales
from rigsight.inverse.term import compiled
from rigsight.parameters import Parameter
from rigsight.records import Record
from rigsight.rigs import AXIS, Rig
from rigsight.simulate import compose, simulate
from rigsight.simulate.model import Model

FORCE, REACH, NOISE = 3.0, 5e-3, 1e-5
SATURATING = Effect(
    name="saturating",
    place=Place.DYNAMICS,
    summary="A spring that saturates.",
    parameters=(),
    energy=Energy.CONSERVATIVE,
    signature=Signature(GainTrend.RISES),
    torque=FORCE * sp.tanh(x / REACH),
)
AXIS_VALUES = {"gain": 1.0, "m": 1.0, "d": 3.0, "k": 400.0, "x_off": 0.0, "force_off": 0.0}


CUBIC = known_terms()["cubic_stiffness"]


@pytest.fixture(scope="module")
def cubic() -> tuple[Bench, AlongMotion, Trial]:
    """Return the records of a spring that saturates, with the equation of a cubic spring for it."""
    t, rng, records = 5e-3 * np.arange(700), np.random.default_rng(1), []
    for amplitude, role in ((1.0, "estimation"), (4.0, "estimation"), (2.5, "validation")):
        drawn = Record(role, 5e-3, {"u": linear_sweep(t, amplitude, 2.0, 40.0)}, {}, hold="foh", role=role)
        run = simulate(compose(AXIS, [SATURATING]), AXIS_VALUES, drawn)
        records.append(run.with_signals(x=run["x"] + rng.normal(scale=NOISE, size=t.size)))
    along = AlongMotion.of(Campaign("axis", AXIS, {"gain": 1.0}, {}, tuple(records)), AXIS_VALUES, [CUBIC])
    assert along is not None
    bench = Bench(
        rig=AXIS, estimation=tuple(records[:2]), held_out=tuple(records[2:]), values=AXIS_VALUES,
        scales=characteristic_scales(AXIS, records[:2], AXIS_VALUES), noise={"x": NOISE},
        held=frozenset({"force_off"}), effects={CUBIC.name: CUBIC},
    )  # fmt: skip
    (trial,) = bench.trials_of([Attempt(frozenset({CUBIC.name}), [{**AXIS_VALUES, "k_3": 0.0}])])
    return bench, along, trial


@pytest.fixture(scope="module")
def offered(cubic: tuple[Bench, AlongMotion, Trial]) -> OfferedShape:
    found = offered_shape(*cubic, lambda _: None)
    assert found is not None
    return found


def test_the_shape_of_a_law_outside_the_library_is_offered(
    cubic: tuple[Bench, AlongMotion, Trial], offered: OfferedShape
) -> None:
    assert offered.force.joint == "dynamics"
    assert offered.argument == "displacement"
    assert offered.in_place_of == (CUBIC.name,)
    assert offered.share > 0.99
    assert offered.error_before == cubic[2].error_over_noise
    assert offered.error_over_noise < 0.05 * offered.error_before


def test_the_offered_shape_is_the_law(offered: OfferedShape) -> None:
    """Beside a linear spring laws that differ by a slope are the same, and forces are in units of their size."""
    effect = offered.effect
    values = {p.name: p.starts[0] if p.fitted else p.default for p in effect.parameters}
    size = values["x_r"]
    at = np.linspace(-size, size, 201)
    shape = compiled(effect.torque.subs({sp.Symbol(n, real=True): v for n, v in values.items()}), (x,))(at)
    laws = np.column_stack([np.tanh(at / REACH), at / size])
    solved = np.linalg.lstsq(laws, shape, rcond=None)[0]
    assert np.std(shape - laws @ solved) < 0.01 * solved[0]


def test_an_equation_that_holds_is_offered_no_shape(cubic: tuple[Bench, AlongMotion, Trial]) -> None:
    bench, along, _ = cubic
    law = replace(
        SATURATING,
        parameters=(Parameter("F", "force", "force", null=0.0, starts=(1.0,), search=(0.0, 9.0)),),
        torque=sp.Symbol("F", real=True) * sp.tanh(x / REACH),
    )
    right = replace(bench, effects={law.name: law}, trials={})
    (trial,) = right.trials_of([Attempt(frozenset({law.name}), [{**AXIS_VALUES, "F": FORCE}])])
    assert trial.error_over_noise < 1.1
    assert offered_shape(right, along, trial, lambda _: None) is None


@pytest.mark.slow
def test_the_shape_is_found_at_its_joint(drive_train: Rig) -> None:
    train = {
        "k_t": 0.05,
        "J_m": 1e-4,
        "J_l": 5e-4,
        "k_s": 2.0,
        "d_s": 1e-3,
        "d_m": 1e-3,
        "d_l": 1e-3,
        "k_l": 0.5,
    }
    law = placed(replace(SATURATING, torque=0.02 * sp.tanh(x / 0.01)), "shaft")
    t, rng, runs = 5e-3 * np.arange(800), np.random.default_rng(0), []
    for i, (amplitude, role) in enumerate(((0.8, "estimation"), (1.5, "estimation"), (1.1, "validation"))):
        u = amplitude * np.sin(i + 2.0 * np.pi * (0.5 * t + (0.8 if i < 2 else 0.5) * t**2))
        drawn = Record(f"run {i}", 5e-3, {"u": u}, {}, hold="foh", role=role)
        runs.append(simulate(compose(drive_train, [law]), train, drawn, accuracy=1e-6))
    noise = {s.name: 1e-3 * float(np.std(runs[0][s.name])) for s in drive_train.outputs}
    records = [
        r.with_signals(**{n: r[n] + rng.normal(scale=std, size=t.size) for n, std in noise.items()})
        for r in runs
    ]
    along = AlongMotion.of(Campaign("train", drive_train, {"k_t": 0.05}, {}, tuple(records)), train, [
        placed(CUBIC, "load_bearing")
    ])  # fmt: skip
    assert along is not None
    bench = Bench(
        rig=drive_train, estimation=tuple(records[:2]), held_out=tuple(records[2:]), values=train, noise=noise,
        scales=characteristic_scales(drive_train, records[:2], train), held=frozenset({"k_t"}),
    )  # fmt: skip
    (linear,) = bench.trials_of([Attempt(frozenset(), [train])])
    offered = offered_shape(bench, along, linear, lambda _: None)
    assert offered is not None
    assert (offered.force.joint, offered.argument) == ("shaft", "displacement")
    assert offered.error_over_noise < 0.2 * offered.error_before


def test_powers_of_an_equation_are_one_candidate_at_each_joint(drive_train: Rig) -> None:
    known = known_terms()
    names = [
        ("drive_x1_v0", "motor_bearing"),
        ("monomial_x0_v3", "motor_bearing"),
        ("monomial_x0_v3", "shaft"),
    ]
    powers = [placed(known[name], joint) for name, joint in names]
    structure = compose(drive_train, [*powers, placed(known["coulomb_friction"], "shaft")])
    values = dict.fromkeys(structure.names, 2.0)
    sizes = {"x": 0.1, "force": 1.0, "time": 0.01}
    scales = {f"{name}@{joint}": size for _, joint in names for name, size in sizes.items()}
    first, second = own_laws(Model.of(structure, values, "foh"), (), scales)
    assert [p.name for p in first.parameters] == ["b_10", "c_03"]
    assert first.torque == known["drive_x1_v0"].torque + known["monomial_x0_v3"].torque
    assert second.torque == known["monomial_x0_v3"].torque
    # A fit starts at the number that was found, 2 N m s^3: the size of the motion is 10 1/s.
    assert second.parameters[0].starts == pytest.approx([2.0 * 10.0**3])
    assert own_laws(Model.of(structure, values, "foh"), powers, scales) == ()


@pytest.mark.parametrize("side", [0, 1, -1])
def test_a_sigmoid_grows_by_one_up_to_its_knot(side: int) -> None:
    law = compiled(sigmoid(x, 2.0, side), (x,))
    far, knot = law(np.array([-1e4, 0.0, 1e4])), law(np.array([-2.0, 2.0]))
    assert far[1] == pytest.approx(0.0, abs=1e-12)
    assert far[2] - far[0] == pytest.approx(2.0 if side == 0 else 1.0, abs=1e-3)
    assert np.all(np.diff(law(np.linspace(-6.0, 6.0, 101))) > 0.0)
    assert np.ptp(knot) > 0.7 * (far[2] - far[0])

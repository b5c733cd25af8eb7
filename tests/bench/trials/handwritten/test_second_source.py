"""The equations written by hand and those composed from the declarations move alike: two sources for every law on every rig."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from rigsight.diagnose.fit_context import candidates_on
from rigsight.effects import CATALOGUE, Effect, kind_of
from rigsight.records import Hold, Record
from rigsight.records.signals import typical_size
from rigsight.rigs import RIGS
from rigsight.simulate import compose, simulate
from rigsight_bench.trials.handwritten.equations.held_inputs import Generated, Held, Input
from rigsight_bench.trials.handwritten.equations.plant import Response
from rigsight_bench.trials.handwritten.plants import (
    DRIVE_LAWS,
    JOINT_LAWS,
    LATERAL_LAWS,
    MOTIONS,
    PRESCRIBED,
    SENSOR_LAWS,
    respond,
)
from rigsight_bench.trials.handwritten.shapes import Shape, Sizes, draw_shape
from rigsight_bench.trials.waveforms import Multisine, Sweep, Waveform, samples

pytestmark = pytest.mark.slow

NUMBERS: dict[str, dict[str, float]] = {
    "axis": {"gain": 8.0, "m": 2.0, "d": 3.0, "k": 250.0, "x_off": 0.02, "force_off": 0.0},
    "drive_train": {
        "k_t": 1.0, "J_m": 0.8, "J_l": 1.1, "k_s": 220.0, "d_s": 1.2, "d_m": 0.9, "d_l": 0.7, "k_l": 60.0,
    },
    "two_link_arm": {
        "l_1": 0.3, "g": 9.81, "I_1": 0.12, "I_2": 0.05, "m_2": 1.1, "s_1": 0.5, "s_2": 0.18, "d_1": 0.12, "d_2": 0.05,
    },
    "running_gear": {
        "v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27, "J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "psi_off": 5e-4, "l_0": 0.25,
        "c_y": 0.95, "y_off": 2e-4,
    },
    "element": {"d": 4.0, "k": 200.0, "force_off": 0.3},
}  # fmt: skip
AMPLITUDES = {
    "axis": [1.8],
    "drive_train": [7.0],
    "two_link_arm": [1.2, 0.5],
    "running_gear": [1.2],
    "element": [0.1],
}
DT, N_SAMPLES = 2e-3, 2000
EDGE = 60
"""Samples at either end of an element's record in which the smoothed motion still feels the end."""
LAWS = {*JOINT_LAWS, *DRIVE_LAWS, *SENSOR_LAWS, *LATERAL_LAWS}
# The last of its places on each rig: other places of one rig repeat the law.
OFFERED = {
    name: {kind_of(e.name): e for e in candidates_on(RIGS[name], CATALOGUE) if kind_of(e.name) in LAWS}
    for name in NUMBERS
}


def spread(n_rigs: int = 2) -> list[tuple[str, Effect]]:
    """Return each law on a few of the rigs that offer it, every rig with about as many: all 110 pairs take two minutes."""
    pairs, count = [], dict.fromkeys(NUMBERS, 0)
    for kind in sorted(LAWS, key=lambda kind: (sum(kind in own for own in OFFERED.values()), kind)):
        rigs = sorted((name for name in NUMBERS if kind in OFFERED[name]), key=count.__getitem__)
        for name in rigs[:n_rigs]:
            count[name] += 1
            pairs.append((name, OFFERED[name][kind]))
    return pairs


PAIRS = spread()


def waveforms(name: str) -> list[Waveform]:
    rng = np.random.default_rng(5)
    if name == PRESCRIBED:
        return [Sweep(AMPLITUDES[name][0], 3.0, 40.0, DT * N_SAMPLES)]
    return [
        Multisine(np.full(12, 0.35 * a), np.sort(rng.uniform(2.0, 40.0, 12)), rng.uniform(0.0, 6.28, 12), 0.5)
        for a in AMPLITUDES[name]
    ]


def driven(name: str, hold: Hold = "foh", dt: float = DT) -> tuple[Record, list[Input]]:
    """Return a record of the inputs, and the same inputs as the plant gets them between samples."""
    n = round(DT * N_SAMPLES / dt)
    t = dt * np.arange(n)
    waves = waveforms(name)
    named = {s: samples(w, t) for s, w in zip(RIGS[name].mechanism.inputs, waves, strict=True)}
    record = Record("drawn", dt, named, {}, hold=hold)
    if name == PRESCRIBED or hold == "band_limited":
        return record, [Generated(w) for w in waves]
    return record, [Held(u.tolist(), dt, lines=hold == "foh") for u in named.values()]


@cache
def without_effect(name: str, place: str) -> Response:
    record, inputs = driven(name)
    return respond(name, NUMBERS[name], inputs, record.dt, record.n_samples, place=place)


def numbers_of(name: str, effect: Effect, place: str) -> dict[str, float]:
    """Return an effect that changes the motion much, of a form drawn as the bench draws it."""
    kind = kind_of(effect.name)
    moved = without_effect(name, place if kind in JOINT_LAWS else "")
    x, v = typical_size([moved.x]), typical_size([moved.v])
    if name == PRESCRIBED:
        force = typical_size([moved.readings["force"]])
        sizes = Sizes(x, v, force, force / x, force)
    else:
        motion = MOTIONS[name](NUMBERS[name])
        joint = motion.joints.get(place) or next(iter(motion.joints.values()))
        number = list(motion.drives).index(place) if place in motion.drives else 0
        u = list(driven(name)[0].signals.values())[number]
        force = motion.gains[number] * typical_size([u])
        if place not in motion.drives and joint.stiffness:
            force = joint.stiffness * x
        sizes = Sizes(x, v, force, joint.stiffness or force / x, float(np.max(np.abs(u))))
    shape: Shape = draw_shape(kind, sizes, np.random.default_rng(3))
    # A speed limit shows in few samples until it is low.
    return shape.at(0.9 if kind == "speed_limit" else 0.5)


def both(
    name: str, effect: Effect | None, hold: Hold = "foh", dt: float = DT
) -> tuple[dict[str, np.ndarray], Record]:
    """Return what the hand-written and the composed plant show, each from its own state of rest."""
    record, inputs = driven(name, hold, dt)
    structure = compose(RIGS[name], [effect] if effect else [])
    values, own, place = dict(NUMBERS[name]), {}, ""
    if effect:
        place = RIGS[name].where(effect)
        own = numbers_of(name, effect, place)
        values |= {structure.parameter_name(effect, p): value for p, value in own.items()}
    hand = respond(
        name, NUMBERS[name], inputs, dt, record.n_samples, kind_of(effect.name) if effect else "", place, own
    )
    return hand.readings, simulate(structure, values, record, accuracy=1e-9)


def apart(shown: dict[str, np.ndarray], composed: Record, inside: slice = slice(None)) -> float:
    """Return the largest difference of a reading in units of its standard deviation."""
    return max(
        float(np.max(np.abs((shown[name] - composed[name])[inside])) / np.std(composed[name]))
        for name in shown
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", NUMBERS)
def test_two_sources_of_each_rig_move_alike(name: str) -> None:
    inside = slice(EDGE, -EDGE) if name == PRESCRIBED else slice(None)
    assert apart(*both(name, None), inside) < 1e-6


@pytest.mark.parametrize(
    ("name", "effect"),
    [
        # Equations of the larger rigs take seconds to be composed and compiled.
        pytest.param(*pair, marks=pytest.mark.slow if pair[0] in ("drive_train", "two_link_arm") else ())
        for pair in PAIRS
    ],
    ids=lambda v: v if isinstance(v, str) else v.name,
)
def test_two_sources_of_each_effect_move_alike(name: str, effect: Effect) -> None:
    shown, composed = both(name, effect)
    linear = without_effect(name, "").readings
    # An effect that does next to nothing would agree whatever its equations are.
    assert max(np.std(shown[s] - linear[s]) / np.std(linear[s]) for s in shown) > 0.01
    if name != PRESCRIBED:
        assert apart(shown, composed) < 1e-6
        return
    # The composed element smooths the samples of its motion: rates and accelerations are exact to 1e-6.
    assert apart(shown, composed, slice(EDGE, -EDGE)) < 2e-5


@pytest.mark.parametrize(("hold", "tolerance"), [("zoh", 1e-6), ("foh", 1e-6), ("band_limited", 1e-3)])
def test_both_plants_get_between_slow_samples_what_the_hold_says(hold: Hold, tolerance: float) -> None:
    # The composed one interpolates a sampled analog signal, the hand-written one has the signal itself.
    inside = slice(50, -50) if hold == "band_limited" else slice(None)
    assert apart(*both("running_gear", None, hold, 0.01), inside) < tolerance


def test_a_constant_force_moves_the_rest_of_a_linear_axis_and_nothing_else() -> None:
    _, inputs = driven("axis")
    plain, pushed = (
        respond("axis", {**NUMBERS["axis"], "force_off": force}, inputs, DT, 500).readings["x"]
        for force in (0.0, 0.4)
    )
    assert np.allclose(pushed - plain, 0.4 / NUMBERS["axis"]["k"], rtol=0.0, atol=1e-12)


def test_dry_friction_takes_as_much_of_each_swing_as_the_textbook_says() -> None:
    """Den Hartog, Mechanical Vibrations: each half swing ends 2 T_c / k nearer, until it stays within T_c / k."""
    friction, stiffness, step = 1.0, 250.0, 4.7
    numbers = {"gain": 1.0, "m": 2.0, "d": 0.0, "k": stiffness, "x_off": 0.0, "force_off": 0.0}
    u = np.r_[np.zeros(100), np.full(1900, step)]
    moved = respond(
        "axis", numbers, [Held(u.tolist(), 1e-3, lines=False)], 1e-3, 2000, "coulomb_friction", "dynamics",
        {"T_c": friction},
    ).readings["x"]  # fmt: skip
    # From -4.7 about the new rest in units of T_c/k: 2.7, then -0.7, where it sticks.
    assert np.max(moved) == pytest.approx((4.7 + 2.7) / stiffness, rel=1e-6)
    assert moved[-1] == pytest.approx((4.7 - 0.7) / stiffness, rel=1e-9)
    assert np.ptp(moved[-800:]) == 0.0


def test_a_composed_rig_of_several_joints_rests_where_no_friction_holds_it() -> None:
    offered = candidates_on(RIGS["drive_train"], CATALOGUE)
    (effect,) = (e for e in offered if e.name == "directional_friction@load_bearing")
    _, composed = both("drive_train", effect)
    assert composed["load_angle"][0] == 0.0

"""Does the regression along the motion propose the term that is missing, at its place and with its numbers?"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

from rigsight.campaign import Campaign
from rigsight.discover.along_motion import AlongMotion
from rigsight.discover.discovery import check_predicts, discover
from rigsight.discover.records import DiscoveryData
from rigsight.discover.terms import known_terms, offered_terms
from rigsight.effects import Effect, kind_of, placed
from rigsight.effects.effect import Energy, GainTrend, Place, Signature
from rigsight.effects.symbols import x
from rigsight.errors import SimulationError
from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.parameters import Parameter
from rigsight.records import Record
from rigsight.rigs import AXIS, Rig, read_rig_file
from rigsight.simulate import compose, simulate

DT = 5e-3
T = DT * np.arange(1200)
AXIS_VALUES = {"gain": 1.0, "m": 1.0, "d": 3.0, "k": 400.0, "x_off": 0.0, "force_off": 0.0}
TRAIN = {"k_t": 0.05, "J_m": 1e-4, "J_l": 5e-4, "k_s": 2.0, "d_s": 1e-3, "d_m": 1e-3, "d_l": 1e-3, "k_l": 0.5}


def sweep(amplitude: float, phase: float) -> np.ndarray:
    return amplitude * np.sin(phase + 2.0 * np.pi * (0.5 * T + 0.5 * T**2))


def campaign(
    rig: Rig,
    constants: Sequence[str],
    values: Mapping[str, float],
    effects: Sequence[Effect],
    amplitudes: Sequence[float],
) -> DiscoveryData:
    """Sweeps of some amplitudes, the last one held out, with noise of a thousandth of the motion."""
    rng = np.random.default_rng(0)
    structure = compose(rig, effects)
    records = []
    for i, amplitude in enumerate(amplitudes):
        role = "validation" if i == len(amplitudes) - 1 else "estimation"
        inputs = {rig.inputs[0].name: sweep(amplitude, i)}
        records.append(
            simulate(
                structure, values, Record(f"run {i}", DT, inputs, {}, hold="foh", role=role), accuracy=1e-6
            )
        )
    noise = {s.name: 1e-3 * max(float(np.std(r[s.name])) for r in records) for s in rig.outputs}
    noisy = tuple(
        r.with_signals(**{n: r[n] + rng.normal(scale=std, size=r.n_samples) for n, std in noise.items()})
        for r in records
    )
    return DiscoveryData(Campaign("test", rig, {n: values[n] for n in constants}, {}, noisy), noise)


def regression(data: DiscoveryData, known: Mapping[str, float], effects: Sequence[Effect]) -> AlongMotion:
    estimation = tuple(r for r in data.records if r.role == "estimation")
    own = Campaign("test", data.rig, data.campaign.constants, {}, estimation)
    found = AlongMotion.of(own, known, effects)
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("name", "place", "values"),
    [
        ("quadratic_damping", "motor_bearing", {"c_2": 1e-4}),
        ("cubic_stiffness", "load_bearing", {"k_3": 0.3}),
        ("drive_x1_v0", "motor_bearing", {"b_10": 0.2}),
    ],
)
def test_a_term_is_proposed_at_its_joint(
    drive_train: Rig, name: str, place: str, values: dict[str, float]
) -> None:
    effect = placed(known_terms()[name], place)
    data = campaign(drive_train, ("k_t",), {**TRAIN, **values}, [effect], (0.8, 1.5, 1.1))
    off = {name: value if name == "k_t" else 1.1 * value for name, value in TRAIN.items()}
    kinds = ("quadratic_damping", "cubic_stiffness", "coulomb_friction", "drive_x1_v0")
    offered = [e for e in offered_terms(drive_train) if kind_of(e.name) in kinds]
    along = regression(data, off, offered)
    estimation = [r for r in data.records if r.role == "estimation"]
    scales = characteristic_scales(drive_train, estimation, TRAIN)
    linear = GreyBoxFit(compose(drive_train), estimation, scales, data.noise).fit(TRAIN, [])
    first = along.beside(linear)[0]
    assert [e.name for e in first.effects] == [effect.name]
    (parameter,) = values
    assert first.starts[0].own[effect.name][parameter] == pytest.approx(values[parameter], rel=0.2)
    missing, law = along.missing(linear, place)
    assert missing.where == place
    assert not np.any(law)


def test_a_motor_constant_that_depends_on_the_position_is_a_term_with_the_input() -> None:
    effect = known_terms()["drive_x1_v0"]
    data = campaign(AXIS, ("gain",), {**AXIS_VALUES, "b_10": -8.0}, [effect], (5.0, 10.0, 7.0))
    found = discover(data)
    (term,) = found.kept
    assert term.name == "drive_x1_v0"
    assert term.coefficients["b_10"].value == pytest.approx(-8.0, rel=0.02)
    assert term.otherwise > 3.0 * found.held_out_error
    assert "u" in found.equations[0].split("b_10")[1]


SPRING = Effect(
    name="sine_spring",
    place=Place.DYNAMICS,
    summary="A spring whose force is a sine of the deflection.",
    parameters=(
        Parameter("k_w", "size of the wave", "force", lower=-1e9, upper=1e9, null=0.0, starts=(0.1,), search=(-2.0, 2.0)),
    ),
    energy=Energy.CONSERVATIVE,
    signature=Signature(gain_trend=GainTrend.STEADY),
    torque=sp.Symbol("k_w", real=True) * sp.sin(200 * x),
)  # fmt: skip


def test_a_term_of_the_user_competes_with_those_of_the_catalogue() -> None:
    data = campaign(AXIS, ("gain",), {**AXIS_VALUES, "k_w": 1.5}, [SPRING], (5.0, 10.0, 7.0))
    found = discover(data, [SPRING])
    assert [term.name for term in found.kept] == ["sine_spring"]
    assert found.kept[0].coefficients["k_w"].value == pytest.approx(1.5, rel=0.02)


PENDULUM = """
name = "pendulum"
summary = "A driven pendulum."
inputs.u = { unit = "N m" }
parameters.I = { unit = "kg m^2", lower = 1e-6, log = true }
parameters.s = { unit = "kg m", lower = 0.0 }
parameters.d = { unit = "N m s/rad", lower = 0.0 }
coordinates.a = { unit = "rad", about = "from hanging" }
energy = { kinetic = "I*d(a)^2/2", potential = "-9.81*s*cos(a)" }
joints.pivot = { motion = "a", damping = "d" }
drives.motor = { signal = "u", along = "a", force = "motor" }
sensors.angle = { reads = "a", unit = "rad" }
"""


def test_a_rig_of_the_user_with_one_motion_is_discovered(tmp_path: Path) -> None:
    path = tmp_path / "pendulum.toml"
    path.write_text(PENDULUM, encoding="utf-8")
    rig, values = read_rig_file(path), {"I": 0.02, "s": 0.08, "d": 2e-3, "c_2": 2e-3}
    data = campaign(rig, (), values, [known_terms()["quadratic_damping"]], (0.3, 0.6, 0.45))
    found = discover(data)
    assert [term.name for term in found.kept] == ["quadratic_damping"]
    assert found.held_out_error < 1.1


def test_the_law_of_a_free_motion_is_found_and_no_delay_of_its_reading(tmp_path: Path) -> None:
    path = tmp_path / "free.toml"
    driven = ("inputs.u =", "drives.motor =")
    path.write_text("\n".join(line for line in PENDULUM.splitlines() if not line.startswith(driven)), "utf-8")
    rig, values = read_rig_file(path), {"I": 0.02, "s": 0.08, "d": 2e-3, "c_2": 2e-3}
    structure, rng = compose(rig, [known_terms()["quadratic_damping"]]), np.random.default_rng(0)
    records = []
    for begin, role in ((1.0, "estimation"), (0.6, "estimation"), (0.8, "validation")):
        still = Record(f"from {begin}", DT, {"angle": np.zeros(T.size)}, {"angle": "rad"}, role=role)
        run = simulate(structure, values, still, np.array([begin, 0.0]))
        records.append(run.with_signals(angle=run["angle"] + rng.normal(scale=1e-4, size=T.size)))
    # Only the ratio to the inertia is known: it is held as it was given.
    data = DiscoveryData(Campaign("free", rig, {}, {"I": 0.02}, tuple(records)), {"angle": 1e-4})
    found = discover(data)
    assert [term.name for term in found.kept] == ["quadratic_damping"]
    assert found.kept[0].coefficients["c_2"].value == pytest.approx(2e-3, rel=0.02)
    assert found.held_out_error < 1.1


@pytest.mark.parametrize(("error", "is_refused"), [(900.0, True), (300.0, False), (1.5, False)])
def test_an_equation_that_says_less_of_records_than_their_means_is_refused(
    error: float, is_refused: bool
) -> None:
    # A rig that is unstable without its controller leaves every free run.
    record = Record("held", DT, {"u": np.sin(T), "x": 5e-3 * np.sin(6.0 * T)}, {}, role="validation")
    refused = pytest.raises(SimulationError) if is_refused else contextlib.nullcontext()
    with refused:
        check_predicts(error, AXIS.name, [record], {"x": 1e-5})

"""Numbers of a right model are the same everywhere; those of a wrong one differ with what it gets wrong, and that is told."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import kstest

from rigsight.campaign import Campaign
from rigsight.diagnose.diagnosis import diagnose
from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.policy import TRUST
from rigsight.diagnose.trust.patterns import Pattern, Role, meaning
from rigsight.diagnose.trust.statement import ParameterTrust, Trust
from rigsight.diagnose.trust.trust import adjusted, course, spread, trust
from rigsight.effects import Effect, effect_named
from rigsight.identify import characteristic_scales
from rigsight.identify.fit.windows import Observer
from rigsight.records.record import Record
from rigsight.rigs import AXIS, RIGS, Rig
from rigsight.rigs.reading.rig_file import rig_of_text
from rigsight.simulate import compose, simulate

DT, N, NOISE = 0.01, 1600, 2e-4
VALUES = {"gain": 1.0, "m": 1.0, "d": 1.6, "k": 100.0, "x_off": 0.0, "force_off": 0.0}
LADDER = (0.5, 1.0, 2.0, 4.0)


def multisine(rng: np.random.Generator, n_samples: int = N) -> np.ndarray:
    t = DT * np.arange(n_samples)
    return sum(np.cos((2.0 + 1.1 * n) * t + phase) for n, phase in enumerate(rng.uniform(0.0, 6.28, 25)))


def axis_records(
    amplitudes: Sequence[float],
    effects: tuple[Effect, ...] = (),
    values: Mapping[str, float] | None = None,
    by_record: Sequence[Mapping[str, float]] = ({},),
    seed: int = 0,
    disturbance: float = 0.0,
) -> tuple[Record, ...]:
    rng, structure = np.random.default_rng(seed), compose(AXIS, effects)
    records = []
    for i, amplitude in enumerate(amplitudes):
        u = amplitude * multisine(rng)
        push = disturbance * lfilter([0.05], [1.0, -0.95], rng.standard_normal(N))
        own = {**VALUES, **(values or {}), **by_record[i % len(by_record)]}
        shown = simulate(structure, own, Record(f"r{i}", DT, {"u": u + push}, {}))
        x = shown["x"] + NOISE * rng.standard_normal(N)
        records.append(Record(f"r{i}", DT, {"u": u, "x": x}, {}, amplitude=amplitude))
    return tuple(records)


def context_of(
    rig: Rig, records: tuple[Record, ...], known: Mapping[str, float], noise: Mapping[str, float]
) -> FitContext:
    held = frozenset({"force_off"}) & {p.name for p in rig.parameters}
    scales = characteristic_scales(rig, records, known)
    return FitContext(rig, records, records, records, scales, noise, held, known)


def fitted(context: FitContext, effects: tuple[Effect, ...], start: Mapping[str, float]) -> FittedModel:
    structure = context.composed(effects)
    fit = context.problem(structure, context.estimation).fit(
        {**context.start, **start}, context.free_parameters(structure)
    )
    return context.score(effects, fit)


def asked(
    records: tuple[Record, ...],
    effects: tuple[Effect, ...] = (),
    start: Mapping[str, float] | None = None,
) -> Trust:
    context = context_of(AXIS, records, VALUES, {"x": NOISE})
    return trust(context, fitted(context, effects, start or {}), records, VALUES)


def number(found: Trust, name: str) -> ParameterTrust:
    return next(one for one in found.parameters if one.name == name)


@pytest.mark.slow
@pytest.mark.parametrize("disturbance", [0.0, 0.5], ids=["white noise", "disturbed"])
def test_numbers_of_a_right_model_are_the_same_everywhere(disturbance: float) -> None:
    """The level is one false alarm in a hundred models: two of ten would be beyond chance."""
    found = [asked(axis_records((0.5, 1.0, 0.7), seed=seed, disturbance=disturbance)) for seed in range(10)]
    assert sum(not one.stable for one in found) <= 1
    assert "All 4 numbers are the same in every record" in next(one for one in found if one.stable).statement


FORMS = [
    ("coulomb_friction", {"T_c": 0.3}, "d", -1, "dry friction"),
    ("quadratic_damping", {"c_2": 0.5}, "d", 1, "grows with speed"),
]


@pytest.mark.parametrize(("name", "values", "own", "direction", "cause"), FORMS, ids=[f[0] for f in FORMS])
def test_a_linear_damper_in_the_place_of_friction_differs_with_amplitude(
    name: str, values: Mapping[str, float], own: str, direction: int, cause: str
) -> None:
    effects = (effect_named(name),)
    records = axis_records(LADDER, effects, values)
    found = asked(records)
    damping = number(found, own)
    assert (damping.pattern, damping.direction) == (Pattern.AMPLITUDE, direction)
    assert damping.points_to is not None
    assert cause in damping.points_to.cause
    assert f"{own} {'grows' if direction > 0 else 'falls'} with amplitude" in found.statement
    assert asked(records, effects, values).stable


def test_mass_stiffness_and_damping_that_grow_together_point_to_the_drive() -> None:
    effects = (effect_named("input_saturation"),)
    found = asked(axis_records((1.0, 4.0, 0.5, 2.0), effects, {"u_max": 9.0}))
    for name in ("m", "k", "d"):
        reported = number(found, name).points_to
        assert reported is not None
        assert "saturation" in reported.cause


def test_amplitude_and_time_that_go_together_are_told_apart_by_nobody() -> None:
    effects = (effect_named("coulomb_friction"),)
    ordered = asked(axis_records(LADDER, effects, {"T_c": 0.3}))
    assert number(ordered, "d").goes_with == ("amplitude", "time")
    assert "cannot be separated" in ordered.statement
    mixed = asked(axis_records((1.0, 4.0, 0.5, 2.0), effects, {"T_c": 0.3}))
    assert number(mixed, "d").goes_with == ("amplitude",)


def test_a_stiffness_that_drifts_from_record_to_record_differs_with_time() -> None:
    drift = [{"k": 100.0 + 0.8 * i} for i in range(4)]
    found = asked(axis_records((1.0,) * 4, by_record=drift))
    stiffness = number(found, "k")
    assert (stiffness.pattern, stiffness.direction) == (Pattern.TIME, 1)
    assert stiffness.points_to is not None
    assert "changes slowly" in stiffness.points_to.cause, (
        "and not what stands for mass, stiffness and damping together"
    )
    for i, one in enumerate(stiffness.groups["record"]):
        assert abs(one.value - drift[i]["k"]) < 4.0 * one.std
    assert all(number(found, name).stable for name in ("m", "d"))


def test_wider_errors_of_the_bootstrap_widen_those_by_group() -> None:
    records = axis_records((1.0,) * 4, by_record=[{"k": 100.0 + 0.8 * i} for i in range(4)])
    context = context_of(AXIS, records, VALUES, {"x": NOISE})
    model = fitted(context, (), {})
    wider = {name: 1000.0 * error for name, error in model.fit.standard_errors.items()}
    assert not trust(context, model, records, VALUES).stable
    found = trust(context, model, records, VALUES, wider)
    assert found.stable
    assert {number.name: number.std for number in found.parameters} == wider


def test_a_stiffness_without_order_is_something_not_recorded() -> None:
    found = asked(axis_records((1.0,) * 5, by_record=[{"k": k} for k in (100.0, 102.0, 99.5, 101.5, 99.0)]))
    assert number(found, "k").pattern is Pattern.RECORD
    assert "without a trend" in found.statement


def test_a_number_that_changes_within_records_is_told() -> None:
    halves = [axis_records((1.0,) * 2, by_record=[{"k": k}]) for k in (100.0, 101.0)]
    records = tuple(
        replace(
            first,
            signals={
                "u": np.concatenate([first["u"], second["u"]]),
                "x": np.concatenate([first["x"], second["x"]]),
            },
        )
        for first, second in zip(*halves, strict=True)
    )
    found = number(asked(records), "k")
    assert (found.pattern, found.direction) == (Pattern.PORTION, 1)


SLIDE = """name = "slide"
summary = "A slide on a spring carries a payload."
[inputs.u]
unit = "N"
[constants.m_p]
unit = "kg"
default = 1.0
[parameters.m]
unit = "kg"
lower = 0.0
[parameters.k]
unit = "N/m"
lower = 0.0
[parameters.d]
unit = "N s/m"
lower = 0.0
[coordinates.x]
unit = "m"
[energy]
kinetic = "(m + m_p)*d(x)^2/2"
[joints.guide]
motion = "x"
stiffness = "k"
damping = "d"
[drives.motor]
signal = "u"
force = "motor"
along = "x"
[sensors.x]
reads = "x"
unit = "m"
"""


def test_friction_that_depends_on_the_payload_differs_with_that_constant() -> None:
    rig, known = rig_of_text(SLIDE), {"m_p": 1.0, "m": 1.0, "k": 100.0, "d": 1.0}
    effects, rng, records = (effect_named("coulomb_friction@guide"),), np.random.default_rng(2), []
    for i, payload in enumerate((0.5, 3.0, 1.5, 0.5)):
        asks = Record(f"r{i}", DT, {"u": 2.0 * multisine(rng)}, {}, constants={"m_p": payload})
        own = {**known, "m_p": payload, "T_c": 0.2 + 0.5 * payload}
        shown = simulate(compose(rig, effects), own, asks)
        records.append(shown.with_signals(x=shown["x"] + NOISE * rng.standard_normal(N)))
    context = context_of(rig, tuple(records), known, {"x": NOISE})
    found = trust(context, fitted(context, effects, {"T_c": 0.8}), records, known)
    friction = number(found, "T_c")
    assert (friction.pattern, friction.direction) == (Pattern.CONSTANT, 1)
    assert friction.goes_with[0] == "m_p"
    assert friction.of_effect
    assert "friction of a loaded joint" in found.statement


def test_one_record_is_compared_with_its_own_parts() -> None:
    found = asked(axis_records((1.0,)))
    assert found.stable
    assert set(found.parameters[0].groups) <= {"portion", "window"}
    assert "A single record cannot show" in found.statement


def test_numbers_known_as_a_ratio_are_told() -> None:
    """A drive force is missing from these records: of a decay only ratios to the mass are known."""
    rng, records = np.random.default_rng(1), []
    for i in range(2):
        still = Record(f"r{i}", DT, {"u": 2e-3 * multisine(rng)}, {})
        shown = simulate(compose(AXIS), VALUES, still, np.array([0.1 + 0.1 * i, 0.0]))
        records.append(shown.with_signals(x=shown["x"] + 1e-5 * rng.standard_normal(N)))
    context = context_of(AXIS, tuple(records), VALUES, {"x": 1e-5})
    found = trust(context, fitted(context, (), {}), records, VALUES)
    pairs = {pair.names: pair.text for pair in found.entangled}
    assert "ratio m/k" in pairs["m", "k"]


def test_an_element_is_asked_too() -> None:
    rig, known, rng, records = (
        RIGS["element"],
        {"d": 0.4, "k": 20.0, "force_off": 0.0},
        np.random.default_rng(3),
        [],
    )
    effects = (effect_named("coulomb_friction"),)
    t = DT * np.arange(N)
    for i, amplitude in enumerate((0.05, 0.2, 0.1)):
        x = amplitude * np.sin(2.0 * np.pi * (0.3 * t + 0.05 * t**2))
        shown = simulate(compose(rig, effects), {**known, "T_c": 0.1}, Record(f"r{i}", DT, {"x": x}, {}))
        records.append(shown.with_signals(force=shown["force"] + 2e-3 * rng.standard_normal(N)))
    context = context_of(rig, tuple(records), known, {"force": 2e-3})
    assert trust(context, fitted(context, effects, {"T_c": 0.1}), records, known).stable
    assert number(trust(context, fitted(context, (), {}), records, known), "d").pattern is Pattern.AMPLITUDE


def test_a_rig_that_drifts_is_asked_behind_its_observer() -> None:
    free = {**VALUES, "k": 0.0}
    records = axis_records((1.0, 2.0, 1.5), values=free)
    followed = Observer(("x",), 5.0).following(records)
    context = replace(
        context_of(AXIS, followed, free, {"x": NOISE}), held=frozenset({"force_off", "k", "x_off"})
    )
    found = trust(context, fitted(context, (), {}), records, free)
    assert found.stable
    assert {one.name for one in found.parameters} == {"m", "d"}


def test_nothing_fitted_is_nothing_to_trust() -> None:
    records = axis_records((1.0, 2.0))
    context = context_of(AXIS, records, VALUES, {"x": NOISE})
    model = context.score((), context.problem(context.composed(()), records).fit(VALUES, ()))
    assert trust(context, model, records, VALUES).parameters == ()


@pytest.mark.slow
def test_a_diagnosis_carries_it() -> None:
    effects = (effect_named("coulomb_friction"),)
    records = axis_records((1.0, 4.0, 0.5), effects, {"T_c": 0.3})
    named = tuple(replace(r, role="validation" if i == 2 else "estimation") for i, r in enumerate(records))
    given = {"m": 1.0, "d": 2.5, "k": 95.0, "x_off": 0.0, "force_off": 0.0}
    found = diagnose(Campaign("axis", AXIS, {"gain": 1.0}, given, named), list(effects))
    assert found.effects == ("coulomb_friction",)
    reported = found.to_json()["trust"]
    assert reported["stable"]
    friction = next(one for one in reported["parameters"] if one["name"] == "T_c")
    assert friction["of_effect"]
    assert [one["group"] for one in friction["by_group"]["record"]] == ["r0", "r1", "r2"]
    assert friction["points_to"] is None


def test_p_values_of_equal_groups_are_uniform() -> None:
    rng, p_values = np.random.default_rng(5), []
    freedom = np.array([6.0, 10.0, 8.0, 20.0])
    for _ in range(300):
        variances = rng.chisquare(freedom) / freedom
        p_values.append(spread(rng.standard_normal(4), variances, freedom).p_value)
    assert kstest(p_values, "uniform").pvalue > 0.01


def test_holm_allows_for_the_number_of_tests() -> None:
    assert adjusted([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])


@pytest.mark.parametrize(
    ("values", "along", "direction"),
    [
        ([1.0, 2.0, 3.0], [1.0, 2.0, 3.0], 1),
        ([3.0, 1.0, 2.0], [1.0, 3.0, 2.0], -1),
        ([1.0, 3.0, 1.0], [1.0, 2.0, 3.0], 0),
        ([1.0, 1.02, 3.0], [2.0, 2.0, 5.0], 1),
    ],
)
def test_a_course_is_one_along_the_quantity(
    values: Sequence[float], along: Sequence[float], direction: int
) -> None:
    assert course(np.array(values), np.full(len(values), 1e-4), np.array(along)).direction == direction


@pytest.mark.parametrize("pattern", [p for p in Pattern if p not in (Pattern.STABLE, Pattern.UNKNOWN)])
@pytest.mark.parametrize("role", list(Role))
def test_every_difference_points_to_something(pattern: Pattern, role: Role) -> None:
    assert all(meaning(pattern, role, direction) is not None for direction in (-1, 0, 1))


def test_the_level_is_that_of_adequacy() -> None:
    from rigsight.diagnose.policy import VERDICT

    assert TRUST.level == VERDICT.significance

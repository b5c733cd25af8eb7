"""One parameter set for sweeps and steps where there is one, and a plain no where there is none."""

from __future__ import annotations

from collections.abc import Mapping
from operator import attrgetter

import numpy as np
import pytest

from rigsight.effects import effect_named
from rigsight.errors import InputError
from rigsight.excitation import log_sweep, step
from rigsight.identify import GreyBoxFit, JointFit, characteristic_scales, estimate_conicity
from rigsight.identify.joint import fit_jointly
from rigsight.identify.transfer.conicity import creep_factor
from rigsight.records import Record
from rigsight.rigs import RUNNING_GEAR
from rigsight.simulate import Structure, compose, simulate

CONSTANTS = {"v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27}
TRUTH = {
    "J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "psi_off": 1e-3, "l_0": 0.25, "c_y": creep_factor(0.024, 0.1, 0.3), "y_off": -5e-4,
}  # fmt: skip
NOISE = 2e-5
GEAR = compose(RUNNING_GEAR)


def campaign(seed: int, cubic: float = 0.0) -> list[Record]:
    """A sweep and two steps of the virtual rig with sensor noise; a cubic spring makes the steps another rig than the sweep."""
    rng = np.random.default_rng(seed)
    t = 5e-3 * np.arange(4000)
    inputs = {
        "sweep": ("sweep", log_sweep(t, 0.5, 0.5, 60.0)),
        "up": ("step", step(t[:1600], 0.6, 1.0)),
        "down": ("step", -step(t[:1600], 0.6, 1.0)),
    }
    structure = compose(RUNNING_GEAR, [effect_named("cubic_stiffness")])
    records = []
    for name, (kind, u) in inputs.items():
        record = Record(name=name, dt=5e-3, signals={"u": u}, units={}, kind=kind, hold="zoh")  # type: ignore[arg-type]
        clean = simulate(structure, {**CONSTANTS, **TRUTH, "k_3": cubic}, record)
        noisy = {s: clean[s] + rng.normal(0.0, NOISE, u.size) for s in ("psi", "y")}
        records.append(clean.with_signals(**noisy))
    return records


@pytest.fixture(scope="module")
def linear() -> JointFit:
    return by_kind(campaign(1))


def by_kind(records: list[Record], structure: Structure = GEAR, **known: Mapping[str, float]) -> JointFit:
    held, start = known.pop("held", {}), known.pop("start", {})
    return fit_jointly(structure, records, CONSTANTS, held, start, group_of=attrgetter("kind"), **known)  # type: ignore[arg-type]


def test_the_joint_set_is_the_truth_within_its_errors(linear: JointFit) -> None:
    assert linear.fit.success, linear.fit.message
    for name, value in TRUTH.items():
        assert abs(linear.fit.values[name] - value) < 4.0 * linear.fit.standard_errors[name], name
        low, high = linear.interval(name, 0.9999)
        assert low < value < high
    for name in ("J_z", "k_c", "k_d", "l_0", "c_y"):
        assert linear.fit.values[name] == pytest.approx(TRUTH[name], rel=0.01), name


def test_the_noise_is_found_from_the_residuals(linear: JointFit) -> None:
    assert linear.noise == pytest.approx({"psi": NOISE, "y": NOISE}, rel=0.03)
    for residual in linear.fit.residuals:
        assert np.std(residual, axis=0) == pytest.approx(NOISE, rel=0.08)


def test_sweeps_and_steps_of_one_linear_rig_share_their_parameters(linear: JointFit) -> None:
    assert linear.probability > 0.01
    assert [k.kind for k in linear.kinds] == ["sweep", "step"]
    for kind in linear.kinds:
        for name in linear.fit.free:
            assert linear.fit.standard_errors[name] < 1.1 * kind.fit.standard_errors[name], name


def test_the_conicity_of_the_joint_fit_comes_with_its_interval(linear: JointFit) -> None:
    # With twice the error: one truth in twenty lies outside of an interval of 95 %.
    found = estimate_conicity(linear.fit.values["c_y"], 2.0 * linear.fit.standard_errors["c_y"], 0.1, 0.3)
    assert found.interval is not None
    assert found.determined
    assert found.interval[0] < 0.024 < found.interval[1]


@pytest.mark.slow
def test_the_comparison_is_calm_over_repeated_experiments() -> None:
    probabilities = [
        by_kind(campaign(seed), output_noise={"psi": NOISE, "y": NOISE}).probability for seed in range(10, 22)
    ]
    # Uniform on 0 to 1 where one set serves all; twelve draws have a mean of 0.5 with a standard deviation of 0.083.
    assert np.mean(probabilities) == pytest.approx(0.5, abs=0.25)
    assert min(probabilities) > 1e-3


def test_an_amplitude_dependent_rig_has_no_common_linear_set_and_says_so() -> None:
    records = campaign(3, cubic=4e5)
    found = by_kind(records)
    assert found.probability < 1e-3
    # Each kind alone fits its own records better than the other's set does.
    problem = GreyBoxFit(
        GEAR, records, characteristic_scales(GEAR.rig, records, found.fit.values), found.noise
    )
    sweep_only, step_only = (problem.fit(kind.fit.values, ()).residuals for kind in found.kinds)
    assert np.std(sweep_only[0][:, 0]) < np.std(step_only[0][:, 0])
    assert np.std(step_only[1][:, 0]) < np.std(sweep_only[1][:, 0])
    cured = by_kind(records, compose(RUNNING_GEAR, [effect_named("cubic_stiffness")]), start={"k_3": 1e5})
    assert cured.probability > 0.01
    assert abs(cured.fit.values["k_3"] - 4e5) < 4.0 * cured.fit.standard_errors["k_3"]


def test_a_known_parameter_keeps_its_value() -> None:
    found = by_kind(campaign(4), held={"l_0": 0.25})
    assert found.fit.values["l_0"] == 0.25
    assert "l_0" not in found.fit.free


def test_a_constant_is_not_replaced_by_a_start_value_of_its_name() -> None:
    found = by_kind(campaign(4), start={**TRUTH, "k_tau": 0.3})
    assert found.fit.values["k_tau"] == CONSTANTS["k_tau"]


def test_bad_campaigns_are_told_in_words() -> None:
    with pytest.raises(InputError, match="k_3"):
        by_kind(campaign(5), compose(RUNNING_GEAR, [effect_named("cubic_stiffness")]))

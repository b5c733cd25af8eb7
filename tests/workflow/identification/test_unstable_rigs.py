"""Rigs that are unstable without their loop: their numbers come back, and no signal is said to be turned round."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from rigsight.campaign import with_weighed_spring
from rigsight.diagnose.fit_context import start_values_of
from rigsight.diagnose.search.horizon import restores, windowing_of
from rigsight.effects.coulomb_friction import COULOMB_FRICTION
from rigsight.identify.identification import Identification
from rigsight.identify.record_identification import EstimationOptions, identify_record
from rigsight.records import Record
from rigsight.rigs import RUNNING_GEAR
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.identify import run_identify

from ...tiers import slow_but

DT, SAMPLES = 0.01, 1500
NOISE = 1e-5


def in_a_loop(m: float, d: float, k: float, seed: int, stiff: float = 120.0) -> dict[str, np.ndarray]:
    """Return input and motion of ``m x'' + d x' + k x = u`` under a sampled PD controller that follows a multisine."""
    rng, t = np.random.default_rng(seed), DT * np.arange(SAMPLES)
    goal = sum(
        np.sin(2.0 * np.pi * f * t + p)
        for f, p in zip((0.2, 0.5, 0.9, 1.6, 2.7), rng.uniform(0.0, 6.0, 5), strict=True)
    )
    # Zero-order hold of the state equations.
    block = np.zeros((3, 3))
    block[0, 1], block[1] = 1.0, [-k / m, -d / m, 1.0 / m]
    series, term = np.eye(3), np.eye(3)
    for order in range(1, 20):
        term = term @ block * DT / order
        series = series + term
    state, u, x = np.zeros(2), np.zeros(SAMPLES), np.zeros(SAMPLES)
    for i in range(SAMPLES):
        x[i] = state[0]
        u[i] = stiff * (0.01 * goal[i] - state[0]) - 12.0 * state[1]
        state = series[:2, :2] @ state + series[:2, 2] * u[i]
    return {"t": t, "u": u, "x": x + rng.normal(scale=NOISE, size=SAMPLES)}


def campaign_of(
    folder: Path, records: Mapping[str, Mapping[str, np.ndarray]], parameters: str = "", model: str = "axis"
) -> Path:
    """Write records as a campaign; the last one is held out."""
    folder.mkdir(exist_ok=True)
    toml = f'title = "c"\n[rig]\nmodel = "{model}"\n[rig.parameters]\n{parameters}\n'
    for number, (name, signals) in enumerate(records.items(), 1):
        np.savetxt(
            folder / f"{name}.csv",
            np.column_stack(list(signals.values())),
            delimiter=",",
            header=",".join(signals),
            comments="",
        )
        role = "validation" if number == len(records) else "estimation"
        toml += f'[[records]]\nfile = "{name}.csv"\nhold = "zoh"\nrole = "{role}"\n'
    (folder / "campaign.toml").write_text(toml)
    return folder


def differs(found: Identification, truth: Mapping[str, float]) -> dict[str, float]:
    """Return how far each number is from the truth, in standard errors."""
    fit = found.joint.fit.fit
    return {name: abs(fit.values[name] - value) / fit.standard_errors[name] for name, value in truth.items()}


@pytest.mark.parametrize("truth", [{"m": 2.0, "d": 5.0, "k": -30.0}, {"m": 0.5, "d": 0.2, "k": -8.0}])
def test_a_negative_stiffness_comes_back(tmp_path: Path, truth: dict[str, float]) -> None:
    records = {name: in_a_loop(**truth, seed=seed) for seed, name in enumerate("ab")}
    found = run_identify(campaign_of(tmp_path, records))
    assert max(differs(found, truth).values()) < 4.0
    assert found.model["parameters"]["k"] < 0.0
    assert found.joint.scores[-1].nrmse["x"] < 0.01


@pytest.mark.slow
def test_no_sign_is_to_be_changed_where_the_stiffness_is_negative() -> None:
    signals = in_a_loop(2.0, 5.0, -30.0, 0)
    turned = {"u": signals["u"], "psi": signals["x"]}
    constants = {"v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27}

    def problem(own: dict[str, np.ndarray]) -> str:
        record = Record("a", DT, own, {}, hold="zoh", kind="multisine")
        return identify_record(record, RUNNING_GEAR, constants, EstimationOptions()).motion.problem

    assert "opposite sign" not in problem(turned)
    stable = in_a_loop(2.0, 5.0, 40.0, 0)
    assert "opposite sign" in problem({"u": stable["u"], "psi": -stable["x"]})


def test_a_diagnosis_holds_an_unstable_rig(tmp_path: Path) -> None:
    records = {name: in_a_loop(2.0, 5.0, -30.0, seed=seed) for seed, name in enumerate("ab")}
    campaign = read_campaign(campaign_of(tmp_path, records, "m = 2.0\nd = 5.0\nk = -20.0"))
    assert not restores(campaign)
    windowing, _ = windowing_of(campaign, {"x": NOISE}, 1, start_values_of(campaign))
    fastest = np.max(np.abs(np.roots([2.0, 5.0, -30.0])))
    assert windowing.bandwidth is not None
    assert windowing.bandwidth > fastest
    stable = {name: in_a_loop(2.0, 5.0, 300.0, seed=seed) for seed, name in enumerate("ab")}
    assert restores(read_campaign(campaign_of(tmp_path / "stable", stable, "m = 2.0\nd = 5.0\nk = 300.0")))


@pytest.mark.parametrize(("k", "released"), [(-8.0, True), (0.0, False)])
def test_a_spring_that_is_given_as_absent_is_weighed(tmp_path: Path, k: float, released: bool) -> None:
    records = {name: in_a_loop(2.0, 5.0, k, seed=seed) for seed, name in enumerate("ab")}
    folder = campaign_of(tmp_path, records, "m = 2.0\nd = 5.0\nk = 0.0")
    weighed = with_weighed_spring(read_campaign(folder))
    assert weighed.spring_released == released
    assert weighed.drifts
    assert weighed.given["k"] == 0.0
    found = run_identify(folder)
    assert weighed.notes[-1] in found.warnings
    assert ("k" in found.joint.names) == released
    if released:
        assert differs(found, {"k": k})["k"] < 4.0


@pytest.mark.parametrize(("size", "released"), [(1.0, True), (5000.0, False)])
def test_a_shaft_that_turns_by_more_than_a_turn_has_no_spring(
    tmp_path: Path, size: float, released: bool
) -> None:
    loop = in_a_loop(2.0, 5.0, -8.0, 0)
    turned = {"t": loop["t"], "u": size * loop["u"], "x_rad": size * loop["x"]}
    assert (np.ptp(turned["x_rad"]) > 2.0 * np.pi) is not released
    folder = campaign_of(tmp_path, dict.fromkeys("ab", turned), "m = 2.0\nk = 0.0")
    file = folder / "campaign.toml"
    file.write_text(file.read_text().replace('hold = "zoh"', 'hold = "zoh"\ncolumns.x = "x_rad"'))
    assert with_weighed_spring(read_campaign(folder)).spring_released is released


def test_an_absent_spring_is_weighed_without_effects_that_are_still_to_be_fitted(tmp_path: Path) -> None:
    records = {name: in_a_loop(2.0, 5.0, 0.0, seed=seed) for seed, name in enumerate("ab")}
    folder = campaign_of(tmp_path, records, "m = 2.0\nk = 0.0")
    found = run_identify(folder, effects=[COULOMB_FRICTION])
    assert found.warnings[0].startswith("k = 0 stands for no spring")
    assert "T_c" in found.joint.names


@pytest.mark.parametrize("parameters", slow_but("k = 0.0", of=["k = 0.0", ""]))
def test_a_double_integrator_is_identified(tmp_path: Path, parameters: str) -> None:
    records = {name: in_a_loop(2.0, 0.0, 0.0, seed=seed) for seed, name in enumerate("ab")}
    found = run_identify(campaign_of(tmp_path, records, parameters))
    fit = found.joint.fit.fit
    assert differs(found, {"m": 2.0})["m"] < 4.0
    assert fit.values["d"] < 4.0 * fit.standard_errors["d"]
    assert not found.reached
    assert found.joint.scores[-1].nrmse["x"] < 0.01


def test_an_element_may_be_given_without_stiffness(tmp_path: Path) -> None:
    x = 0.01 * np.sin(np.cumsum(np.linspace(0.02, 0.3, SAMPLES)))
    force = 30.0 * np.gradient(x, DT) + np.random.default_rng(0).normal(scale=1e-3, size=SAMPLES)
    records = {name: {"t": DT * np.arange(SAMPLES), "x": x, "force": force} for name in "ab"}
    found = run_identify(
        campaign_of(tmp_path / "c", records, "d = 20.0\nk = 0.0", "element"), tmp_path / "out"
    )
    assert {"d", "k"} <= set(found.joint.names)
    assert found.model["parameters"]["d"] == pytest.approx(30.0, rel=0.02)


@pytest.mark.slow
def test_a_damping_of_the_other_sign_stops_at_its_bound(tmp_path: Path) -> None:
    t = DT * np.arange(SAMPLES)

    def free(d: float, start: float, seed: int) -> dict[str, np.ndarray]:
        root = (-d + np.sqrt(complex(d * d - 400.0))) / 2.0
        noise = np.random.default_rng(seed).normal(scale=1e-3, size=SAMPLES)
        return {"t": t, "u": 0.0 * t, "x": start * np.real(np.exp(root * t)) + noise}

    growing = {name: free(-0.1, 0.2, seed) for seed, name in enumerate("abc")}
    found = run_identify(campaign_of(tmp_path / "grows", growing, "m = 1.0\nd = 0.0\nk = 100.0"))
    (reached,) = found.reached
    assert (reached.name, reached.side) == ("d", "lower")
    assert reached.asked < -2.0 * reached.std
    assert not any("no influence" in reported for reported in found.identifiability.statements)  # type: ignore[union-attr]
    assert not found.joint.statement.startswith("One parameter set fits")
    undamped = {name: free(0.0, 0.2, seed) for seed, name in enumerate("abc")}
    none = run_identify(campaign_of(tmp_path / "none", undamped, "m = 1.0\nd = 0.0\nk = 100.0"))
    assert not none.reached
    assert none.joint.statement.startswith("One parameter set fits")

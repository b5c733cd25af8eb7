"""The identification of whole campaigns: true numbers within their intervals, and bad records told in words."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rigsight.effects import effect_named
from rigsight.errors import InputError
from rigsight.excitation import linear_sweep, log_sweep, step
from rigsight.identify.identification import Identification
from rigsight.records import Kind, Record, Role
from rigsight.rigs import AXIS, ELEMENT, RUNNING_GEAR, Rig
from rigsight.rigs.running_gear import creep_factor
from rigsight.simulate import compose, simulate
from rigsight.workflow.identify import run_identify
from rigsight.workflow.progress import Step
from rigsight.workflow.simulate import run_simulate

CONSTANTS = {"v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27}
TRUTH = {
    "J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "psi_off": 1e-3, "l_0": 0.25, "c_y": creep_factor(0.024, 0.1, 0.3), "y_off": -5e-4,
}  # fmt: skip
NOISE = 2e-5
DT = 5e-3


@dataclass(frozen=True)
class Run:
    """One record of a virtual campaign."""

    name: str
    u: np.ndarray
    kind: Kind = "sweep"
    role: Role = "estimation"
    amplitude: float | None = None


def sweep(name: str, amplitude: float, role: Role = "estimation", seconds: float = 25.0) -> Run:
    t = DT * np.arange(round(seconds / DT))
    return Run(name, log_sweep(t, amplitude, 0.6, 60.0), "sweep", role, amplitude)


def jump(name: str, amplitude: float) -> Run:
    return Run(name, step(DT * np.arange(1600), amplitude, 1.0), "step", "estimation", amplitude)


def write_campaign(
    folder: Path,
    runs: list[Run],
    rig: Rig = RUNNING_GEAR,
    values: Mapping[str, float] = {**CONSTANTS, **TRUTH},
    parameters: str = "",
    effect: str | None = None,
    change: Callable[[str, dict[str, np.ndarray]], None] | None = None,
    seed: int = 3,
) -> Path:
    """Measure a virtual rig and leave the campaign as a measurement would."""
    rng = np.random.default_rng(seed)
    folder.mkdir(parents=True, exist_ok=True)
    structure = compose(rig, [effect_named(effect)] if effect else [])
    constants = "\n".join(f"{c.name} = {values[c.name]!r}" for c in rig.constants)
    toml = f'title = "bench"\n[rig]\nmodel = "{rig.name}"\n[rig.constants]\n{constants}\n[rig.parameters]\n{parameters}\n'
    source = rig.inputs[0].name
    for run in runs:
        record = Record(name=run.name, dt=DT, signals={source: run.u}, units={}, hold="foh")
        clean = simulate(structure, values, record)
        signals = {name: np.array(samples) for name, samples in clean.signals.items()}
        for signal in rig.outputs:
            signals[signal.name] += rng.normal(scale=NOISE, size=run.u.size)
        if change is not None:
            change(run.name, signals)
        rows = np.column_stack([record.t, *signals.values()])
        lines = [",".join(("t", *signals)), *(",".join(f"{value:.9g}" for value in row) for row in rows)]
        (folder / f"{run.name}.csv").write_text("\n".join(lines) + "\n")
        amplitude = "" if run.amplitude is None else f"amplitude = {run.amplitude}\n"
        toml += f'[[records]]\nfile = "{run.name}.csv"\nrole = "{run.role}"\nkind = "{run.kind}"\nhold = "foh"\n{amplitude}'
    (folder / "campaign.toml").write_text(toml)
    return folder


@pytest.fixture(scope="module")
def linear_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("linear")
    runs = [
        sweep("low", 0.4),
        sweep("high", 0.9),
        jump("step", 0.6),
        sweep("check", 0.7, "validation"),
        sweep("beyond", 1.5, "validation"),
    ]
    return write_campaign(folder / "campaign", runs)


@pytest.fixture(scope="module")
def steps_told() -> list[Step]:
    return []


@pytest.fixture(scope="module")
def linear(linear_folder: Path, steps_told: list[Step]) -> Identification:
    return run_identify(linear_folder, linear_folder.parent / "out", n_jobs=1, listener=steps_told.append)


@pytest.fixture(scope="module")
def written(linear: Identification, linear_folder: Path) -> dict[str, Any]:
    return json.loads((linear_folder.parent / "out" / "identification.json").read_text("utf-8"))


def test_every_record_of_a_linear_rig_gives_the_truth_within_its_errors(linear: Identification) -> None:
    assert [r.record.name for r in linear.records] == ["low", "high", "step"]
    for record in linear.records:
        assert set(record.estimates) == set(TRUTH)
        for name, (value, error) in record.estimates.items():
            assert abs(value - TRUTH[name]) < 4.0 * error, (record.record.name, name)
        for name in ("J_z", "k_c", "k_d", "l_0", "c_y"):
            assert record.estimates[name][0] == pytest.approx(TRUTH[name], rel=0.01), (
                record.record.name,
                name,
            )


def test_the_joint_set_is_better_than_any_record_alone(linear: Identification) -> None:
    fit = linear.joint.fit.fit
    for name, value in TRUTH.items():
        assert abs(fit.values[name] - value) < 4.0 * fit.standard_errors[name], name
        assert fit.standard_errors[name] < min(r.estimates[name][1] for r in linear.records), name
    assert linear.joint.statement.startswith("One parameter set serves all 3")
    assert linear.joint.conicity is not None
    low, high = linear.joint.conicity.interval or (np.nan, np.nan)
    assert low < 0.024 < high
    assert linear.joint.pooled is None


def test_validation_records_are_scored_and_never_fitted(linear: Identification) -> None:
    scores = {s.record: s for s in linear.joint.scores if s.role == "validation"}
    assert set(scores) == {"check", "beyond"}
    assert {r.record for r in linear.joint.fit.residuals} == {"low", "high", "step"}
    for score in scores.values():
        assert score.nrmse["psi"] < 0.01
        assert score.nrmse["y"] < 0.05


def test_a_validation_amplitude_outside_what_was_identified_is_told(linear: Identification) -> None:
    told = [warning for warning in linear.warnings if "outside what was identified" in warning]
    assert len(told) == 1
    assert "'beyond'" in told[0]
    assert "1.5 A" in told[0]
    assert "0.4 to 0.9 A" in told[0]


def test_a_linear_rig_does_not_change_with_the_amplitude(linear: Identification) -> None:
    assert linear.changing == ()
    assert linear.amplitude_statement.startswith("No parameter changes with the amplitude")


def test_the_resonance_is_seen_where_it_is(linear: Identification) -> None:
    damped = np.sqrt(TRUTH["k_c"] / TRUTH["J_z"] - 0.5 * (TRUTH["k_d"] / TRUTH["J_z"]) ** 2)
    for record in linear.records[:2]:
        assert record.resonance == pytest.approx(damped, rel=0.03)
    assert linear.records[2].resonance is None


def test_the_results_are_complete(
    linear: Identification, written: dict[str, Any], linear_folder: Path, steps_told: list[Step]
) -> None:
    out = linear_folder.parent / "out"
    figures = {"bode_low.svg", "bode_high.svg", "responses.svg", "amplitudes.svg"}
    assert {path.name for path in out.iterdir()} == {"identification.json", "model.json", *figures}
    assert written["schema_version"] == 1
    assert set(written["figures"]) == figures
    for file in figures:
        assert (out / file).read_text().lstrip().startswith("<?xml")
    for row in written["amplitudes"]["table"]:
        assert {"record", "kind", "amplitude", "resonance", *TRUTH} == set(row)
        assert set(row["k_c"]) == {"value", "std", "unit"}
    record = written["records"][0]
    assert record["identified"]
    psi, y = record["paths"]
    assert (psi["fit"]["form"], y["fit"]["form"]) == ("PT2", "PT1")
    low, high = psi["physical"]["k_c"]["interval"]
    assert low < psi["physical"]["k_c"]["value"] < high
    response = psi["frequency_response"]
    assert len(response["omega"]) == len(response["real"]) == len(response["variance"])
    assert min(psi["coherence"]["values"]) >= 0.0
    assert "delta_0" in record["delta_0"]["statement"]
    assert written["joint"]["probability"] > 0.01
    assert steps_told[-1].done == steps_told[-1].total


def test_the_model_predicts_what_was_not_fitted(linear: Identification, linear_folder: Path) -> None:
    predicted = run_simulate(linear_folder.parent / "out", linear_folder / "check.csv")
    measured = np.genfromtxt(linear_folder / "check.csv", delimiter=",", names=True)
    assert np.std(predicted["psi"] - measured["psi"]) < 1.1 * NOISE
    assert np.std(predicted["y"] - measured["y"]) < 1.1 * NOISE


@pytest.fixture(scope="module")
def hardening(tmp_path_factory: pytest.TempPathFactory) -> Identification:
    runs = [sweep("low", 0.1), sweep("high", 1.0), jump("step", 0.6)]
    values = {**CONSTANTS, **TRUTH, "k_3": 4e5}
    return run_identify(
        write_campaign(tmp_path_factory.mktemp("hard"), runs, values=values, effect="cubic_stiffness")
    )


def test_a_hardening_spring_is_seen_in_the_amplitudes(hardening: Identification) -> None:
    assert "k_c" in hardening.changing
    assert "k_c rises" in hardening.amplitude_statement
    assert "rigsight diagnose" in hardening.amplitude_statement
    assert not {"l_0", "c_y"} & set(hardening.changing)
    assert any("not the whole of the rig" in warning for warning in hardening.warnings)


def test_no_set_serves_a_hardening_spring_and_its_lateral_part_stays_clean(hardening: Identification) -> None:
    joint = hardening.joint
    assert joint.statement.startswith("No single parameter set serves all 3")
    assert "pulls most" in joint.statement
    # The lateral equation is linear all the same; a wrong yaw angle must not spoil its numbers.
    assert joint.pooled is not None
    for name in ("l_0", "c_y"):
        error = joint.pooled.standard_errors[name]
        assert abs(joint.pooled.values[name] - TRUTH[name]) < 4.0 * error
        assert hardening.model["parameters"][name] == joint.pooled.values[name]


def test_a_record_that_never_drives_the_resonance_is_not_fitted(tmp_path: Path) -> None:
    t = DT * np.arange(8000)
    slow = Run("slow", linear_sweep(t, 0.5, 0.1, 1.5), "sweep", "estimation", 0.5)
    found = run_identify(write_campaign(tmp_path, [sweep("good", 0.5), slow]))
    (bad,) = [r for r in found.records if r.record.name == "slow"]
    assert bad.motion.fit is None
    assert bad.motion.physical is None
    assert "the resonance lies at 12 rad/s" in bad.motion.problem
    assert found.joint.left_out == ("slow",)
    assert any("'slow'" in w and "excitation there" in w for w in found.warnings)
    assert any("'slow' was left out" in w for w in found.warnings)
    assert found.joint.fit.fit.values["k_c"] == pytest.approx(81.0, rel=0.01)


def test_a_campaign_without_any_excitation_of_the_resonance_is_refused(tmp_path: Path) -> None:
    t = DT * np.arange(8000)
    slow = Run("slow", linear_sweep(t, 0.05, 0.1, 0.5), "sweep", "estimation", 0.05)
    with pytest.raises(InputError, match="No estimation record shows the motion") as told:
        run_identify(write_campaign(tmp_path / "c", [slow]), tmp_path / "out")
    assert "slow" in str(told.value)
    assert not (tmp_path / "out").exists()


def test_a_sweep_too_short_for_its_peak_is_told(tmp_path: Path) -> None:
    sharp = {**CONSTANTS, **TRUTH, "k_d": 0.05}
    found = run_identify(write_campaign(tmp_path, [sweep("short", 0.1, seconds=20.0)], values=sharp))
    (told,) = [w for w in found.warnings if "wide (half power)" in w]
    assert "'short'" in told
    assert "record at least" in told


def test_a_resolution_that_a_record_is_too_short_for_is_refused(tmp_path: Path) -> None:
    campaign = write_campaign(tmp_path / "c", [sweep("short", 0.5, seconds=10.0)])
    with pytest.raises(InputError, match=r"too short for a resolution of 0\.5 rad/s. Record at least"):
        run_identify(campaign, tmp_path / "out", resolution=0.5)
    assert not (tmp_path / "out").exists()


def test_a_dead_sensor_of_y_is_told_and_the_yaw_part_identified(tmp_path: Path) -> None:
    def die(name: str, signals: dict[str, np.ndarray]) -> None:
        signals["y"][:] = 0.001

    found = run_identify(write_campaign(tmp_path, [sweep("one", 0.5)], change=die))
    (record,) = found.records
    assert set(record.estimates) == {"J_z", "k_c", "k_d", "psi_off"}
    assert any("y never changes" in w for w in found.warnings)
    assert "l_0" not in found.joint.names


def test_records_without_y_leave_the_lateral_part_out(tmp_path: Path) -> None:
    def lack(name: str, signals: dict[str, np.ndarray]) -> None:
        del signals["y"]

    runs = [sweep("one", 0.5), jump("step", 0.5)]
    found = run_identify(write_campaign(tmp_path, runs, parameters="l_0 = 0.3\nc_y = 0.9", change=lack))
    assert found.joint.conicity is None
    assert set(found.joint.names) == {"J_z", "k_c", "k_d", "psi_off"}
    assert (found.model["parameters"]["l_0"], found.model["parameters"]["c_y"]) == (0.3, 0.9)
    assert any("no y" in w for w in found.warnings)
    assert any("not identified" in w for w in found.warnings)


AXIS_TRUTH = {"gain": -2.0, "m": 2.0, "d": 5.0, "k": 800.0, "x_off": 1e-3, "force_off": 0.0}


def test_an_axis_gives_mass_damping_and_stiffness_whatever_the_sign_of_its_drive(tmp_path: Path) -> None:
    t = DT * np.arange(6000)
    runs = [Run("one", linear_sweep(t, 2.0, 2.0, 60.0)), Run("step", step(t[:1600], 2.0, 1.0), "step")]
    found = run_identify(write_campaign(tmp_path, runs, AXIS, AXIS_TRUTH))
    for record in found.records:
        for name in ("m", "d", "k", "x_off"):
            value, error = record.estimates[name]
            assert abs(value - AXIS_TRUTH[name]) < 4.0 * error, (record.record.name, name)
    assert found.model["parameters"]["k"] == pytest.approx(800.0, rel=0.01)


def test_an_axis_without_a_spring_is_identified_from_its_velocity(tmp_path: Path) -> None:
    t = DT * np.arange(6000)
    free = {"gain": 1.0, "m": 2.0, "d": 8.0, "k": 0.0, "x_off": 0.0, "force_off": 0.0}
    runs = [Run("one", linear_sweep(t, 4.0, 1.0, 40.0)), Run("two", linear_sweep(t, 2.0, 1.0, 40.0))]
    found = run_identify(write_campaign(tmp_path, runs, AXIS, free, "k = 0.0"))
    assert any("no spring and no resonance" in w for w in found.warnings)
    for record in found.records:
        assert record.motion.fit is not None
        assert record.motion.fit.response == "x'"
        for name in ("m", "d"):
            value, error = record.estimates[name]
            assert abs(value - free[name]) < 4.0 * error, (record.record.name, name)
    assert found.model["parameters"]["k"] == 0.0
    assert found.model["parameters"]["m"] == pytest.approx(2.0, rel=0.01)


def test_an_element_shows_its_dynamic_stiffness(tmp_path: Path) -> None:
    t = DT * np.arange(4000)
    truth = {"d": 3.0, "k": 40.0, "force_off": 0.2}
    runs = [Run("one", linear_sweep(t, 0.01, 2.0, 30.0)), Run("two", linear_sweep(t, 0.02, 2.0, 30.0))]
    found = run_identify(write_campaign(tmp_path / "c", runs, ELEMENT, truth), tmp_path / "out")
    for record in found.records:
        measured = record.motion.measured
        assert measured is not None
        inside = (measured.omega > 4.0) & (measured.omega < 25.0)
        expected = 40.0 + 3.0j * measured.omega[inside]
        np.testing.assert_allclose(measured.values[inside], expected, rtol=0.05)
        for name, value in truth.items():
            assert record.estimates[name][0] == pytest.approx(value, rel=0.02)
    assert (tmp_path / "out" / "bode_one.svg").is_file()
    assert found.model["parameters"]["d"] == pytest.approx(3.0, rel=0.01)


@pytest.mark.parametrize("method", ["local_polynomial", "h1", "thesis"])
def test_every_method_comes_near_the_truth(method: str, linear_folder: Path) -> None:
    found = run_identify(linear_folder, method=method)
    record = found.records[1]
    assert record.motion.measured is not None
    expected = "thesis" if method == "thesis" else "H1" if method == "h1" else "local polynomial"
    assert record.motion.measured.method.startswith(expected)
    for name in ("J_z", "k_c"):
        assert record.estimates[name][0] == pytest.approx(TRUTH[name], rel=0.1), name


def test_an_unknown_method_and_a_senseless_resolution_are_refused(linear_folder: Path) -> None:
    with pytest.raises(InputError, match="Did you mean 'thesis'"):
        run_identify(linear_folder, method="thesi")
    with pytest.raises(InputError, match="positive number"):
        run_identify(linear_folder, resolution=-1.0)


def test_nothing_half_written_is_left(
    linear_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("rigsight.workflow.results.os.fsync", broken)
    with pytest.raises(InputError, match="disk is full"):
        run_identify(linear_folder, tmp_path / "new" / "out")
    assert not (tmp_path / "new").exists()


def test_records_of_like_names_get_figures_of_their_own(tmp_path: Path) -> None:
    campaign = write_campaign(
        tmp_path / "c", [sweep("one", 0.5, seconds=20.0), sweep("two", 0.4, seconds=20.0)]
    )
    toml = (campaign / "campaign.toml").read_text()
    toml = toml.replace('file = "one.csv"', 'file = "one.csv"\nname = "a b"')
    (campaign / "campaign.toml").write_text(
        toml.replace('file = "two.csv"', 'file = "two.csv"\nname = "A/B"')
    )
    run_identify(campaign, tmp_path / "out")
    assert (tmp_path / "out" / "bode_a_b.svg").is_file()
    assert (tmp_path / "out" / "bode_A_B_2.svg").is_file()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("campaign", "name"),
    [
        ("silverbox", "x"),
        ("boucwen", "x"),
        ("mr_damper/campaign_on.toml", "force"),
        ("mr_damper/campaign_off.toml", "force"),
    ],
)
def test_measured_campaigns_end_in_results(
    campaign: str, name: str, shared_data: Path, tmp_path: Path
) -> None:
    found = run_identify(shared_data / campaign, tmp_path)
    assert (tmp_path / "identification.json").is_file()
    for score in found.joint.scores:
        assert 0.0 < score.nrmse[name] < 0.5

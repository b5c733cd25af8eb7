"""A cause that is added to measured records is one that the rig itself could have had."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rigsight.campaign import Campaign
from rigsight.effects import CATALOGUE, effect_named, family_of
from rigsight.errors import InputError, SimulationError
from rigsight.records import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate
from rigsight.workflow.campaign.in_memory import make_campaign
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight_bench import benches
from rigsight_bench.report.markdown import blind_markdown
from rigsight_bench.report.page import render_blind
from rigsight_bench.running.files import RUN_FILE, BenchFolder
from rigsight_bench.trials import Trial, draw_trial, n_trials
from rigsight_bench.trials.measured.base import Base, base_of
from rigsight_bench.trials.measured.campaigns import campaign_files, measured_base, measured_spots
from rigsight_bench.trials.measured.spike import spiked, unspiked
from rigsight_bench.trials.measured.spots import Spot, spots
from rigsight_bench.trials.measured.trial import again, base_beside, measured_cells

Run = Callable[..., tuple[int, str, str]]

SHARED = Path("/work/shared/measured")
DT = 0.005
TRUTH = {"gain": 2.0, "m": 2.0, "d": 5.0, "k": 300.0, "x_off": 0.0, "force_off": 0.0, "T_c": 0.5}
NOISE = 2e-6
"""Of the reading [m]; its motion is some 100 mm."""
ADDED = {
    "stribeck_friction": {"T_c": 1.5, "T_s": 2.5, "w_s": 0.05},
    "load_dependent_friction": {"T_c": 1.0, "mu": 0.1},
    "presliding_friction": {"T_c": 2.0, "x_p": 2e-3},
    "bouc_wen_hysteresis": {"A": 1.0, "a": 0.5, "beta": 150.0, "gamma": 50.0, "n": 1.0},
    "maxwell_branch": {"k_m": 150.0, "tau_m": 0.1},
    "quadratic_damping": {"c_2": 3.0},
    "cubic_stiffness": {"k_3": 1.5e3},
    "gravity_pendulum": {"k_g": 3e3},
    "torque_ripple": {"T_sin": 1.0, "T_cos": 0.5, "kappa": 300.0},
    "end_stop": {"k_s": 100.0, "s": 0.1},
    "free_play": {"g": 2e-3},
    "backlash": {"g": 2e-3},
    "flexible_mode": {"m_a": 0.4, "w_a": 20.0, "zeta_a": 0.1},
    "periodic_disturbance": {"T_p": 1.5, "w_p": 9.0},
    "input_delay": {"T_d": 0.02},
    "input_dead_zone": {"u_0": 0.5},
    "time_shift": {"T_x": -0.02},
    "sensor_lag": {"T_m": 0.03},
    "encoder_eccentricity": {"e_sin": 1e-3, "e_cos": 5e-4, "kappa": 300.0},
}
"""Parameters of effects that clearly show on this axis."""


def _record(number: int, effects: list[str], values: dict[str, float]) -> Record:
    """Return a record of an axis under a random-phase multisine, from rest."""
    rng = np.random.default_rng([7, number])
    t = DT * np.arange(3000)
    omega, phases = np.linspace(1.0, 25.0, 30), rng.uniform(0.0, 2.0 * np.pi, 30)
    u = 12.0 * np.sum(np.sin(np.outer(t, omega) + phases), axis=1) / np.sqrt(30.0)
    u *= np.minimum(t / 0.5, 1.0)
    record = Record(
        f"day_{number}",
        DT,
        {"u": u},
        {"u": "input"},
        role="estimation" if number < 3 else "validation",
        kind="multisine",
        amplitude=12.0,
    )
    x = simulate(compose(AXIS, [effect_named(name) for name in effects]), values, record, accuracy=1e-7)["x"]
    return record.with_signals(x=x + rng.normal(scale=NOISE, size=x.size))


@pytest.fixture(scope="module")
def campaign() -> Campaign:
    records = [_record(number, ["coulomb_friction"], TRUTH) for number in (1, 2, 3)]
    given = {"m": 1.5, "d": 3.0, "k": 250.0}
    return make_campaign("axis", records, constants={"gain": TRUTH["gain"]}, parameters=given)


@pytest.fixture(scope="module")
def base(campaign: Campaign) -> Base:
    return base_of(campaign)


@pytest.fixture(scope="module")
def folder(campaign: Campaign, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with this campaign in files."""
    place = tmp_path_factory.mktemp("measured")
    (place / "axis").mkdir()
    texts = [
        '[rig]\nmodel = "axis"\nconstants = { gain = 2.0 }\nparameters = { m = 1.5, d = 3.0, k = 250.0 }'
    ]
    for record in campaign.records:
        rows = np.column_stack([record.t, record["u"], record["x"]])
        np.savetxt(
            place / "axis" / f"{record.name}.csv",
            rows,
            delimiter=",",
            header="t,u,x",
            comments="",
            fmt="%.12g",
        )
        texts.append(f'[[records]]\nfile = "{record.name}.csv"\nrole = "{record.role}"\nkind = "multisine"')
    (place / "axis" / "campaign.toml").write_text("\n".join(texts) + "\n")
    return place


@pytest.fixture(scope="module")
def trial(folder: Path) -> Trial:
    return draw_trial("measured", 1, 0, folder)


def test_base_equations_are_found_along_the_motion(base: Base) -> None:
    assert [effect.name for effect in base.modelled] == ["coulomb_friction"]
    for name in ("m", "d", "k", "T_c"):
        assert base.values[name] == pytest.approx(TRUTH[name], rel=0.03), name


def test_what_a_drive_scales_is_not_moved(campaign: Campaign, base: Base) -> None:
    assert base.values["gain"] == TRUTH["gain"]
    assert "gain" not in base.free
    # Neither is a spring that the given simulation does not have.
    without = replace(campaign, parameters={**campaign.parameters, "k": 0.0})
    assert base_of(without).values["k"] == 0.0


def _spot(base: Base, kind: str) -> Spot:
    return next(spot for spot in spots(base) if spot.effect.name == kind)


def test_an_encoder_never_reads_backwards(base: Base, campaign: Campaign) -> None:
    spot, steep = _spot(base, "encoder_eccentricity"), {"e_sin": 4e-3, "e_cos": 0.0, "kappa": 300.0}
    with pytest.raises(SimulationError, match="run backwards"):
        spiked(base, spot, steep, campaign.records[0])


def test_no_tone_is_faster_than_the_samples_show(base: Base, campaign: Campaign) -> None:
    record = campaign.estimation[0]
    spot, nyquist = _spot(base, "periodic_disturbance"), np.pi / record.dt
    spiked(base, spot, {"T_p": 0.01, "w_p": 0.9 * nyquist}, record)
    with pytest.raises(SimulationError, match="half the sampling frequency"):
        spiked(base, spot, {"T_p": 0.01, "w_p": 1.1 * nyquist}, record)


@pytest.mark.parametrize("kind", ADDED)
def test_a_changed_record_is_one_of_the_rig_with_the_effect(
    campaign: Campaign, base: Base, kind: str
) -> None:
    exact = replace(base, values=dict(TRUTH))
    # Friction of the base and friction that is added are not distinguished: the base is without it then.
    if family_of(kind) == "dry_friction":
        assert base_beside(base, _spot(base, kind)).modelled == ()
        plain = replace(
            campaign,
            records=tuple(_record(n, [], {k: v for k, v in TRUTH.items() if k != "T_c"}) for n in (1, 2, 3)),
        )
        exact = replace(exact, campaign=plain, modelled=())
    spot = _spot(exact, kind)
    record = exact.campaign.records[0]
    changed = spiked(exact, spot, ADDED[kind], record)
    structure = compose(AXIS, [*exact.modelled, spot.effect])
    own = {structure.parameter_name(spot.effect, name): value for name, value in ADDED[kind].items()}
    with_it = simulate(structure, {**TRUTH, **own}, changed, accuracy=1e-7)
    without = simulate(compose(AXIS, exact.modelled), TRUTH, changed, accuracy=1e-7)
    # What the beginning of a record does not tell (the input before it) is forgotten after some periods.
    late = slice(1000, None)
    remainder, gap = (float(np.std((changed["x"] - shown["x"])[late])) for shown in (with_it, without))
    assert remainder < 0.02 * float(np.std(record["x"]))
    assert remainder < 0.1 * gap, f"{remainder:.3g} m of {gap:.3g} m remain"


def test_every_family_of_an_axis_is_offered(base: Base) -> None:
    found = {family_of(spot.effect.name) for spot in spots(base)}
    assert found >= {
        "memory",
        "spring_law",
        "damping_law",
        "play_and_stops",
        "delay_or_lag",
        "tone_or_ripple",
        "resonance",
    }
    assert "dry_friction" in found
    named = replace(base, without=None)
    assert "dry_friction" not in {family_of(spot.effect.name) for spot in spots(named)}, (
        "the campaign models it"
    )
    names = {spot.effect.name for spot in spots(base)}
    assert not names & {"actuator_lag", "input_saturation", "speed_limit", "sensor_delay", "inertia"}


def test_every_effect_of_the_catalogue_has_a_family() -> None:
    assert not [effect.name for effect in CATALOGUE if family_of(effect.name) == "own"]
    assert family_of("iwan_hysteresis@shaft") == "memory"


def test_a_change_of_the_input_makes_a_record_of_operation(base: Base) -> None:
    record = base.campaign.records[0]
    driven = spiked(base, _spot(base, "cubic_stiffness"), {"k_3": 1.5e3}, record)
    read = spiked(base, _spot(base, "sensor_lag"), {"T_m": 0.03}, record)
    assert (driven.kind, driven.amplitude) == ("operation", None)
    assert (read.kind, read.amplitude) == ("multisine", 12.0)
    assert np.array_equal(unspiked(record, read)["u"], read["u"])
    with pytest.raises(SimulationError, match="too long"):
        spiked(base, _spot(base, "input_delay"), {"T_d": 100.0}, record)


def test_a_trial_follows_from_its_key(folder: Path, trial: Trial) -> None:
    same = draw_trial("measured", 1, 0, folder)
    assert json.dumps(same.key) == json.dumps(trial.key)
    key = json.loads(json.dumps(trial.key))
    for drawn, found in zip(trial.records, again(folder, key), strict=True):
        for name in drawn.signals:
            assert np.allclose(drawn[name], found[name], rtol=1e-12, atol=0.0)
    with pytest.raises(InputError, match="not what it was"):
        again(folder, {**key, "source": "other"})


def test_a_key_tells_effect_place_family_and_strength(trial: Trial) -> None:
    key = trial.key
    assert key["design"] == "measured"
    assert key["family"] == family_of(key["effects"][0])
    assert 1.5 <= key["strength"] <= 12.0
    assert key["campaign"] == "axis/campaign.toml"
    assert key["base"]["modelled"] == ([] if key["base"]["own_of_same_family"] else ["coulomb_friction"])
    assert set(key["own_values"]) <= {p.name for p in effect_named(key["effects"][0]).parameters}


def test_a_campaign_of_a_trial_can_be_read(tmp_path: Path, trial: Trial, folder: Path) -> None:
    bench = BenchFolder(tmp_path / "bench")
    bench.settle("measured", 1, folder)
    bench.write_trial("000", trial)
    read = read_campaign(bench.campaign("000"))
    modelled = trial.key["base"]["modelled"]
    assert [effect.name for effect in read.modelled] == modelled
    assert read.given["m"] == pytest.approx(trial.key["base"]["values"]["m"], rel=1e-4)
    assert ("T_c" in read.given) == bool(modelled)
    assert [record.role for record in read.records] == ["estimation", "estimation", "validation"]
    text = "".join(path.read_text() for path in bench.campaign("000").glob("*.toml"))
    assert "axis/" not in text
    assert "day_" not in text
    with pytest.raises(InputError, match="already contains a blind bench"):
        bench.settle("measured", 1, tmp_path)


def test_cells_are_of_every_campaign_that_can_be_used(folder: Path, tmp_path: Path) -> None:
    assert (
        n_trials("measured", folder) == len(measured_spots(folder.resolve() / "axis" / "campaign.toml")) > 10
    )
    with pytest.raises(InputError, match="no campaign"):
        n_trials("measured", tmp_path)
    with pytest.raises(InputError, match="not a folder"):
        n_trials("measured", tmp_path / "gone")
    (tmp_path / "campaign.toml").write_text('[rig]\nmodel = "axis"\n')
    with pytest.raises(InputError, match=r"can be used.*records"):
        n_trials("measured", tmp_path)
    with pytest.raises(InputError, match="name the folder"):
        n_trials("measured")
    with pytest.raises(InputError, match="reads no folder"):
        n_trials("standard", folder)


def test_a_bench_is_drawn_diagnosed_and_scored(
    tmp_path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def diagnose(bench: BenchFolder, name: str, start: Sequence[str]) -> None:
        bench.result(name).mkdir(parents=True)
        (bench.result(name) / RUN_FILE).write_text(json.dumps({"seconds": 1.0, "message": "it failed"}))

    monkeypatch.setattr(benches, "diagnose_trial", diagnose)
    content = benches.run_blind(
        tmp_path, start=(), design="measured", measured=folder, seed=1, only=[0], n_jobs=1
    )
    (found,) = content["trials"]
    key = BenchFolder(tmp_path).read_key("000")
    assert (found["design"], found["verdict"]) == ("measured", "failed")
    assert found["families"] == (key["family"],)
    assert (found["family_right"], found["family_probability"]) == (False, 0.0)
    assert content["families"][key["family"]]["right"]["total"] == 1
    (wrong,) = content["wrong"]
    assert wrong["again"] == f"rigsight blind --design measured {folder} --seed 1 --trial 0 --out DIR"
    assert "Known causes in measured records" in blind_markdown(content)
    assert "Known causes in measured records" in render_blind(content)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--design", "measured"], ["Name their folder"]),
        (["somewhere"], ["reads no folder", "Leave out somewhere"]),
        (["somewhere", "--design", "laboratory"], ["Design laboratory reads no folder"]),
        (["somewhere", "--rescore"], ["--rescore reads no folder"]),
        (["gone", "--design", "measured"], ["not a folder"]),
    ],
)
def test_a_folder_belongs_to_its_design(
    run: Run, tmp_path: Path, options: list[str], words: list[str]
) -> None:
    code, out, err = run("blind", "--out", tmp_path / "out", *options)
    assert (code, out) == (2, "")
    for word in words:
        assert word in err
    assert not (tmp_path / "out").exists()


@pytest.mark.skipif(not SHARED.is_dir(), reason="the measured campaigns of other people are not here")
def test_measured_campaigns_of_other_people_can_be_used() -> None:
    files = campaign_files(SHARED)
    found = {file: measured_base(SHARED / file) for file in files}
    assert [str(file) for file, base in found.items() if isinstance(base, str)] == []
    pendulum = found[Path("qdd_pendulum/campaign.toml")]
    assert isinstance(pendulum, Base)
    # Signed by those who know the rig: dry friction at the bearing.
    assert [effect.name for effect in pendulum.modelled] == ["coulomb_friction@bearing"]
    assert len(measured_cells(SHARED)) > 50

"""Records of an axis that nothing drives, from files: every command takes them or says why not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rigsight.effects import effect_named
from rigsight.errors import InputError
from rigsight.records import ReadingOptions, read_record
from rigsight.rigs import ELEMENT
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.compare import run_compare
from rigsight.workflow.diagnose import run_diagnose
from rigsight.workflow.discover import run_discover
from rigsight.workflow.identify import run_identify
from rigsight.workflow.init import run_init
from rigsight.workflow.inspect import run_inspect
from rigsight.workflow.simulate import run_simulate

Force = Callable[[float, float], float]
DT, SECONDS, NOISE = 0.005, 3.0, 1e-5
M, D, K = 2.0, 2.4, 800.0
AMPLITUDES = {"high": 0.02, "low": 0.008, "check": 0.014}
HEAD = 'title = "left alone"\n[rig]\nmodel = "axis"\n'
RECORD = '\n[[records]]\nfile = "{name}.csv"\nrole = "{role}"\n{more}'


def decay(start: float, force: Force = lambda x, v: 0.0, dry: float = 0.0, damping: float = D) -> np.ndarray:
    """Return the displacement of a mass that is let go, by an integrator that stops wherever the motion turns."""
    t = DT * np.arange(round(SECONDS / DT))
    x, begin, place = np.full(t.size, np.nan), 0.0, start
    while begin < SECONDS:
        pull = -K * place - force(place, 0.0)
        if abs(pull) <= dry:
            x[t >= begin] = place
            return x
        side = np.sign(pull)

        def rates(_: float, z: np.ndarray, side: float = side) -> list[float]:
            return [z[1], (-damping * z[1] - K * z[0] - force(z[0], z[1]) - side * dry) / M]

        def turns(at: float, z: np.ndarray, begin: float = begin, side: float = side) -> float:
            return float(z[1]) if at > begin + 1e-7 else float(side)

        turns.terminal, turns.direction = True, -side  # type: ignore[attr-defined]
        found = solve_ivp(
            rates,
            (begin, SECONDS),
            [place, 0.0],
            method="DOP853",
            rtol=1e-9,
            atol=1e-12,
            events=turns,
            dense_output=True,
        )
        inside = (t >= begin) & (t <= found.t[-1])
        x[inside] = found.sol(t[inside])[0]
        begin, place = found.t[-1], found.y[0, -1]
    return x


def campaign(folder: Path, level: float | None = None, more: str = "", **missing: object) -> Path:
    """Write three decays; without a level of the input there is no column for it."""
    folder.mkdir(exist_ok=True)
    rng = np.random.default_rng(5)
    text = HEAD
    for name, start in AMPLITUDES.items():
        x = decay(start, **missing)  # type: ignore[arg-type]
        x += NOISE * rng.standard_normal(x.size)
        t = DT * np.arange(x.size)
        columns = [t, x] if level is None else [t, np.full_like(t, level), x]
        header = "t,x" if level is None else "t,u,x"
        np.savetxt(folder / f"{name}.csv", np.column_stack(columns), "%.9g", ",", header=header, comments="")
        text += RECORD.format(name=name, role="validation" if name == "check" else "estimation", more=more)
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    return folder


# Of all that the rig offers, what comes nearest to each of the three, and what has to be passed over where no input moves.
RIVALS = {
    "coulomb_friction": "load_dependent_friction stribeck_friction iwan_hysteresis bouc_wen_hysteresis presliding_friction",
    "cubic_stiffness": "power_law_stiffness asymmetric_stiffness torque_ripple encoder_eccentricity flexible_mode end_stop",
    "quadratic_damping": "bouc_wen_hysteresis presliding_friction position_dependent_damping flexible_mode sensor_lag",
}
OF_AN_INPUT = "input_delay actuator_lag input_saturation speed_limit input_dead_zone"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "level", "missing", "parameter", "value"),
    [
        ("coulomb_friction", None, {"dry": 0.35}, "T_c", 0.35 / M),
        ("cubic_stiffness", 0.5, {"force": lambda x, v: 6e5 * x**3}, "k_3", 6e5 / M),
        (
            "quadratic_damping",
            None,
            {"force": lambda x, v: 40.0 * abs(v) * v, "damping": 0.8},
            "c_2",
            40.0 / M,
        ),
    ],
)
def test_what_bends_a_decay_is_named(
    tmp_path: Path, effect: str, level: float | None, missing: dict[str, object], parameter: str, value: float
) -> None:
    tried = [effect_named(name) for name in (*RIVALS, *RIVALS[effect].split(), *OF_AN_INPUT.split())]
    found = run_diagnose(campaign(tmp_path / "c", level, **missing), effects=tried, n_jobs=1)
    assert (found.verdict, found.effects, found.where) == ("effect", (effect,), ("dynamics",))
    best = found.candidates[0].parameters
    assert best[parameter].value == pytest.approx(value, abs=4.0 * best[parameter].std, rel=1e-3)
    assert best["k"].value == pytest.approx(K / M, rel=1e-2)
    assert "m" not in best
    assert any("only up to a common factor. m = 1 kg is held" in note for note in found.notes)


@pytest.mark.slow
def test_friction_that_ends_a_decay_is_told_from_what_else_slows_it(tmp_path: Path) -> None:
    tried = [effect_named(name) for name in ("coulomb_friction", "quadratic_damping", "input_dead_zone")]
    found = run_diagnose(campaign(tmp_path / "c", dry=0.35), effects=tried, n_jobs=1)
    assert (found.verdict, found.effects, found.where) == ("effect", ("coulomb_friction",), ("dynamics",))
    best = found.candidates[0].parameters
    assert best["T_c"].value == pytest.approx(0.35 / M, abs=4.0 * best["T_c"].std, rel=1e-3)
    assert "m" not in best


@pytest.mark.slow
def test_ratios_are_identified_and_the_rest_is_said(tmp_path: Path) -> None:
    found = run_identify(campaign(tmp_path / "c"), tmp_path / "out")
    assert found.identifiability is not None
    assert (
        "m, d and k only up to a common factor: their ratios are determined" in found.identifiability.sentence
    )
    ratios = {c.text: c for c in found.identifiability.combinations}
    for text, truth in (("d/m", D / M), ("k/m", K / M)):
        assert ratios[text].value == pytest.approx(truth, abs=4.0 * ratios[text].std)
    assert found.joint.fit.fit.values["m"] == 1.0
    assert found.joint.fit.fit.standard_errors["k"] == np.inf
    assert [record.amplitude for record in found.records] == pytest.approx([0.019, 0.0077], rel=0.02)
    assert "m [kg]" not in found.amplitude_statement
    assert (tmp_path / "out" / "identification.html").is_file()


def test_a_given_mass_sets_the_measure(tmp_path: Path) -> None:
    folder = campaign(tmp_path / "c")
    text = (folder / "campaign.toml").read_text("utf-8")
    (folder / "campaign.toml").write_text(
        text.replace('"axis"\n', f'"axis"\n[rig.parameters]\nm = {M}\n'), "utf-8"
    )
    found = run_identify(folder).joint.fit.fit
    assert found.values["m"] == M
    assert found.values["k"] == pytest.approx(K, rel=1e-3)
    assert found.values["d"] == pytest.approx(D, rel=1e-2)


@pytest.mark.slow
def test_every_command_takes_a_decay(tmp_path: Path) -> None:
    folder = campaign(tmp_path / "c", 0.5)
    found = run_discover(folder, tmp_path / "discovered")
    assert not any(term.kept for term in found.terms)
    assert found.rig_parameters["k"].value == pytest.approx(K / M, rel=1e-3)
    assert any("common factor" in warning for warning in found.warnings)
    compared = run_compare(folder, [tmp_path / "discovered"], tmp_path / "compared")
    assert {score.column.quantity for score in compared.scores} == {"free_run_nrmse"}
    assert max(score.value for score in compared.scores) < 0.02
    ran = run_simulate(
        tmp_path / "discovered", folder / "high.csv", tmp_path / "high.csv", initial_state="estimated"
    )
    assert np.std(ran["x"] - decay(AMPLITUDES["high"])) < 2.0 * NOISE + 0.01 * AMPLITUDES["high"]


def test_a_file_without_an_input_is_proposed_as_a_free_motion(tmp_path: Path) -> None:
    folder = campaign(tmp_path / "c")
    assert "taken as 0 (no excitation)" in run_inspect(folder / "high.csv").proposal
    (folder / "campaign.toml").unlink()
    draft = run_init(folder)
    assert (draft.model, draft.n_blanks) == ("axis", 0)
    assert not any(record["u"].any() for record in read_campaign(folder).records)


def test_an_input_that_is_said_to_move_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"high\.csv, column 'u': no input changes \(u = 0\.5\).*operation"):
        read_campaign(campaign(tmp_path / "c", 0.5, 'kind = "sweep"\n'))


def test_a_motion_that_is_prescribed_must_move(tmp_path: Path) -> None:
    folder = campaign(tmp_path / "c", 0.5)
    (folder / "high.csv").write_text((folder / "high.csv").read_text().replace("t,u,x", "t,x,force"))
    with pytest.raises(InputError, match="no input changes"):
        read_record(
            folder / "high.csv",
            ELEMENT.inputs,
            ELEMENT.outputs,
            ReadingOptions(moving_inputs=ELEMENT.moving_inputs),
        )

"""The effect of parameters on the frequency response, as the thesis describes it in section 6.3."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from rigsight.cli import app
from rigsight.errors import InputError
from rigsight.rigs import RIGS
from rigsight.simulate import compose
from rigsight.simulate.model import Model
from rigsight.workflow.run.progress import Step
from rigsight.workflow.vary import run_vary, table_text


def test_delays_and_lags_of_a_linear_model_change_its_response_as_their_closed_form(
    write_model: Callable[..., Path],
) -> None:
    late = {"T_d": 0.5, "T_s": 0.3, "T_a": 0.05, "T_m": 0.02}

    def delayed(content: dict[str, Any]) -> None:
        effects = ["input_delay", "sensor_delay", "actuator_lag", "sensor_lag"]
        content.update(effects=effects, effect_parameters=late, units={}, hold="foh")
        content["parameters"] |= {"m": 2.0, "d": 40.0, "k": 800.0}

    for name in ("T_d", "T_s"):
        (variation,) = run_vary(write_model(delayed), [name], low=0.0, high=2.0, steps=3)
        for variant in variation.variants:
            assert variant.response is not None
            s, own = 1j * variant.response.omega, {**late, name: variant.value}
            lags = (own["T_a"] * s + 1.0) * (own["T_m"] * s + 1.0)
            expected = np.exp(-s * (own["T_d"] + own["T_s"])) / (2.0 * s**2 + 40.0 * s + 800.0) / lags
            np.testing.assert_allclose(variant.response.values, expected, rtol=1e-9)
            assert variant.error == 0.0
        first, *others = (variant.features for variant in variation.variants)
        assert all(features == pytest.approx(first) for features in others)


def test_a_resonance_stays_where_it_is_however_late_the_drive_acts(write_model: Callable[..., Path]) -> None:
    def delayed(content: dict[str, Any]) -> None:
        content.update(effects=["input_delay"], effect_parameters={"T_d": 0.5}, units={})
        content["parameters"] |= {"m": 2.0, "d": 40.0, "k": 800.0}

    (variation,) = run_vary(write_model(delayed), ["T_d"])
    for variant in variation.variants:
        assert variant.features["peak_magnitude"] == pytest.approx(1.0 / (40.0 * math.sqrt(300.0)), rel=1e-5)
        assert variant.features["peak_omega"] == pytest.approx(math.sqrt(200.0), rel=1e-4)
        assert variant.features["break_frequency"] == pytest.approx(20.0, rel=1e-3)


def test_a_delay_of_a_nonlinear_model_turns_its_response_and_the_error_is_given(
    write_model: Callable[..., Path],
) -> None:
    def stiffening(content: dict[str, Any]) -> None:
        effects, own = ["input_delay", "cubic_stiffness"], {"T_d": 0.5, "k_3": 1e6}
        content.update(effects=effects, effect_parameters=own, units={})
        content["parameters"] |= {"m": 2.0, "d": 40.0, "k": 800.0}

    (variation,) = run_vary(write_model(stiffening), ["T_d"], low=0.0, high=1.0, steps=2, amplitude=2.0)
    prompt, late = (variant.response for variant in variation.variants)
    assert prompt is not None
    assert late is not None
    np.testing.assert_allclose(late.values, prompt.values * np.exp(-1j * late.omega), rtol=1e-9)
    assert all(variant.error is not None and 0.0 < variant.error < 0.02 for variant in variation.variants)
    assert "error" in table_text(variation)


def test_a_larger_share_of_the_spring_without_memory_breaks_later_and_gives_less_static_gain() -> None:
    """Figure 6.5: "increasing a leads to a shift of the break frequency to a larger angular frequency ... and a smaller
    static gain"."""
    (variation,) = run_vary("hysteresis_r", ["a"], low=0.35, high=0.7, steps=3)
    features = [variant.features for variant in variation.variants]
    assert [variant.value for variant in variation.variants] == pytest.approx([0.35, 0.525, 0.7])
    breaks = [row["break_frequency"] for row in features]
    gains = [row["lowest_gain"] for row in features]
    assert breaks == sorted(breaks)
    assert gains == sorted(gains, reverse=True)


def test_a_smaller_beta_removes_the_peak_and_a_larger_one_raises_it() -> None:
    """Figure 6.4: decreasing beta leads to a later break frequency, a smaller static gain and no resonance peak."""
    (variation,) = run_vary("hysteresis_r", ["beta"], steps=3, band=(1.0, 75.0))
    low, base, high = (variant.features for variant in variation.variants)
    assert variation.variants[1].value == pytest.approx(7362.0)
    assert high["peak_magnitude"] > 1.2 * base["peak_magnitude"] > 12.0 * low["peak_magnitude"]
    assert high["break_frequency"] < base["break_frequency"] < 0.5 * low["break_frequency"]
    assert low["lowest_gain"] < 0.2 * base["lowest_gain"]


def test_a_linear_model_shows_its_closed_form(write_model: Callable[..., Path]) -> None:
    def linear(content: dict[str, Any]) -> None:
        content.update(effects=[], effect_parameters={}, units={})

    (variation,) = run_vary(write_model(linear), ["k"], low=200.0, high=800.0, steps=2, band=(2.0, 60.0))
    for variant in variation.variants:
        assert variant.features["break_frequency"] == pytest.approx(math.sqrt(variant.value / 2.0), rel=0.02)
        assert variant.features["lowest_gain"] == pytest.approx(1.0 / (variant.value - 8.0), rel=0.05)


@pytest.mark.parametrize(
    ("effect", "values"), [("coulomb_friction", {"T_c": 2.0}), ("input_dead_zone", {"u_0": 2.0})]
)
def test_a_sweep_that_does_not_move_the_rig_is_told(
    effect: str, values: dict[str, float], write_model: Callable[..., Path]
) -> None:
    def held(content: dict[str, Any]) -> None:
        content.update(effects=[effect], effect_parameters=values, units={})

    (variation,) = run_vary(write_model(held), ["d"], steps=2)
    assert [variant.features["lowest_gain"] for variant in variation.variants] == [0.0, 0.0]
    assert "does not move 'x'; give a larger amplitude" in table_text(variation)


def test_a_lag_without_a_time_constant_is_swept(write_model: Callable[..., Path]) -> None:
    def quick(content: dict[str, Any]) -> None:
        content.update(effects=["actuator_lag"], effect_parameters={"T_a": 0.0}, units={})

    (variation,) = run_vary(write_model(quick), ["T_a"], low=0.0, high=0.1, steps=2)
    prompt, slow = (variant.features for variant in variation.variants)
    assert prompt["peak_magnitude"] > 1.5 * slow["peak_magnitude"]


def larger_model(folder: Path, rig: str, values: dict[str, float]) -> Path:
    structure = compose(RIGS[rig])
    model = Model(structure, {name: values[name] for name in structure.names}, "foh")
    file = folder / "model.json"
    file.write_text(json.dumps(model.to_json()), encoding="utf-8")
    return file


def test_two_masses_answer_by_their_closed_form(tmp_path: Path) -> None:
    values = {
        "k_t": 0.05, "J_m": 1e-3, "J_l": 3e-3, "k_s": 2.0, "d_s": 0.02, "d_m": 4e-3, "d_l": 4e-3, "k_l": 1.0,
    }  # fmt: skip
    model = larger_model(tmp_path, "drive_train", values)
    (variation,) = run_vary(model, ["k_s"], steps=2, amplitude=0.1, response="load_angle")
    for variant in variation.variants:
        assert variant.response is not None
        own = {**values, "k_s": variant.value}
        s = 1j * variant.response.omega
        shaft = own["k_s"] + own["d_s"] * s
        motor = own["J_m"] * s**2 + own["d_m"] * s + shaft
        load = own["J_l"] * s**2 + own["d_l"] * s + shaft + own["k_l"]
        expected = own["k_t"] * shaft / (motor * load - shaft**2)
        clear = np.abs(expected) > 1e-3 * np.max(np.abs(expected))
        error = np.abs(variant.response.values - expected)[clear] / np.abs(expected[clear])
        # The weight over neighboring lines is 0.035 wide; it bends the flanks of a resonance.
        assert np.median(error) < 0.02
        assert variant.features["lowest_gain"] == pytest.approx(own["k_t"] / own["k_l"], rel=0.02)


@pytest.mark.slow
def test_a_road_is_swept_as_a_motion(tmp_path: Path) -> None:
    values = {"m_b": 300.0, "m_w": 40.0, "k_b": 2e4, "d_b": 1500.0, "k_t": 2e5, "d_t": 100.0}
    model = larger_model(tmp_path, "quarter_car", values)
    (variation,) = run_vary(model, ["d_b"], steps=2, amplitude=1e-3, band=(1.0, 30.0))
    for variant in variation.variants:
        assert variant.response is not None
        assert variant.response.unit == "m/m"
        s = 1j * variant.response.omega
        suspension, tire = variant.value * s + 2e4, 100.0 * s + 2e5
        body = suspension / (300.0 * s**2 + suspension)
        wheel = tire / (40.0 * s**2 + tire + suspension * (1.0 - body))
        expected = (body - 1.0) * wheel
        error = np.abs(variant.response.values - expected) / np.abs(expected)
        assert np.median(error) < 0.02


@pytest.mark.parametrize(
    ("options", "message"),
    [({"source": "v"}, "--input is 'v'"), ({"response": "load"}, "--output is 'load'.*load_angle")],
)
def test_a_signal_that_the_rig_has_not_is_told(options: dict[str, str], message: str, tmp_path: Path) -> None:
    values = {
        "k_t": 0.05,
        "J_m": 1e-3,
        "J_l": 3e-3,
        "k_s": 2.0,
        "d_s": 0.02,
        "d_m": 0.0,
        "d_l": 0.0,
        "k_l": 1.0,
    }
    with pytest.raises(InputError, match=message):
        run_vary(larger_model(tmp_path, "drive_train", values), ["k_s"], **options)


@pytest.mark.slow
def test_the_command_writes_pictures_and_numbers(tmp_path: Path) -> None:
    out = tmp_path / "out"
    command = [
        "vary",
        "hysteresis_r",
        "--parameter",
        "k_d",
        "--parameter",
        "n",
        "--steps",
        "2",
        "--out",
        str(out),
    ]
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 0, result.output
    assert {path.name for path in out.iterdir()} == {
        "vary.json", "vary_k_d.svg", "vary_k_d.png", "vary_n.svg", "vary_n.png"
    }  # fmt: skip
    assert (out / "vary_n.png").read_bytes().startswith(b"\x89PNG")
    assert "k_d = 4 N m s/rad" in (out / "vary_k_d.svg").read_text(encoding="utf-8")
    content = json.loads((out / "vary.json").read_text())
    damping, exponent = content["parameters"]
    assert (damping["unit"], damping["base"]) == ("N m s/rad", 2.0)
    assert [row["value"] for row in damping["values"]] == pytest.approx([1.0, 4.0])
    # Half the exponent is below its bound of 1.
    assert [row["value"] for row in exponent["values"]] == pytest.approx([1.0, 2.0])
    assert len(damping["values"][0]["magnitude"]) == len(content["omega"])
    assert "break [rad/s]" in result.output


def test_one_parameter_has_a_picture_of_the_plain_name_and_progress_and_the_same_again_is_the_same(
    tmp_path: Path,
) -> None:
    steps: list[Step] = []
    (variation,) = run_vary("identified", ["k_c"], tmp_path / "one", steps=2, listener=steps.append)
    files = {path.name: path.read_bytes() for path in (tmp_path / "one").iterdir()}
    assert files.keys() == {"vary.json", "vary.svg", "vary.png"}
    sweeping = [step for step in steps if step.stage == "Sweeping"]
    assert (sweeping[-1].done, sweeping[-1].total) == (2, 2)
    assert "k_c [N m/rad]" in table_text(variation)
    response = variation.variants[0].response
    assert response is not None
    assert f"gain at {response.omega[0]:.4g} rad/s [rad/A]" in table_text(variation)
    run_vary("identified", ["k_c"], tmp_path / "again", steps=2)
    assert {path.name: path.read_bytes() for path in (tmp_path / "again").iterdir()} == files


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"model": "hysteresis_q"}, "Did you mean 'hysteresis_"),
        ({"model": "nowhere/model.json"}, "does not exist"),
        ({"parameters": ["bta"]}, "Did you mean 'beta'"),
        ({"parameters": []}, "Name a parameter"),
        ({"parameters": ["beta", "a"], "low": 1.0}, "can be used with one parameter only"),
        ({"parameters": ["a"], "high": 1.5}, r"--to.*\[0, 1\]"),
        ({"low": 5.0, "high": 5.0}, "do not increase: --from 5, --to 5. Give --from and --to"),
        ({"low": 9e9}, r"do not increase: --from 9e\+09, --to 14724 \(the default\)"),
        ({"low": 5.0, "high": 4.0}, "do not increase: --from 5, --to 4"),
        ({"steps": 1}, "--steps"),
        ({"amplitude": 0.0}, "--amplitude"),
        ({"band": (5.0, 1.0)}, "0 < lowest < highest"),
        ({"model": "nominal", "parameters": ["psi_off"]}, "give --from and --to"),
    ],
)
def test_bad_input_is_explained(options: dict[str, Any], message: str, tmp_path: Path) -> None:
    given = {"model": "hysteresis_r", "parameters": ["beta"], **options}
    with pytest.raises(InputError, match=message):
        run_vary(**given, out=tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def test_models_that_cannot_be_swept_are_refused(tmp_path: Path, write_model: Callable[..., Path]) -> None:
    def element(content: dict[str, Any]) -> None:
        content.update(rig="element", constants={}, parameters={"d": 1.0, "k": 5.0, "force_off": 0.0})
        content.update(effects=[], effect_parameters={}, units={})

    def without_spring(content: dict[str, Any]) -> None:
        content["parameters"]["k"] = 0.0
        content.update(effects=[], effect_parameters={}, units={})

    with pytest.raises(InputError, match="prescribes the motion"):
        run_vary(write_model(element), ["k"])
    with pytest.raises(InputError, match="--lowest and --highest"):
        run_vary(write_model(without_spring), ["d"])
    result = CliRunner().invoke(app, ["vary", "identified", "--parameter", "k_c", "--lowest", "1"])
    assert result.exit_code == 2

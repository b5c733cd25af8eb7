"""Rigs that MuJoCo, an FMU or a function of Python moves: do they move as the same equations do that rigsight derives?"""

from __future__ import annotations

import importlib.util
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

from rigsight.effects import effect_named
from rigsight.errors import InputError
from rigsight.identify.rig_equations import equations_of
from rigsight.records import Record
from rigsight.rigs import read_rig_file
from rigsight.rigs.reading.rig_file import rig_of_tables, rig_of_text
from rigsight.simulate import compose, parameter_vector, record_input, simulate, simulate_sets
from rigsight.simulate.side_by_side import simulate_tangents
from rigsight.simulators import give_function

from ..tiers import slow_but

_SPEC = importlib.util.spec_from_file_location("cart_pendulum", Path(__file__).parent / "cart_pendulum.py")
cart = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(cart)

DT, N = 0.005, 400
VALUES = {"m_p": 0.23, "k_u": 2.1, "d_c": 1.4, "k_c": 26.0, "d_p": 0.005}
KINDS = {"fmu": "ModelExchange", "steps": "CoSimulation"}
WAYS = ("mujoco", "fmu 2.0", "fmu 3.0", "steps 2.0", "steps 3.0", "python")


def record(n: int = N) -> Record:
    t = DT * np.arange(n)
    return Record("sweep", DT, {"u": 3.0 * np.sin(2 * np.pi * (0.5 + 0.5 * t) * t)}, {"u": "V"}, hold="foh")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("simulators")


def rig_of(way: str, folder: Path):
    file = folder / f"{way.replace(' ', '_')}.toml"
    kind, _, version = way.partition(" ")
    if kind == "native":
        text = cart.NATIVE
    elif kind == "mujoco":
        (folder / "cart.xml").write_text(cart.MJCF)
        text = cart.MUJOCO.replace("FILE", "cart.xml")
    elif kind in KINDS:
        path = folder / f"cart_{kind}_{version}.fmu"
        text = cart.FMU.replace("FILE", cart.written_fmu(path, version, KINDS[kind]).name)
    else:
        give_function("cart", cart.accelerations)
        text = cart.PYTHON
    file.write_text(cart.RIG + text)
    return read_rig_file(file)


@pytest.mark.parametrize(
    ("way", "effects"),
    [
        *slow_but(("fmu 3.0", ()), ("steps 3.0", ()), ("python", ()), of=[(way, ()) for way in WAYS]),
        pytest.param("mujoco", ("coulomb_friction",), marks=pytest.mark.slow),
        pytest.param("fmu 2.0", ("coulomb_friction",), marks=pytest.mark.slow),
        pytest.param("steps 2.0", ("coulomb_friction",), marks=pytest.mark.slow),
        ("mujoco", ("backlash", "input_delay")),
    ],
)
def test_it_moves_as_the_same_equations(way, effects, folder):
    chosen = [effect_named(name) for name in effects]
    values = {**VALUES, "T_c": 0.8, "g": 0.01, "T_d": 0.02}
    run = record(150 if way == "python" else N)
    ours, theirs = (
        simulate(compose(rig, chosen), values, run, accuracy=1e-8)
        for rig in (rig_of("native", folder), rig_of(way, folder))
    )
    for name in ("cart", "angle"):
        assert np.ptp(ours[name]) > 0.01
        # In co-simulation, forces within the FMU are half a communication step early.
        rounding = 1e-5 if way.startswith("steps") else 1e-8
        np.testing.assert_allclose(theirs[name], ours[name], rtol=0.0, atol=rounding * np.ptp(ours[name]))


@pytest.mark.parametrize("way", ["mujoco", "fmu 3.0", "steps 2.0"])
def test_derivatives_by_parameters_and_states_are_those_of_the_same_equations(way, folder):
    run = record(60)
    found = []
    for rig in (rig_of("native", folder), rig_of(way, folder)):
        structure = compose(rig)
        p, held = parameter_vector(structure, VALUES), record_input(structure, run)
        n, width = len(structure.states), p.size
        dp, dx = (
            np.hstack([np.eye(width), np.zeros((width, n))]),
            np.hstack([np.zeros((n, width)), np.eye(n)]),
        )
        state = np.array([0.02, 0.3, 0.1, -0.5])
        found.append(simulate_tangents(structure, held, p, dp, state, dx, run.n_samples, 2))
    size = np.max(np.abs(found[0]), axis=0, keepdims=True)
    np.testing.assert_allclose(found[1], found[0], rtol=0.0, atol=2e-5 * float(np.max(size)))
    assert np.all(np.abs(found[1] - found[0]) <= 1e-4 * size + 1e-9)


@pytest.mark.parametrize("way", ["mujoco", "fmu 2.0", "steps 2.0"])
def test_parameter_sets_side_by_side_do_not_get_into_each_others_way(way, folder):
    structure = compose(rig_of(way, folder))
    run = record(50)
    held = record_input(structure, run)
    masses = np.linspace(0.1, 0.4, 5)
    p = np.array([parameter_vector(structure, {**VALUES, "m_p": mass}) for mass in masses]).T
    out = simulate_sets(structure, held, p, np.zeros((4, 5)), run.n_samples, 3)
    for i, mass in enumerate(masses):
        one = simulate(structure, {**VALUES, "m_p": mass}, run, np.zeros(4), accuracy=1e-9)
        np.testing.assert_allclose(out[:, 1, i], one["angle"], rtol=0.0, atol=1e-5 * np.ptp(one["angle"]))


@pytest.mark.slow
@pytest.mark.parametrize("way", ["fmu 2.0", "steps 2.0"])
def test_a_number_of_a_record_reaches_the_fmu(way, folder):
    rig_of(way, folder)
    text = (
        (folder / f"{way.replace(' ', '_')}.toml").read_text().replace("[parameters.m_p]", "[constants.m_p]")
    )
    structure, run = compose(rig_of_text(text, folder=folder)), record(100)
    values = {name: value for name, value in VALUES.items() if name != "m_p"}
    found = [
        simulate(structure, values, replace(run, constants={"m_p": mass}))["angle"] for mass in (0.2, 0.4)
    ]
    wanted = simulate(compose(rig_of("native", folder)), {**values, "m_p": 0.4}, run)["angle"]
    assert np.max(np.abs(found[0] - wanted)) > 0.01 * np.ptp(wanted)
    np.testing.assert_allclose(found[1], wanted, rtol=0.0, atol=1e-4 * np.ptp(wanted))


@pytest.mark.slow
def test_contacts_limits_and_tendons_stay_in_mujoco(folder):
    import mujoco

    xml = """
    <mujoco><compiler angle="radian"/><option timestep="0.0001" integrator="RK4"/>
      <worldbody>
        <body><joint name="a" type="slide" axis="1 0 0" range="-0.015 0.2" damping="2" armature="0.1"/>
          <geom type="sphere" size="0.02" mass="0.5" contype="0" conaffinity="0"/><site name="s"/></body>
        <body pos="0.3 0 0"><joint name="b" type="slide" axis="1 0 0" damping="1"/>
          <geom type="sphere" size="0.02" mass="0.2" contype="0" conaffinity="0"/><site name="t"/></body>
      </worldbody>
      <tendon><spatial name="cable" stiffness="40" damping="0.2" springlength="0.3">
        <site site="s"/><site site="t"/></spatial></tendon>
      <actuator><motor name="push" joint="a"/></actuator>
    </mujoco>"""
    path = folder / "limited.xml"
    path.write_text(xml)
    tables = {
        "name": "limited",
        "inputs": {"u": {"unit": "N"}},
        "parameters": {
            "d_a": {"unit": "N s/m", "default": 2.0},
            "d_b": {"unit": "N s/m", "default": 1.0},
            "k": {"unit": "N/m", "default": 40.0},
        },
        "coordinates": {"a": {"unit": "m"}, "b": {"unit": "m"}},
        "joints": {"a": {"motion": "a", "damping": "d_a"}, "b": {"motion": "b", "damping": "d_b"}},
        "drives": {"push": {"signal": "u", "force": "push", "along": "a"}},
        "sensors": {"at_a": {"reads": "a", "unit": "m"}, "at_b": {"reads": "b", "unit": "m"}},
        "simulator": {"kind": "mujoco", "file": str(path), "parameters": {"k": "tendon_stiffness cable"}},
    }
    structure = compose(rig_of_tables(tables, "limited"))
    n = 200
    u = 6.0 * np.sin(2 * np.pi * 0.8 * DT * np.arange(n))
    run = Record("r", DT, {"u": u}, {"u": "N"}, hold="zoh")
    for stiffness in (40.0, 80.0):
        ours = simulate(structure, {"d_a": 2.0, "d_b": 1.0, "k": stiffness}, run, np.zeros(4), accuracy=1e-7)
        model = mujoco.MjModel.from_xml_string(xml.replace('stiffness="40"', f'stiffness="{stiffness}"'))
        data, theirs = mujoco.MjData(model), np.empty((n, 2))
        for row, now in zip(theirs, u, strict=True):
            row[:] = data.qpos
            data.ctrl[0] = now
            mujoco.mj_step(model, data, round(DT / model.opt.timestep))
        assert np.min(theirs[:, 0]) < -0.015
        for i, name in enumerate(("at_a", "at_b")):
            np.testing.assert_allclose(ours[name], theirs[:, i], rtol=0.0, atol=2e-3 * np.ptp(theirs[:, i]))


def test_two_models_are_two_rigs_and_a_changed_file_is_told(folder):
    first = rig_of("mujoco", folder)
    (folder / "cart.xml").write_text(cart.MJCF.replace('mass="0.8"', 'mass="0.9"'))
    second = read_rig_file(folder / "mujoco.toml")
    assert first.mechanism.bodies.key != second.mechanism.bodies.key
    assert not first.mechanism.mass_matrix.atoms(sp.Function) & second.mechanism.mass_matrix.atoms(
        sp.Function
    )


@pytest.mark.parametrize(
    ("way", "old", "new", "message"),
    [
        ("mujoco", '"slide"', '"slid"', r"has no joint 'slid'. Did you mean 'slide'"),
        ("mujoco", "body_mass pendulum", "body_mass pendul", "is not a number of the model"),
        ("mujoco", "body_mass pendulum", "mass", "is not a number of the model"),
        ("mujoco", "body_mass pendulum", "body_ipos pendulum -1", "is not a number of the model"),
        (
            "mujoco",
            "body_mass pendulum",
            "dof_frictionloss slide",
            "is derived from other numbers of the model or does not affect",
        ),
        ("mujoco", "body_mass pendulum", "body_subtreemass cart", "is derived from other numbers"),
        ("mujoco", '"hinge"', '"slide"', "'slide' is used twice"),
        ("mujoco", 'file = "cart.xml"', 'file = "a\\u0000b"', "is not a file name"),
        ("mujoco", 'kind = "mujoco"', 'kind = "mujoko"', "is not a simulator. Did you mean 'mujoco'"),
        ("mujoco", "cart.xml", "card.xml", "card.xml cannot be read: No such file"),
        ("fmu 2.0", '"position"', '"place"', "has no state 'place'"),
        ("fmu 2.0", '"torque"', '"moment"', "has no input 'moment'"),
        ("fmu 2.0", '"pendulum.mass"', '"mass"', "has no parameter 'mass'"),
        ("fmu 2.0", 'phi = "torque"', "", r"needs a force for each coordinate in \[simulator.forces\]"),
        ("fmu 2.0", 'x = "speed"', "", r"needs each coordinate's rate in \[simulator.rates\]"),
        (
            "fmu 2.0",
            'kind = "fmu"',
            'kind = "fmu"\nwithout_armature = true',
            "it belongs to mujoco, but this is fmu",
        ),
        (
            "mujoco",
            'kind = "mujoco"',
            'kind = "mujoco"\nstep = 1e-3',
            "it belongs to fmu, but this is mujoco",
        ),
        ("steps 2.0", '"position"', '"place"', "has no state 'place'"),
        ("fmu 2.0", 'm_p = "pend', 'm_q = "pend', "'m_q' is neither a constant nor a parameter"),
        ("python", 'file = "cart"', 'file = "card"', "is a Python function, but rig files must not run code"),
    ],
)
def test_what_is_wrong_is_told_with_its_place(way, old, new, message, folder):
    rig_of(way, folder)
    text = (folder / f"{way.replace(' ', '_')}.toml").read_text()
    assert old in text
    with pytest.raises(InputError, match=message) as reported:
        rig_of_text(text.replace(old, new), "cart.toml", folder=folder)
    assert "cart.toml, line" in str(reported.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            ('x = "force"', 'phi = "torque"'),
            ('x = "torque"', 'phi = "force"'),
            "no mass matrix can be derived",
        ),
        (
            ('x = "speed"', 'phi = "turning"'),
            ('x = "turning"', 'phi = "speed"'),
            "must belong to their coordinates",
        ),
    ],
)
@pytest.mark.parametrize("way", ["fmu 2.0", "steps 2.0"])
def test_names_of_an_fmu_that_are_swapped_are_told(way, old, new, message, folder):
    rig_of(way, folder)
    text = (folder / f"{way.replace(' ', '_')}.toml").read_text()
    for before, after in zip(old, new, strict=True):
        text = text.replace(before, after)
    place = np.array([[0.02, 0.3, 0.1, -0.5, 0.2]]).T
    with pytest.raises(InputError, match=message):
        rig_of_text(text, folder=folder).mechanism.bodies.answers.at(place, is_force=True)


def test_an_fmu_that_switches_at_events_is_refused(folder):
    import zipfile

    path = cart.written_fmu(folder / "events.fmu")
    with zipfile.ZipFile(path) as fmu:
        content = {name: fmu.read(name) for name in fmu.namelist()}
    with zipfile.ZipFile(path, "w") as fmu:
        for name, text in content.items():
            fmu.writestr(name, text.replace(b'numberOfEventIndicators="0"', b'numberOfEventIndicators="2"'))
    with pytest.raises(InputError, match="has state events"):
        rig_of_text(cart.RIG + cart.FMU.replace("FILE", "events.fmu"), folder=folder)


def test_a_file_that_the_model_includes_counts(folder):
    (folder / "whole.xml").write_text('<mujoco><include file="part.xml"/></mujoco>')
    keys = []
    for length in (0.3, 0.6):
        (folder / "part.xml").write_text(cart.MJCF.replace(f"0 0 {-0.3}", f"0 0 {-length}"))
        text = cart.RIG.replace("cart_and_pendulum", f"cart_{int(10 * length)}")
        rig = rig_of_text(text + cart.MUJOCO.replace("FILE", "whole.xml"), folder=folder)
        keys.append(rig.mechanism.bodies.key)
    assert keys[0] != keys[1]


def test_a_function_that_is_given_anew_is_asked_anew(folder):
    structure = compose(rig_of("python", folder))
    run, start = record(20), np.array([0.02, 0.3, 0.1, -0.5])
    before = simulate(structure, VALUES, run, start)["angle"]
    give_function("cart", lambda q, v, f, p: 2.0 * cart.accelerations(q, v, f, p))
    again = simulate(structure, VALUES, run, start)["angle"]
    give_function("cart", cart.accelerations)
    same = simulate(structure, VALUES, run, start)["angle"]
    assert np.max(np.abs(again - before)) > 1e-3
    np.testing.assert_array_equal(same, before)


def test_ctrl_c_in_a_function_ends_the_command(folder):
    rig = rig_of("python", folder)

    def interrupted(*_):
        raise KeyboardInterrupt

    give_function("cart", interrupted)
    with pytest.raises(KeyboardInterrupt):
        simulate(compose(rig), VALUES, record(20), np.zeros(4))


def test_the_inertia_of_a_tendon_is_that_of_the_place(folder):
    import mujoco

    xml = cart.MJCF.replace(
        "</worldbody>",
        '<site name="a" pos="0.5 0 0.2"/></worldbody><tendon><spatial name="rope" armature="0.5">'
        '<site site="a"/><site site="b"/></spatial></tendon>',
    ).replace('<joint name="hinge"', '<site name="b" pos="0 0 -0.2"/><joint name="hinge"')
    (folder / "rope.xml").write_text(xml)
    rig = rig_of_text(cart.RIG + cart.MUJOCO.replace("FILE", "rope.xml"), folder=folder)
    model = mujoco.MjModel.from_xml_string(xml)
    data, wanted = mujoco.MjData(model), np.zeros((2, 2))
    answers = rig.mechanism.bodies.answers
    for q in ([0.1, 0.4], [-0.3, -1.0]):
        data.qpos[:] = q
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fullM(model, data, wanted)
        found = answers.at(np.array([[*q, 0.2]]).T, is_force=False)[:, 0]
        np.testing.assert_allclose(found, [wanted[0, 0], wanted[1, 0], wanted[1, 1]], rtol=1e-12)


def test_what_a_program_reports_while_it_runs_reaches_the_user(folder):
    run = record(20)
    with pytest.raises(InputError, match="failed with status 3 of FMI"):
        simulate(compose(rig_of("fmu 2.0", folder)), {**VALUES, "m_p": -1.0}, run, np.zeros(4))
    rig = rig_of("python", folder)
    give_function("cart", lambda *_: 1 / 0)
    with pytest.raises(InputError, match="ZeroDivisionError"):
        simulate(compose(rig), VALUES, run, np.zeros(4))


def test_reading_a_rig_file_runs_no_fmu(folder, monkeypatch):
    monkeypatch.setattr("rigsight.simulators.fmu_program.ctypes.CDLL", None)
    cart.written_fmu(folder / "looked_at.fmu")
    assert rig_of_text(cart.RIG + cart.FMU.replace("FILE", "looked_at.fmu"), folder=folder).name


def test_a_number_of_a_program_is_the_same_to_two_bits(folder) -> None:
    # To as many sympy evaluates where it asks for a sign.
    masses = equations_of(rig_of("python", folder)).mass_entries
    leaf = next(leaf for entry in masses for leaf in entry.atoms(sp.Function))
    at = {symbol: sp.Float(0.3 + 0.1 * i) for i, symbol in enumerate(sorted(leaf.free_symbols, key=str))}
    number = leaf.xreplace(at)
    assert float(number.evalf(2)) == pytest.approx(float(number.evalf(15)), rel=0.05)
    assert not (1 / number).is_zero

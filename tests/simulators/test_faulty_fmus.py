"""FMUs that crash, stop, lack a binary or cannot be started anew: one message, and nothing is written."""

from __future__ import annotations

import json
import platform
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.rigs.reading.rig_file import rig_of_text
from rigsight.simulate import compose
from rigsight.simulate.model import Model

from . import cart_pendulum as cart

DEEP = "if (y[0] > 1e-3)"
"""Only in the middle of a motion."""
NOT_ON_WINDOWS = pytest.mark.skipif(platform.system() == "Windows", reason="signals are those of POSIX")
PLACE = np.array([[0.02, 0.3, 0.1, -0.5, 0.2]]).T
"""Coordinates, rates and the mass of the pendulum."""


def rig_with(path: Path, more: str = ""):
    text = cart.FMU.replace("FILE", path.name).replace('kind = "fmu"', f'kind = "fmu"\n{more}')
    return rig_of_text(cart.RIG + text, folder=path.parent)


def forces(rig) -> np.ndarray:
    return rig.mechanism.bodies.answers.at(PLACE, is_force=True)[:, 0]


def rewritten(path: Path, edit: Callable[[str, bytes], tuple[str, bytes]]) -> Path:
    """Replace name and content of each member of an FMU."""
    with zipfile.ZipFile(path) as fmu:
        members = [edit(name, fmu.read(name)) for name in fmu.namelist()]
    with zipfile.ZipFile(path, "w") as fmu:
        for name, content in members:
            fmu.writestr(name, content)
    return path


def described(path: Path, old: str, new: str) -> Path:
    """Replace a text in the description of an FMU."""

    def edit(name: str, content: bytes) -> tuple[str, bytes]:
        assert name != "modelDescription.xml" or old.encode() in content
        return name, content.replace(old.encode(), new.encode()) if name.endswith(".xml") else content

    return rewritten(path, edit)


@pytest.mark.parametrize(
    ("kind", "fault", "message"),
    [
        pytest.param("CoSimulation", "*(volatile int *)0 = 1;", "crashed", marks=NOT_ON_WINDOWS),
        pytest.param("ModelExchange", "abort();", "crashed", marks=[NOT_ON_WINDOWS, pytest.mark.slow]),
        pytest.param("CoSimulation", "return 3;", "status 3 of FMI", marks=pytest.mark.slow),
    ],
)
def test_a_fault_in_the_middle_ends_the_command_and_writes_nothing(kind, fault, message, tmp_path, run):
    rig = rig_with(cart.written_fmu(tmp_path / "cart.fmu", kind=kind, fault=f"{DEEP} {fault}"))
    values = {"m_p": 0.2, "k_u": 2.0, "d_c": 1.5, "k_c": 25.0, "d_p": 0.004}
    (tmp_path / "model.json").write_text(
        json.dumps(Model(compose(rig), values, "foh").to_json()), encoding="utf-8"
    )
    t = 0.005 * np.arange(80)
    columns = np.column_stack([t, 3.0 * np.sin(8.0 * t)])
    np.savetxt(tmp_path / "record.csv", columns, delimiter=",", header="t,u", comments="")
    out = tmp_path / "simulated.csv"
    code, stdout, stderr = run(
        "simulate", tmp_path / "model.json", tmp_path / "record.csv", "--out", out, "--quiet"
    )
    assert (code, stdout) == (2, "")
    assert message in stderr
    assert "Traceback" not in stderr
    assert not out.exists()


@NOT_ON_WINDOWS
def test_a_crash_leaves_the_program_usable(tmp_path):
    broken = rig_with(cart.written_fmu(tmp_path / "broken.fmu", fault=f"{DEEP} abort();"))
    sound = rig_with(cart.written_fmu(tmp_path / "sound.fmu"))
    for _ in range(2):
        with pytest.raises(InputError, match="crashed"):
            forces(broken)
        assert np.all(np.isfinite(forces(sound)))


@pytest.mark.parametrize(
    ("place", "has"),
    [
        ("binaries/win32/cart.dll", "win32"),
        ("binaries/linux32/cart.so", "linux32"),
        ("sources/cart.c", "source code"),
    ],
)
def test_a_missing_binary_is_told_with_what_is_there(place, has, tmp_path):
    path = cart.written_fmu(tmp_path / "other.fmu", kind="CoSimulation")
    rewritten(path, lambda name, content: (place if name.startswith("binaries") else name, content))
    with pytest.raises(InputError, match=f"no binary for this machine.*it has: {has}"):
        rig_with(path)


@pytest.mark.skipif(platform.system() != "Linux", reason="the fifth byte of a library of Linux is its width")
def test_a_binary_of_32_bit_in_the_place_of_another_is_told(tmp_path):
    path = cart.written_fmu(tmp_path / "narrow.fmu")
    rewritten(path, lambda name, own: (name, own[:4] + b"\x01" + own[5:] if "binaries" in name else own))
    with pytest.raises(InputError, match="its binary cannot be loaded"):
        forces(rig_with(path))


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("dx[2] += sin(20.0 * c->time);", "depends on more than"),
        ("dx[2] += 100.0 * (c->lag - y[0]);", "depends on more than"),
    ],
)
def test_what_cannot_be_started_anew_is_refused(fault, message, tmp_path):
    path = cart.written_fmu(tmp_path / "remembers.fmu", kind="CoSimulation", fault=fault)
    with pytest.raises(InputError, match=message):
        forces(rig_with(path))


@pytest.mark.parametrize(
    ("initialized", "is_possible"),
    [("memset(c, 0, 32);", True), ("memset(c, 0, 32); ((own *)c)->fixed = 1;", False)],
)
def test_states_that_initial_equations_replace_are_set_after_the_start(initialized, is_possible, tmp_path):
    path = cart.written_fmu(tmp_path / "late.fmu", kind="CoSimulation", initialized=initialized)
    if not is_possible:
        with pytest.raises(InputError, match="cannot be set"):
            forces(rig_with(path))
        return
    exchanged = rig_with(cart.written_fmu(tmp_path / "cart.fmu"))
    np.testing.assert_allclose(forces(rig_with(path)), forces(exchanged), rtol=1e-4)


def test_the_length_of_a_step_is_given_where_an_fmu_takes_one_alone(tmp_path):
    path = cart.written_fmu(tmp_path / "even.fmu", kind="CoSimulation")
    described(path, ' canHandleVariableCommunicationStepSize="true"', "")
    with pytest.raises(InputError, match=r"set step in \[simulator\]"):
        rig_with(path)
    wanted = forces(rig_with(cart.written_fmu(tmp_path / "cart.fmu")))
    coarse, fine = (np.abs(forces(rig_with(path, f"step = {step}")) - wanted) for step in (1e-3, 5e-4))
    np.testing.assert_allclose(coarse / fine, 2.0, rtol=0.1)
    assert np.max(fine / np.abs(wanted)) < 0.05


def test_model_exchange_is_preferred(tmp_path):
    path = cart.written_fmu(tmp_path / "both.fmu")
    described(path, "<ModelVariables", '<CoSimulation modelIdentifier="cart"/><ModelVariables')
    assert rig_with(path).name
    with pytest.raises(InputError, match="is used for Model Exchange"):
        rig_with(path, "step = 1e-3")


def test_an_fmu_that_exists_once_is_refused(tmp_path):
    path = cart.written_fmu(tmp_path / "once.fmu", kind="CoSimulation")
    described(path, "<CoSimulation", '<CoSimulation canBeInstantiatedOnlyOncePerProcess="true"')
    with pytest.raises(InputError, match="only once at a time"):
        rig_with(path)

"""Compiled kernels are kept between processes, and never stale."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rigsight
from rigsight.effects import effect_named
from rigsight.errors import InputError
from rigsight.libraries import library_cache
from rigsight.libraries.library_cache import c_compilers, library
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate
from rigsight.simulate.compiled import kernel
from rigsight.simulate.compiled.kernel_source import kernel_source

MOTION = """
import hashlib
import os
import sys
import numpy as np
from rigsight.effects import effect_named
from rigsight.records.record import Record
from rigsight.rigs import RUNNING_GEAR
from rigsight.simulate import compose, simulate
from rigsight.libraries import library_cache
from rigsight.simulate.compiled import kernel
def motion():
    t = 5e-3 * np.arange(4000)
    record = Record(name="r", dt=5e-3, signals={"u": 0.5 * np.sin(t + 0.6 * t**2)}, units={})
    values = dict(
        v=1.0, r_0=0.1, b=0.3, k_tau=0.27, J_z=0.56, k_c=81.0, k_d=2.0, l_0=0.25, c_y=0.98, psi_off=1e-3, y_off=1e-3
    )
    structure = compose(RUNNING_GEAR, [effect_named("coulomb_friction")])
    before = kernel.compiled(structure)
    psi = simulate(structure, {**values, "T_c": 0.02}, record)["psi"]
    return f"{before} {hashlib.sha256(psi.tobytes()).hexdigest()}"
"""
ONCE = f"{MOTION}print(motion())"
WITH_EACH_CACHE = f"""{MOTION}
for folder in sys.argv[1:]:
    os.environ[library_cache.CACHE_VARIABLE] = folder
    kernel._kernels.clear()
    print(motion())
"""


def start(folder: Path, program: str = ONCE, *arguments: object) -> subprocess.Popen[str]:
    source = str(Path(rigsight.__file__).parents[1])
    environment = {**os.environ, "RIGSIGHT_CACHE_DIR": str(folder), "PYTHONPATH": source}
    return subprocess.Popen(
        [sys.executable, "-c", program, *map(str, arguments)],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def run(*arguments: Any) -> subprocess.CompletedProcess[str]:
    process = start(*arguments)
    stdout, stderr = process.communicate()
    return subprocess.CompletedProcess(process.args, process.returncode, stdout, stderr)


def motion_here() -> list[str]:
    """Return what this process says, which is another than those that are started."""
    names: dict[str, Any] = {}
    exec(MOTION, names)
    said: list[str] = names["motion"]().split()
    return said


@pytest.fixture
def fresh_cache(tmp_path, monkeypatch):
    """Point at an empty folder and forget what is loaded in this process."""
    monkeypatch.setenv(library_cache.CACHE_VARIABLE, str(tmp_path / "kernels"))
    monkeypatch.setattr(kernel, "_kernels", {})
    return tmp_path / "kernels"


@pytest.mark.slow
def test_second_process_does_not_compile_and_gives_the_same_bits_and_damaged_code_is_replaced(
    fresh_cache, tmp_path
):
    first = run(fresh_cache)
    assert first.returncode == 0, first.stderr
    found, result = motion_here()
    assert first.stdout.split() == ["False", result]
    assert found == "True"
    (file,) = fresh_cache.iterdir()
    whole = file.read_bytes()
    folders = []
    for damaged in (whole[: len(whole) // 2], b"", whole.replace(b"simulate_one", b"simulate_two")):
        folders.append(tmp_path / f"damaged_{len(folders)}")
        folders[-1].mkdir()
        (folders[-1] / file.name).write_bytes(damaged)
    # A part of a library would end the process that loads it.
    again = run(fresh_cache, WITH_EACH_CACHE, *folders)
    assert again.returncode == 0, again.stderr
    assert again.stdout.splitlines() == 3 * [f"False {result}"]
    assert all(len((folder / file.name).read_bytes()) == len(whole) for folder in folders)


@pytest.mark.slow
def test_processes_that_compile_the_same_kernel_at_once_do_not_harm_each_other(fresh_cache):
    processes = [start(fresh_cache) for _ in range(2)]
    said = [process.communicate() for process in processes]
    assert [process.returncode for process in processes] == [0, 0], said
    (result,) = {stdout.split()[1] for stdout, _ in said}
    (file,) = fresh_cache.iterdir()
    assert motion_here() == ["True", result], file


def test_other_equations_are_another_file(fresh_cache):
    delay = effect_named("input_delay")
    halved = replace(delay, delay=delay.delay / 2)
    texts = {kernel_source(compose(AXIS, effects)) for effects in ((), (delay,), (halved,))}
    assert len(texts) == 3
    files = {kernel.kernel_of(compose(AXIS, effects)).path for effects in ((), (delay,), (halved,))}
    assert len(files) == 3


def test_other_kernels_do_not_wait_for_one_that_is_compiled_and_the_same_one_is_compiled_once(
    fresh_cache, monkeypatch
):
    together, started = threading.Barrier(2, timeout=60.0), []
    library = library_cache.first_library

    def first_library(sources, options):
        # Passed only if a second compiler is started before the first one is done.
        together.wait()
        started.append(sources)
        return library(sources, options)

    monkeypatch.setattr(library_cache, "first_library", first_library)
    delay = effect_named("input_delay")
    structures = [compose(AXIS), replace(compose(AXIS)), compose(AXIS, [delay]), compose(AXIS, [delay])]
    with ThreadPoolExecutor(len(structures)) as threads:
        kernels = list(threads.map(kernel.kernel_of, structures))
    assert len(started) == 2
    assert kernels[0] is kernels[1]
    assert kernels[2] is kernels[3]
    assert kernels[0] is not kernels[2]


def test_the_code_of_another_processor_is_not_run(fresh_cache, monkeypatch):
    structure = compose(AXIS)
    own = kernel.kernel_of(structure).path
    kernel._kernels.clear()
    monkeypatch.setattr(library_cache, "processor", lambda: "another")
    assert not kernel.compiled(compose(AXIS))
    assert kernel.kernel_of(structure).path != own


@pytest.mark.slow
def test_source_does_not_depend_on_the_order_of_hashes():
    program = """
import hashlib
from rigsight.effects import CATALOGUE
from rigsight.rigs import RUNNING_GEAR
from rigsight.simulate import compose
from rigsight.simulate.compiled.kernel_source import kernel_source
gear = compose(RUNNING_GEAR, [effect for effect in CATALOGUE if RUNNING_GEAR.offers(effect)])
order = hash("order")
source = hashlib.sha256(kernel_source(gear).encode()).hexdigest()
"""
    here: dict[str, Any] = {}
    exec(program, here)
    # The order of this process is drawn, or it was chosen for it: one of two others is another.
    seed = next(str(number) for number in (1, 2) if os.environ.get("PYTHONHASHSEED", "random") != str(number))
    other = subprocess.run(
        [sys.executable, "-c", f"{program}print(order, source)"],
        env={**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": str(Path(rigsight.__file__).parents[1])},
        capture_output=True, text=True, check=True,
    ).stdout.split()  # fmt: skip
    assert other[0] != str(here["order"])
    assert other[1] == here["source"]


def test_cache_that_cannot_be_written_is_explained(tmp_path, monkeypatch):
    blocked = tmp_path / "file"
    blocked.write_text("not a folder", "utf-8")
    monkeypatch.setenv(library_cache.CACHE_VARIABLE, str(blocked / "kernels"))
    monkeypatch.setattr(kernel, "_kernels", {})
    with pytest.raises(InputError, match=library_cache.CACHE_VARIABLE):
        kernel.kernel_of(compose(AXIS))


def test_a_full_disk_leaves_no_part_of_a_kernel(fresh_cache, monkeypatch):
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(InputError, match=r"No space left.*RIGSIGHT_CACHE_DIR"):
        kernel.kernel_of(compose(AXIS, [effect_named("cubic_stiffness")]))
    assert [path for path in fresh_cache.rglob("*") if path.is_file()] == []


def test_kernels_of_somebody_else_that_may_only_be_read_are_used_and_others_told(fresh_cache, monkeypatch):
    def unwritable(*_: object, **__: object) -> None:
        raise OSError(errno.EROFS, "Read-only file system")

    structure = compose(AXIS, [effect_named("cubic_stiffness")])
    kernel.kernel_of(structure)
    kernel._kernels.clear()
    monkeypatch.setattr("rigsight.libraries.library_cache.tempfile.mkstemp", unwritable)
    kernel.kernel_of(structure)
    with pytest.raises(InputError, match=r"Read-only.*Set RIGSIGHT_CACHE_DIR"):
        kernel.kernel_of(compose(AXIS, [effect_named("end_stop")]))


def test_a_user_without_a_home_is_told_what_to_set(monkeypatch):
    def homeless() -> Path:
        raise RuntimeError("Could not determine home directory.")

    for name in ("RIGSIGHT_CACHE_DIR", "XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(Path, "home", homeless)
    with pytest.raises(InputError, match="Set RIGSIGHT_CACHE_DIR"):
        library_cache.cache_folder()


def test_simulation_is_the_same_from_any_cache(fresh_cache, axis_values, make_record):
    record = make_record(np.sin(0.1 * np.arange(100)))
    first = simulate(compose(AXIS), axis_values, record)["x"]
    kernel._kernels.clear()
    np.testing.assert_array_equal(simulate(compose(AXIS), axis_values, record)["x"], first)


@pytest.mark.parametrize("names", [(), ("coulomb_friction",), ("input_delay", "backlash")])
def test_a_kernel_calls_nothing_that_it_does_not_declare(names):
    """Newer compilers refuse it, older ones take a call that is never made for granted."""
    text = kernel_source(compose(AXIS, [effect_named(name) for name in names]))
    options = [option for option in library_cache.OPTIONS if option != "-w"]
    assert library(c_compilers()[0], {"kernel.c": text}, [*options, "-Werror=implicit-function-declaration"])

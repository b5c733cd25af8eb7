"""Names are free: what the text of a target uses itself can be the name of every input, parameter, state and sensor."""

from __future__ import annotations

import ast
import io
import re
import subprocess
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

import control
import numpy as np
import pytest
from numpy.typing import NDArray

from rigsight.effects import effect_named, placed
from rigsight.export import TARGETS
from rigsight.export.python_function import WORDS
from rigsight.export.targets import export_model
from rigsight.libraries.library_cache import c_compilers
from rigsight.records import Record
from rigsight.rigs import Rig, read_rig_file
from rigsight.rigs.reading.expressions import FUNCTIONS
from rigsight.simulate import compose, simulate
from rigsight.simulate.model import Model

from ..tiers import slow_but

DT, N_SAMPLES, STEP = 0.02, 11, 0.002
WRITTEN_FROM = (
    "offsets", "element", "a saturated control law", "friction at a motor", "two masses with delays", "linear running gear",
)  # fmt: skip
"""Models whose texts together hold nearly all of the templates."""
LEFT_OUT = re.compile(r"part\d+|part_.*|__\w+__|_|t|None")
"""What every text has as many of as it needs, and what cannot be a name in the engine, either."""
WORD = r"(?<![\w.])[A-Za-z]\w*"
ROLES = 4
ALSO = (
    "r0", "r1", "s0", "s5", "slope_0", "slope_1", "constant_0", "part0", "M_PI", "M_E", "RIG_HISTORY", "entry", "Real",
)  # fmt: skip

CONSTANTS = (
    ("mass", "kg", 1.0), ("damping", "N s/m", 1.5), ("rate", "1/s", 1.5), ("length", "m", 0.1), ("flexibility", "m^2/N", 0.01),
)  # fmt: skip


@dataclass(frozen=True)
class Named:
    """A model of which every quantity has a given name, with its inputs and the engine's outputs."""

    model: Model
    inputs: tuple[str, ...]
    t: NDArray[np.float64]
    fed: tuple[NDArray[np.float64], ...]
    reported: Record
    reference: Record

    def worst(self, outputs: dict[str, NDArray[np.float64]], reported: bool = False) -> float:
        """Return the largest relative error of an output."""
        truth = self.reported if reported else self.reference
        assert len(outputs) == len(self.model.structure.rig.outputs)
        return max(
            float(np.linalg.norm(found - truth[signal.name]) / np.linalg.norm(truth[signal.name]))
            for found, signal in zip(outputs.values(), self.model.structure.rig.outputs, strict=True)
        )


def named(rig: Rig, effects: Sequence[str] = (), first: float = 0.0, **values: float) -> Named:
    """Return the model of a rig with a number for every parameter, no two of them the same."""
    made = [placed(effect_named(kind), place) for kind, _, place in (e.partition("@") for e in effects)]
    structure = compose(rig, made)
    numbers = {name: 1.0 + 0.03 * i for i, name in enumerate(structure.names)} | values
    model = Model(structure, {name: numbers[name] for name in structure.names}, "foh")
    t = DT * np.arange(N_SAMPLES)
    fed = {source.name: first + np.sin((2.0 + 0.1 * i) * t) for i, source in enumerate(rig.inputs)}
    record = Record("named", DT, fed, {source.name: source.unit for source in rig.inputs}, hold="foh")
    return Named(
        model, tuple(fed), t, tuple(fed.values()),
        reported=simulate(structure, model.values, record),
        reference=simulate(structure, model.values, record, accuracy=1e-9),
    )  # fmt: skip


def rig_of(folder: Path, text: str) -> Rig:
    file = folder / "rig.toml"
    file.write_text(text, encoding="utf-8")
    return read_rig_file(file)


def rig_with(inputs: list[str], parameters: list[str], states: list[str], sensors: list[str]) -> str:
    """Return a rig file in which every parameter, input and state is felt, with another weight, by the motion."""
    upper, lower, *others = states
    weighted = " + ".join(f"{name}*{1 + i}/10" for i, name in enumerate(parameters))
    lines = [
        'name = "named"', 'summary = "Names of the templates."',
        *(f'[constants.rig_{name}]\nunit = "{unit}"\ndefault = {value}' for name, unit, value in CONSTANTS),
        f"[coordinates.{upper}]", 'unit = "m"', f"[coordinates.{lower}]", 'unit = "m"',
        "[energy]", f'kinetic = "rig_mass*(d({upper})^2 + d({lower})^2)/2"',
        f'potential = "-{parameters[0]}*rig_length*({upper} + {lower})"',
        "[joints.rig_upper]", f'motion = "{upper}"',
        f'stiffness = "20*sqrt({parameters[1]}*{parameters[-1]}) + {weighted}"', 'damping = "rig_damping"',
        "[joints.rig_lower]", f'motion = "{lower} - {upper}"', f'stiffness = "30*{parameters[1]}"', 'damping = "rig_damping"',
        "[initial]", f'{others[0]} = "({weighted})*rig_flexibility"',
    ]  # fmt: skip
    for name in parameters:
        lines += [f"[parameters.{name}]", 'unit = "N/m"', "lower = 0.01"]
    for i, name in enumerate(inputs):
        lines += [f"[inputs.{name}]", 'unit = "N"']
        lines += [f"[drives.rig_drive_{i}]", f'signal = "{name}"', f'force = "rig_drive_{i}*{1 + i}/5"']
        lines += [f'along = "{lower if i % 2 else upper}"']
    for i, name in enumerate(others):
        lines += [f"[states.{name}]", 'unit = "m"', f'rate = "rig_rate*({upper} - {name}*{2 + i}/4)"']
    for i, name in enumerate(sensors):
        seen = others[i % len(others)]
        lines += [f"[sensors.{name}]", f'reads = "{upper} + {1 + i}*{lower}/10 - {seen}"', 'unit = "m"']
    return "\n".join(lines) + "\n"


def own_words(python: str) -> set[str]:
    """Return the names in a Python text."""
    nodes = list(ast.walk(ast.parse(python)))
    return {str(getattr(node, key)) for node in nodes for key in ("id", "arg", "name") if hasattr(node, key)}


def arguments_of(function: str) -> list[str]:
    """Return the names between the first parentheses."""
    return re.findall(r"\w+", function.partition("(")[2].partition(")")[0])


def main_and_pieces(matlab: str) -> tuple[str, str]:
    """Return the functions of a MATLAB text in which inputs stand as arguments, without comments and strings."""
    code = re.sub(r"'[^'\n]*'(?=[,)])|%.*", "", matlab)
    functions = re.findall(r"^function .*?(?=^function |\Z)", code, re.MULTILINE | re.DOTALL)
    return functions[0], next(f for f in functions if f.startswith("function c = input_pieces"))


@pytest.fixture(scope="module")
def words(case_named, refused) -> list[str]:
    """What the texts of the targets use themselves, and what they have as many of as they need."""
    found, of_models = set(ALSO), set[str]()
    for case in map(case_named, WRITTEN_FROM):
        of_models |= {name for name in case.model.values if "_" in name}
        for target in ("python", "control", "matlab"):
            if refused(case, target):
                continue
            text = str(
                export_model(case.model, target, source="model.json", name="rig", step=step_of(target))
            )
            found |= (
                own_words(text)
                if target != "matlab"
                else set(re.findall(WORD, "".join(main_and_pieces(text))))
            )
    return sorted(
        word for word in found - of_models if not LEFT_OUT.fullmatch(word) and word not in FUNCTIONS
    )


@pytest.fixture(scope="module", params=slow_but(0, of=range(ROLES)))
def all_named(request: pytest.FixtureRequest, words: list[str], tmp_path_factory) -> Named:
    """Four rigs, so that every word is once an input, once a parameter, once a state and once a sensor."""
    by_role = [words[(request.param + i) % ROLES :: ROLES] for i in range(ROLES)]
    return named(rig_of(tmp_path_factory.mktemp("rig"), rig_with(*by_role)))


def step_of(target: str) -> float | None:
    """Return a step where one can be given: to find one from the model takes longer than all the rest."""
    return STEP if TARGETS[target].fixed_step else None


def python_outputs(case: Named) -> dict[str, NDArray[np.float64]]:
    space: dict = {}
    exec(
        compile(str(export_model(case.model, "python", source="rig", step=STEP)), "exported.py", "exec"),
        space,
    )
    return space["simulate"](case.t, *case.fed)


def c_outputs(case: Named, folder: Path) -> dict[str, NDArray[np.float64]]:
    text = str(export_model(case.model, "c", source="rig", name="rig"))
    (folder / "rig.c").write_text(text, encoding="utf-8")
    # Without -std=c99 the headers define more.
    command = [*c_compilers()[0].command, "-O0", "-DRIG_MAIN", "-o", "program", "rig.c", "-lm"]
    run = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    rows = np.column_stack([case.t, *case.fed]).tolist()
    table = "".join(",".join(map(repr, row)) + "\n" for row in rows)
    run = subprocess.run([folder / "program"], input=table, capture_output=True, text=True, check=True)
    head, *body = run.stdout.splitlines()
    columns = np.array([[float(value) for value in line.split(",")] for line in body]).T
    return dict(zip(head.split(",")[1:], columns[1:], strict=True))


@pytest.mark.slow
def test_the_words_are_those_of_the_templates(words: list[str]):
    known = ("n", "dt", "c", "p", "i", "x", "y", "state", "first", "numbers", "given", "params", "result0")
    assert set(known) < set(words)
    assert len(words) > 150
    assert WORDS & set(words)


@pytest.mark.slow
def test_the_python_function_gives_the_outputs_of_the_engine(all_named: Named):
    assert all_named.worst(python_outputs(all_named)) <= 1e-6


@pytest.mark.slow
def test_the_control_system_gives_the_outputs_of_the_engine(all_named: Named):
    space: dict = {}
    exec(str(export_model(all_named.model, "control", source="rig")), space)
    response = control.input_output_response(
        space["system"], all_named.t, np.array(all_named.fed), space["REST"],
        solve_ivp_kwargs={"method": "DOP853", "rtol": 1e-9, "atol": 1e-12},
    )  # fmt: skip
    outputs = dict(zip(space["system"].output_labels, response.outputs, strict=True))
    assert all_named.worst(outputs) <= 1e-6


@pytest.mark.slow
def test_the_c_file_gives_the_outputs_of_the_engine(all_named: Named, tmp_path: Path):
    assert all_named.worst(c_outputs(all_named, tmp_path), reported=True) <= 1e-8


@pytest.mark.slow
def test_the_matlab_function_binds_no_name_twice(all_named: Named):
    text = str(export_model(all_named.model, "matlab", source="rig", name="rig", step=STEP))
    fields = re.findall(r"^p\.(\w+) = ", text, re.MULTILINE)
    assert len(fields) == len(set(fields)) > len(all_named.model.structure.parameters)
    main, pieces = main_and_pieces(text)
    for function in (main, pieces):
        assert len(set(arguments_of(function))) == len(arguments_of(function))
    inputs = arguments_of(main)[1:-2]
    assert len(inputs) == len(all_named.fed)
    assert arguments_of(pieces) == ["n", "dt", *inputs]
    before, given, after = re.split(r"input_pieces\((.*)\)", main.partition("\n")[2])
    assert re.findall(r"\w+", given) == ["n", "dt", *inputs]
    assert not set(inputs) & set(re.findall(r"\w+", before))
    for name in set(inputs) & set(re.findall(WORD, after)):
        # The inputs have been read by now, so that their names are free where a value comes first.
        first = next(line for line in after.splitlines() if name in re.findall(WORD, line))
        assert re.match(rf" *(for )?{name} = ", first)
        assert re.findall(WORD, first).count(name) == 1
    assert re.findall(r"_of\((\w+)", pieces) == inputs
    assert not set(inputs) & set(re.findall(r"\w+", re.sub(r"_of\(\w+", "_of(", pieces.partition("\n")[2])))


@pytest.mark.slow
def test_the_modelica_model_declares_every_name_once_and_none_that_it_calls(all_named: Named):
    text = str(export_model(all_named.model, "modelica", source="rig", name="Rig"))
    head, _, body = re.sub(r"\"[^\"]*\"|//.*", "", text).partition("\nequation\n")
    declared = re.findall(r"^  (?:parameter |input |output )?Real (\w+)", head, re.MULTILINE)
    assert len(declared) == len(set(declared))
    assert not set(declared) & {"Real", *re.findall(r"\b(\w+)\(", body)}
    assert set(re.findall(r"\b[A-Za-z]\w*", body)) <= {*declared, "der", "sqrt", "end", "Rig"}


ONE_MOTION = """
name = "named"
summary = "A load on a spring."
[inputs.motion]
unit = "N"
[parameters.first]
unit = "N/m"
[parameters.stiffness]
unit = "N/(m kg)"
[parameters.inertia]
unit = "kg"
[parameters.last]
unit = "m"
[parameters.damping]
unit = "N s/m"
[coordinates.state]
unit = "m"
[energy]
kinetic = "inertia*d(state)^2/2"
[joints.piece]
motion = "state"
stiffness = "first + stiffness*inertia"
damping = "damping"
rest = "last"
[drives.wait]
signal = "motion"
force = "wait"
along = "state"
[sensors.new]
reads = "state"
unit = "m"
"""
FRICTION = """
name = "named"
summary = "Two masses with a brake between them."
[inputs.n]
unit = "N"
[parameters.slopes]
unit = "1"
[parameters.result]
unit = "N^2/m^2"
[parameters.slip_rate]
unit = "kg"
[parameters.share]
unit = "N s/m"
[coordinates.slope_0]
unit = "m"
[coordinates.constant_0]
unit = "m"
[energy]
kinetic = "slip_rate*(d(slope_0)^2 + d(constant_0)^2)/2"
[joints.first]
motion = "slope_0"
stiffness = "20*sqrt(result)"
damping = "share"
[joints.second]
motion = "constant_0"
stiffness = "30*sqrt(result)"
damping = "share"
[joints.brake]
motion = "constant_0 - slopes*slope_0"
[drives.motor]
signal = "5*n"
force = "motor"
along = "slope_0"
[sensors.one]
reads = "slope_0"
unit = "m"
[sensors.other]
reads = "constant_0"
unit = "m"
"""


@pytest.fixture(
    params=[
        lambda folder: named(rig_of(folder, ONE_MOTION), first=0.4, last=0.02),
        lambda folder: named(rig_of(folder, FRICTION), ["coulomb_friction@brake"], T_c=1.5),
    ],
    ids=["equilibrium of one motion", "friction"],
)
def part_named(request: pytest.FixtureRequest, tmp_path: Path) -> Named:
    """What the four rigs do not have."""
    make: Callable[[Path], Named] = request.param
    return make(tmp_path)


@pytest.mark.slow
def test_an_equilibrium_and_friction_are_those_of_the_engine(part_named: Named, tmp_path: Path):
    assert part_named.worst(python_outputs(part_named)) <= 1e-6
    assert part_named.worst(c_outputs(part_named, tmp_path), reported=True) <= 1e-8


@pytest.mark.parametrize("target", ["fmu", "fmu3"])
def test_an_fmu_lists_every_name_once(target: str, part_named: Named):
    written = export_model(part_named.model, target, source="rig", name="rig", source_only=True)
    assert isinstance(written, bytes)
    description = zipfile.ZipFile(io.BytesIO(written)).read("modelDescription.xml")
    names = [variable.get("name") for variable in ET.fromstring(description).iterfind("ModelVariables/*")]
    assert len(names) == len(set(names)) > len(part_named.model.structure.parameters)


def test_a_prescribed_motion_may_be_called_as_what_reads_it(tmp_path: Path):
    text = """
name = "named"
summary = "A spring that is pulled."
[inputs.n]
unit = "m"
[parameters.k]
unit = "N/m"
[parameters.d]
unit = "N s/m"
[coordinates.z]
unit = "m"
prescribed_by = "n"
[joints.spring]
motion = "z"
stiffness = "k"
damping = "d"
[sensors.f]
reads = "force(spring)"
unit = "N"
"""
    model = Model(compose(rig_of(tmp_path, text)), {"k": 3.0, "d": 0.5}, "foh")
    space: dict = {}
    exec(str(export_model(model, "python", source="rig", step=STEP)), space)
    t = DT * np.arange(N_SAMPLES)
    force = space["simulate"](t, np.sin(t), np.cos(t))["f"]
    np.testing.assert_allclose(force, 3.0 * np.sin(t) + 0.5 * np.cos(t), rtol=1e-12)
    assert "function c = input_pieces(n, dt, n_, n_rate)" in str(export_model(model, "matlab", source="rig"))


def test_a_name_that_one_target_uses_is_kept_by_the_others(tmp_path: Path):
    model = named(rig_of(tmp_path, FRICTION), ["coulomb_friction@brake"], T_c=1.5).model
    assert "input n [N]" in str(export_model(model, "c", source="rig"))
    python = str(export_model(model, "python", source="rig", step=STEP))
    assert "input n_ [N]" in python
    for line in ('"slopes": 1.0,', 'slopes_ = numbers["slopes"]'):
        assert line in python

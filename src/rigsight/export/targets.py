"""Target languages of an export, and what each cannot represent."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import sympy as sp

from rigsight.effects import symbols
from rigsight.errors import InputError, check_in_range, check_option
from rigsight.export.c_source import c_source, macros
from rigsight.export.control_system import control_system
from rigsight.export.equations import SHARED, Exported, exported, harmless
from rigsight.export.fixed_step import LONGEST, internal_step
from rigsight.export.fmu import Version, fmu
from rigsight.export.latex import latex
from rigsight.export.matlab_function import INPUT_WORDS as MATLAB_INPUTS
from rigsight.export.matlab_function import WORDS as MATLAB
from rigsight.export.matlab_function import matlab_function
from rigsight.export.modelica import FUNCTIONS as MODELICA_FUNCTIONS
from rigsight.export.modelica import WORDS as MODELICA
from rigsight.export.modelica import modelica
from rigsight.export.python_function import INPUT_WORDS as PYTHON_INPUTS
from rigsight.export.python_function import WORDS as PYTHON
from rigsight.export.python_function import python_function
from rigsight.simulate import Model, Structure, compose
from rigsight.simulate.equations.kinks import freeze
from rigsight.simulate.equations.structure import input_symbols
from rigsight.simulate.input_hold import Hold

_FMUS: dict[str, Version] = {"fmu": 2, "fmu3": 3}
STICKING = "the sticking of dry friction"
DELAY = "a delay"
SENSOR_DELAY = "a late sensor"
STICKING_TOGETHER = "dry friction that sticks at several joints"
ACCELERATION = "the acceleration of a prescribed motion"
FELT_ACCELERATION = "forces that go with the acceleration of a prescribed motion"
"""Known once the next sample is: what runs along with its input has none at a sample."""
_SHORTEST = 1e-9


@dataclass(frozen=True)
class Target:
    """A language or format."""

    # What ``--to`` takes, how its files end, and one plain sentence.
    name: str
    suffix: str
    summary: str
    # Text or bytes for the model, the name of its source and its own name.
    write: Callable[[Exported, str, str], str | bytes]
    lacks: frozenset[str] = frozenset()  # what it is written without
    # Words of its language, which no name in any export is; those of C are in `rigsight.export.equations`.
    words: frozenset[str] = frozenset()
    # From its own name: words that its text uses itself, which no name in this export is.
    own_words: Callable[[str], frozenset[str]] = lambda _: frozenset()
    # Words that its text uses itself where inputs stand as arguments, which no input's name in this export
    # is.
    input_words: frozenset[str] = frozenset()
    # True if it goes from sample to sample itself, so that the hold of the input is its business.
    steps: bool = True
    fixed_step: bool = False  # True if it does so in steps of its own of a fixed length
    named: bool = True  # True if the text holds a name of its own, taken from the file's


TARGETS: dict[str, Target] = {
    target.name: target
    for target in (
        Target(
            "python", ".py", "a Python function; needs numpy", lambda e, s, _: python_function(e, s),
            lacks=frozenset({STICKING_TOGETHER, FELT_ACCELERATION}), words=PYTHON, input_words=PYTHON_INPUTS, fixed_step=True,
            named=False,
        ),
        Target(
            "control", ".py", "a python-control NonlinearIOSystem", control_system,
            lacks=frozenset({STICKING, DELAY, SENSOR_DELAY, ACCELERATION, FELT_ACCELERATION}), words=PYTHON, steps=False,
            named=False,
        ),
        Target(
            "c", ".c", "one C99 file without dependencies", c_source, lacks=frozenset({FELT_ACCELERATION}), own_words=macros,
        ),
        Target(
            "fmu", ".fmu", "an FMU: FMI 2.0, co-simulation", fmu, lacks=frozenset({FELT_ACCELERATION}), own_words=macros,
        ),
        Target(
            "fmu3", ".fmu", "an FMU: FMI 3.0, co-simulation", partial(fmu, version=3), lacks=frozenset({FELT_ACCELERATION}),
            own_words=macros,
        ),
        Target(
            "matlab", ".m", "a MATLAB function; Octave runs it too", matlab_function,
            lacks=frozenset({STICKING_TOGETHER, FELT_ACCELERATION}), words=MATLAB, input_words=MATLAB_INPUTS,
            fixed_step=True,
        ),
        Target("latex", ".tex", "equations and numbers for a document", lambda e, s, _: latex(e, s), steps=False, named=False),
        Target(
            "modelica", ".mo", "a Modelica model", modelica,
            lacks=frozenset({STICKING, ACCELERATION, FELT_ACCELERATION}), words=MODELICA,
            own_words=lambda _: MODELICA_FUNCTIONS, steps=False,
        ),
    )
}  # fmt: skip
"""In the order in which they are shown."""
RESERVED = SHARED.union(*(target.words for target in TARGETS.values()))
"""A name inside an export is none of these, so that it is the same in all of them; what the text of a single target uses itself
costs a name in that target alone."""


def export_model(
    model: Model,
    target: str,
    *,
    source: str,
    name: str = "model",
    hold: Hold | None = None,
    step: float | None = None,
    source_only: bool = False,
) -> str | bytes:
    """Return what a target writes for a model: text, or the bytes of an FMU, with a binary unless `source_only`."""
    # The source stands in the head of the text. Hold and longest internal step [s] are by default those of the model.
    chosen = TARGETS[check_option("Target", target, TARGETS)]
    bodies = model.structure.rig.mechanism.bodies
    if bodies is not None:
        back = " Effects and numbers go back with --to mjcf." if bodies.kind == "mujoco" else ""
        raise InputError(
            f"The bodies of '{model.structure.rig.name}' are moved by {bodies.kind} ({bodies.file}), and have no equations "
            f"to write as {target}.{back}"
        )
    if source_only and target not in _FMUS:
        raise InputError(f"--source-only is of an FMU; '{target}' is source anyway. Leave it out.")
    if chosen.named:
        _check_name(chosen, name)
    if step is not None:
        _check_step(chosen, step)
    reserved = RESERVED | chosen.own_words(name)
    content = exported(model, _hold(chosen, model, hold), step or LONGEST, reserved, chosen.input_words)
    _check_expressible(chosen, content)
    if step is None and chosen.fixed_step:
        content = replace(content, step=internal_step(model))
    if source_only:
        return fmu(content, harmless(source), name, version=_FMUS[target], source_only=True)
    return chosen.write(content, harmless(source), name)


def _check_nothing_is_early(content: Exported) -> None:
    structure = content.structure
    values = {**dict(structure.fixed), **dict(zip(structure.names, content.values, strict=True))}
    for effect in structure.effects:
        own = structure.values_of(effect, values)
        if effect.shifts_the_record and any(value < 0.0 for value in own.values()):
            ((name, early),) = own.items()
            raise InputError(
                f"'{effect.name}' shows a signal {-early:g} s before it happens, which nothing that runs along with its input "
                f"can. It is of the records and not of the rig: set {name} = 0 in the model."
            )


def unsaid(content: Exported) -> dict[str, str]:
    """Return what of a model not every target can say, with the effect, or the rig, that it comes from."""
    structure: Structure = content.structure
    found = {}
    if content.frictions:
        dry = _sticking(content)
        found[STICKING] = (dry or [structure.rig.name])[0]
        if len(content.frictions) > 1:
            found[STICKING_TOGETHER] = "' and '".join(dry) or structure.rig.name
    curvatures = {input_symbols(i)[2] for i in range(len(content.sources))}
    rates = (*content.frozen.rates, *content.frozen.steps.values())
    if any(rate.free_symbols & curvatures for rate in rates):
        found[ACCELERATION] = structure.rig.name
    if any(shown.free_symbols & curvatures for shown in structure.computed_outputs):
        feeling = [e.name for e in structure.effects if e.reads(symbols.acceleration) or e.shifts_the_record]
        found[FELT_ACCELERATION] = (feeling or [structure.rig.name])[0]
    for effect in structure.effects:
        if effect.delay is not None or effect.command_delay is not None:
            found[DELAY] = effect.name
        if effect.reading_delay is not None:
            found[SENSOR_DELAY] = effect.name
    return found


def _sticking(content: Exported) -> list[str]:
    """Return the effects that stick: a sign without a jump at v = 0 is damping."""
    structure = content.structure
    found = [e for e in structure.effects if e.torque is not None and e.torque.has(sp.sign)]
    if len(found) > len(content.frictions):
        found = [e for e in found if freeze(compose(structure.rig, [e])).frictions]
    return [e.name for e in found]


def _check_expressible(target: Target, content: Exported) -> None:
    _check_nothing_is_early(content)
    for what, effect in unsaid(content).items():
        if what in target.lacks:
            able = ", ".join(t.name for t in TARGETS.values() if what not in t.lacks)
            raise InputError(
                f"'{effect}' cannot be exported to {target.name}, which is written without {what}. Targets with it: {able}."
            )


def _hold(target: Target, model: Model, wished: Hold | None) -> Hold:
    hold = model.hold if wished is None else wished
    if wished is not None and not target.steps:
        able = ", ".join(t.name for t in TARGETS.values() if t.steps)
        raise InputError(
            f"--hold is of {able}; what is written for {target.name} leaves the input between samples to others. Leave it out."
        )
    if wished is not None:
        check_option("--hold", hold, ("foh", "zoh"))
    mechanism = model.structure.rig.mechanism
    if set(mechanism.inputs) <= mechanism.prescribing or not target.steps:
        return "foh"
    if hold == "band_limited":
        raise InputError(
            "The model's hold is 'band_limited': what a sampled analog signal does between two samples follows from samples on "
            f"both sides, and {target.name} goes from one sample to the next. Say how its input will behave: --hold foh (linear; "
            "sample faster for the same accuracy) or --hold zoh."
        )
    return hold


def _check_step(target: Target, step: float) -> None:
    if not target.fixed_step:
        able = ", ".join(t.name for t in TARGETS.values() if t.fixed_step)
        why = "finds its steps by itself, as simulations do" if target.steps else "leaves the steps to others"
        accuracy = " (compile it with -DNAME_ACCURACY=1e-8 for smaller errors)" if target.steps else ""
        raise InputError(
            f"--step is of {able}; what is written for {target.name} {why}{accuracy}. Leave it out."
        )
    check_in_range("--step", step, _SHORTEST, LONGEST, "s")


def _check_name(target: Target, name: str) -> None:
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,59}", name):
        why = f"cannot be the name of a {target.name} model, which is that of its file: letters, digits and underscores, "
        why += "a letter first, at most 60"
    elif name in target.words:
        why = f"is a word of the language and no name for a {target.name} model"
    else:
        return
    raise InputError(f"'{name}' {why}. Name another file with --out.")

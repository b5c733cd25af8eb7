"""Bodies of an FMU (FMI 2 and 3), which takes forces along coordinates and tells how its states change.

For Model Exchange it gives the rates of its states. For co-simulation it is started at a place and makes one short step.

FMI 2.0.5 (2024) and 3.0.2 (2024): modelica-association.org.
"""

from __future__ import annotations

import atexit
import ctypes
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rigsight.errors import InputError, nearest
from rigsight.libraries.templates import filled, template
from rigsight.simulators.bodies import Bodies, Program

if TYPE_CHECKING:
    from fmpy.model_description import ModelDescription

_BEGINNING = {
    "2": ("FreeInstance", "SetupExperiment", "EnterInitializationMode", "ExitInitializationMode", "SetReal"),
    "3": ("FreeInstance", "EnterInitializationMode", "ExitInitializationMode", "SetFloat64"),
}
_FUNCTIONS = {
    ("2", False): (
        "Instantiate", *_BEGINNING["2"],
        "NewDiscreteStates", "EnterContinuousTimeMode", "SetContinuousStates", "GetDerivatives",
    ),
    ("2", True): ("Instantiate", *_BEGINNING["2"], "Reset", "GetReal", "DoStep"),
    ("3", False): (
        "InstantiateModelExchange", *_BEGINNING["3"],
        "UpdateDiscreteStates", "EnterContinuousTimeMode", "SetContinuousStates", "GetContinuousStateDerivatives",
    ),
    ("3", True): ("InstantiateCoSimulation", *_BEGINNING["3"], "Reset", "GetFloat64", "DoStep"),
}  # fmt: skip
"""What the C text calls, in the order of its table; by version, and whether it is for co-simulation."""
_STEP = 1e-6
"""Communication step [s] of an FMU that takes any: its half is by how much forces within the FMU are early."""
_MOVING = 2e-3
"""Steps [s] in which the FMU is compared with one that is started anew at each step."""
_WHY = {
    -1: "no mass matrix can be derived from its accelerations: states in [simulator.rates] and inputs in [simulator.forces] must "
    "belong to their coordinates, and forces must enter linearly. An input that acts against its coordinate is written with a "
    "minus, x = '-force'. In co-simulation, its own step may be longer than the communication step: set step in [simulator]",
    -2: "a state in [simulator.rates] is not the rate of its coordinate",
    -3: "its coordinates and rates cannot be set: they are others after its start. Export it for Model Exchange, or with start "
    "values that can be set",
    -4: "its motion depends on more than the coordinates and rates that [simulator] names: on other states, or on the time. "
    "Such an FMU for co-simulation cannot be started at each place. Name all states, or export it for Model Exchange",
    -5: "it ended a communication step early",
    -6: "it crashed. Its own program is at fault, or it needs files that are not there",
}
"""Errors that the C text reports."""


class _Told(ctypes.Structure):
    """``fmu_told`` of the C text."""

    _fields_ = (
        ("name", ctypes.c_char_p), ("token", ctypes.c_char_p), ("resources", ctypes.c_char_p),
        ("places", ctypes.c_void_p), ("forces", ctypes.c_void_p), ("parameters", ctypes.c_void_p), ("signs", ctypes.c_void_p),
        ("step", ctypes.c_double), ("longer", ctypes.c_double), ("failed", ctypes.c_void_p),
    )  # fmt: skip


class FmuProgram(Program):
    """An open FMU; forces enter accelerations linearly, as those of mechanics without contacts do."""

    def __init__(self, bodies: Bodies) -> None:
        self._file = bodies.file
        try:
            from fmpy import extract, read_model_description
        except ImportError:
            raise InputError("Simulations by an FMU need FMPy: pip install 'rigsight[fmu]'.") from None
        try:
            description = read_model_description(bodies.file)
        except Exception as error:
            raise InputError(f"{bodies.file} is not an FMU that FMPy can read: {error}") from None
        own = description.modelExchange or description.coSimulation
        if own is None:
            raise InputError(f"{bodies.file} is an FMU for neither Model Exchange nor co-simulation.")
        self._steps = description.modelExchange is None
        if not self._steps and (
            description.numberOfEventIndicators or getattr(description, "eventIndicators", None)
        ):
            raise InputError(
                f"{bodies.file} has state events (stops, contacts, dry friction), which are not supported. Leave them out of the "
                f"FMU, and declare them at joints of the rig file."
            )
        if own.canBeInstantiatedOnlyOncePerProcess:
            raise InputError(
                f"{bodies.file} can be used only once at a time, but candidates are simulated side by side. Export it without "
                f"canBeInstantiatedOnlyOncePerProcess."
            )
        self._version = description.fmiVersion[0]
        self._variables = {variable.name: variable for variable in description.modelVariables}
        self._places = self._places_of(description, bodies)
        self._step, self._longer = _steps_of(description, bodies) if self._steps else (0.0, 0.0)
        if bodies.step and not self._steps:
            raise InputError(
                f"{bodies.file} is used for Model Exchange, which has no communication step. Remove step."
            )
        self._signs = [-1.0 if name.startswith("-") else 1.0 for name in bodies.forces]
        self._forces = [self._reference(name.removeprefix("-"), "input", "forces") for name in bodies.forces]
        self._parameters = [self._reference(name, "parameter", "parameters") for name in bodies.parameters]
        folder = extract(bodies.file)
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        self._binary = _binary(bodies.file, Path(folder), own.modelIdentifier)
        resources = Path(folder) / "resources"
        where = resources.as_uri() if self._version == "2" else f"{resources}/"
        self._failed = ctypes.c_int(0)
        token = description.guid or description.instantiationToken
        self._strings = [text.encode() for text in (own.modelIdentifier, token, where)]
        texts = ("fmu.c.txt", "fmu_steps.c.txt" if self._steps else "fmu_exchange.c.txt", "probed.c.txt")
        text, kind, probed = (template("simulators", name) for name in texts)
        counts = {"STATES": len(description.derivatives), "STEPS": int(self._steps)}
        self.c_text = filled(text, {"KIND": kind, "VERSION": self._version, **counts}) + probed
        self._kept: list[Any] = []
        self._compared = not self._steps

    def _places_of(self, description: ModelDescription, bodies: Bodies) -> list[int]:
        """Return where coordinates and rates are among the states, or in co-simulation their references."""
        derived = [unknown.variable.derivative for unknown in description.derivatives]
        states = [state.name for state in derived if state is not None]
        # FMUs for co-simulation need not say which variables are states; `connect` tries it out.
        known = states or (self._reals("output") + self._reals("local") if self._steps else [])
        names = (*bodies.coordinates, *bodies.rates)
        places = [self._state(name, known) for name in names]
        others = [state for state in states if state not in names]
        if others:
            raise InputError(
                f"{self._file} has states that are neither coordinates nor rates of the rig: {', '.join(others)}. "
                "Name them in [simulator.coordinates] and [simulator.rates], or leave them out of the FMU."
            )
        return [int(self._variables[name].valueReference) for name in names] if self._steps else places

    def _state(self, name: str, states: list[str]) -> int:
        if name not in states:
            wanted = f"has no state '{name}'" if name else "needs each coordinate's rate in [simulator.rates]"
            raise InputError(f"{self._file} {wanted}.{nearest(name, states)} States: {', '.join(states)}.")
        return states.index(name)

    def _reals(self, causality: str) -> list[str]:
        return [
            name
            for name, variable in self._variables.items()
            if variable.causality == causality
            and variable.type in ("Real", "Float64")
            and not getattr(variable, "dimensions", None)
        ]

    def _reference(self, name: str, causality: str, table: str) -> int:
        known = self._reals(causality)
        if name not in known:
            what = (
                f"has no {causality} '{name}'"
                if name
                else f"needs a force for each coordinate in [simulator.{table}]"
            )
            raise InputError(
                f"{self._file} {what}.{nearest(name, known)} It has: {', '.join(known) or 'none'}."
            )
        return int(self._variables[name].valueReference)

    def connect(self, library: ctypes.CDLL) -> None:
        """See `Program.connect`."""
        names = [f"fmi{self._version}{name}" for name in _FUNCTIONS[self._version, self._steps]]
        # The FMU is executed only in simulations; reading a rig file executes nothing.
        try:
            binary = ctypes.CDLL(str(self._binary))
        except OSError as error:
            raise InputError(f"{self._file}: its binary cannot be loaded: {error}") from None
        try:
            addresses = [ctypes.cast(getattr(binary, name), ctypes.c_void_p).value for name in names]
        except AttributeError as error:
            raise InputError(f"{self._file}: its binary lacks a function of FMI: {error}") from None
        table = (ctypes.c_void_p * len(addresses))(*addresses)
        places = (ctypes.c_uint * len(self._places))(*self._places)
        forces = (ctypes.c_uint * len(self._forces))(*self._forces)
        signs = (ctypes.c_double * len(self._signs))(*self._signs)
        parameters = (ctypes.c_uint * max(1, len(self._parameters)))(*self._parameters)
        reported = _Told(
            *self._strings,
            *(ctypes.addressof(array) for array in (places, forces, parameters, signs)),
            self._step,
            self._longer,
            ctypes.addressof(self._failed),
        )
        library.connect.restype = None
        library.connect(table, ctypes.byref(reported))
        # The library keeps the addresses.
        self._kept.append((binary, table, places, forces, signs, parameters, reported))
        if not self._compared:
            library.compare.restype = None
            library.compare()
            self.check()
            self._compared = True

    def check(self) -> None:
        """See `Program.check`."""
        if self._failed.value:
            status, self._failed.value = self._failed.value, 0
            why = _WHY.get(status, f"the FMU failed with status {status} of FMI")
            raise InputError(f"{self._file}: {why}.")


def _steps_of(description: ModelDescription, bodies: Bodies) -> tuple[float, float]:
    """Return the communication step, and a longer one in which a motion shows."""
    own, experiment = description.coSimulation, description.defaultExperiment
    if own.canHandleVariableCommunicationStepSize:
        step = bodies.step or float(own.fixedInternalStepSize or _STEP)
        return step, step * max(1, round(_MOVING / step))
    given = bodies.step or own.fixedInternalStepSize or (experiment is not None and experiment.stepSize)
    if not given:
        raise InputError(
            f"{bodies.file} takes communication steps of one length alone, and does not say of which: set step in [simulator]."
        )
    return float(given), float(given)


def _binary(file: str, folder: Path, identifier: str) -> Path:
    """Return the library of an extracted FMU for this machine."""
    from fmpy import platform, platform_tuple, sharedLibraryExtension, supported_platforms

    for own in (platform, platform_tuple):
        path = Path(folder, "binaries", own, f"{identifier}{sharedLibraryExtension}")
        if path.is_file():
            return path
    others = [own.replace("c-code", "source code") for own in supported_platforms(str(folder))]
    raise InputError(
        f"{file} contains no binary for this machine ({platform}); it has: {', '.join(others) or 'none'}. Export it for "
        f"{platform}."
    )

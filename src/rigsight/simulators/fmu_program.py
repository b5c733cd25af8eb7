"""Bodies of an FMU for Model Exchange (FMI 2 and 3): it gives rates of its states, and takes forces along coordinates.

FMI 2.0.5 (2024) and 3.0.2 (2024), Model Exchange: modelica-association.org.
"""

from __future__ import annotations

import atexit
import ctypes
import shutil
from pathlib import Path
from typing import Any

from rigsight.errors import InputError, nearest
from rigsight.libraries.templates import filled, template
from rigsight.simulators.bodies import Bodies, Program

_FUNCTIONS = {
    "2": (
        "Instantiate", "FreeInstance", "SetupExperiment", "EnterInitializationMode", "ExitInitializationMode",
        "NewDiscreteStates", "EnterContinuousTimeMode", "SetReal", "SetContinuousStates", "GetDerivatives",
    ),
    "3": (
        "InstantiateModelExchange", "FreeInstance", "EnterInitializationMode", "ExitInitializationMode",
        "UpdateDiscreteStates", "EnterContinuousTimeMode", "SetFloat64", "SetContinuousStates", "GetContinuousStateDerivatives",
    ),
}  # fmt: skip
"""What the C text calls, in the order of its table."""
_WHY = {
    -1: "no mass matrix can be derived from its accelerations: states in [simulator.rates] and inputs in [simulator.forces] must "
    "belong to their coordinates, and forces must enter linearly",
    -2: "a state in [simulator.rates] is not the rate of its coordinate",
}
"""Errors that the C text reports."""


class _Told(ctypes.Structure):
    """``fmu_told`` of the C text."""

    _fields_ = (
        ("name", ctypes.c_char_p), ("token", ctypes.c_char_p), ("resources", ctypes.c_char_p),
        ("places", ctypes.c_void_p), ("forces", ctypes.c_void_p), ("parameters", ctypes.c_void_p),
        ("failed", ctypes.c_void_p),
    )  # fmt: skip


class FmuProgram(Program):
    """An open FMU; forces enter accelerations linearly, as those of mechanics without contacts do."""

    def __init__(self, bodies: Bodies) -> None:
        self._file = bodies.file
        try:
            from fmpy import extract, platform, read_model_description, sharedLibraryExtension
        except ImportError:
            raise InputError("Simulations by an FMU need FMPy: pip install 'rigsight[fmu]'.") from None
        try:
            description = read_model_description(bodies.file)
        except Exception as error:
            raise InputError(f"{bodies.file} is not an FMU that FMPy can read: {error}") from None
        if description.modelExchange is None:
            raise InputError(
                f"{bodies.file} is an FMU for Co-Simulation only. Effects need its state derivatives: export it for Model "
                f"Exchange."
            )
        if description.numberOfEventIndicators or getattr(description, "eventIndicators", None):
            raise InputError(
                f"{bodies.file} has state events (stops, contacts, dry friction), which are not supported. Leave them out of the "
                f"FMU, and declare them at joints of the rig file."
            )
        self._version = description.fmiVersion[0]
        self._variables = {variable.name: variable for variable in description.modelVariables}
        states = [unknown.variable.derivative.name for unknown in description.derivatives]
        self._places = [self._state(name, states) for name in (*bodies.coordinates, *bodies.rates)]
        others = [state for index, state in enumerate(states) if index not in self._places]
        if others:
            raise InputError(
                f"{bodies.file} has states that are neither coordinates nor rates of the rig: {', '.join(others)}. "
                "Name them in [simulator.coordinates] and [simulator.rates], or leave them out of the FMU."
            )
        self._forces = [self._reference(name, "input", "[simulator.forces]") for name in bodies.forces]
        self._parameters = [
            self._reference(name, "parameter", "[simulator.parameters]") for name in bodies.parameters
        ]
        folder = extract(bodies.file)
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        identifier = description.modelExchange.modelIdentifier
        found = sorted(Path(folder).glob(f"binaries/*/{identifier}{sharedLibraryExtension}"))
        own = [path for path in found if path.parent.name in (platform, _platform_of_3())]
        if not own:
            raise InputError(f"{bodies.file} contains no binary for this machine ({platform}).")
        self._binary = own[0]
        resources = Path(folder) / "resources"
        where = resources.as_uri() if self._version == "2" else f"{resources}/"
        self._failed = ctypes.c_int(0)
        self._strings = [
            text.encode() for text in (identifier, description.guid or description.instantiationToken, where)
        ]
        text = template("simulators", "fmu.c.txt") + template("simulators", "probed.c.txt")
        self.c_text = filled(text, {"VERSION": self._version, "STATES": len(states)})
        self._kept: list[Any] = []

    def _state(self, name: str, states: list[str]) -> int:
        if name not in states:
            wanted = f"has no state '{name}'" if name else "needs each coordinate's rate in [simulator.rates]"
            raise InputError(f"{self._file} {wanted}.{nearest(name, states)} States: {', '.join(states)}.")
        return states.index(name)

    def _reference(self, name: str, causality: str, table: str) -> int:
        known = [
            own
            for own, variable in self._variables.items()
            if variable.causality == causality
            and variable.type in ("Real", "Float64")
            and not getattr(variable, "dimensions", None)
        ]
        if name not in known:
            what = f"has no {causality} '{name}'" if name else f"needs a force for each coordinate in {table}"
            raise InputError(
                f"{self._file} {what}.{nearest(name, known)} It has: {', '.join(known) or 'none'}."
            )
        return int(self._variables[name].valueReference)

    def connect(self, library: ctypes.CDLL) -> None:
        """See `Program.connect`."""
        names = [f"fmi{self._version}{name}" for name in _FUNCTIONS[self._version]]
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
        places = (ctypes.c_int * len(self._places))(*self._places)
        forces = (ctypes.c_uint * len(self._forces))(*self._forces)
        parameters = (ctypes.c_uint * max(1, len(self._parameters)))(*self._parameters)
        reported = _Told(
            *self._strings,
            *(ctypes.addressof(array) for array in (places, forces, parameters)),
            ctypes.addressof(self._failed),
        )
        library.connect.restype = None
        library.connect(table, ctypes.byref(reported))
        # The library keeps the addresses.
        self._kept.append((binary, table, places, forces, parameters, reported))

    def check(self) -> None:
        """See `Program.check`."""
        if self._failed.value:
            status, self._failed.value = self._failed.value, 0
            why = _WHY.get(status, f"the FMU failed with status {status} of FMI")
            raise InputError(f"{self._file}: {why}.")


def _platform_of_3() -> str:
    """Return the name of this platform in FMI 3: ``x86_64-linux``."""
    import platform

    machine = {"AMD64": "x86_64", "arm64": "aarch64"}.get(platform.machine(), platform.machine())
    system = {"Linux": "linux", "Darwin": "darwin", "Windows": "windows"}.get(platform.system(), "")
    return f"{machine}-{system}"

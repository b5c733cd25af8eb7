"""Bodies simulated by a Python function of accelerations; only the command line or code can name it, never a campaign alone."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np

from rigsight.errors import InputError
from rigsight.libraries.templates import template
from rigsight.simulators.bodies import Bodies, Program, forget

Accelerations = Callable[..., Any]
"""``accelerations(q, v, forces, parameters)``: coordinates, rates and forces along coordinates, shape (n,) each, and parameters
by name -> accelerations, shape (n,). Forces enter linearly."""

_given: dict[str, Accelerations] = {}
_open: dict[str, list[PythonProgram]] = {}
_DOUBLES = ctypes.POINTER(ctypes.c_double)
_CALL = ctypes.CFUNCTYPE(None, _DOUBLES, _DOUBLES, _DOUBLES, _DOUBLES, _DOUBLES)


def give_function(name: str, accelerations: Accelerations) -> None:
    """Register a function as the simulator of this name.

    Parameters
    ----------
    name
        Its name in rig files: ``file = "arm"`` beside ``kind = "python"``.
    accelerations
        See `Accelerations`.
    """
    _given[name] = accelerations
    for program in _open.get(name, ()):
        program.forget()
    forget()


class PythonProgram(Program):
    """A function of Python; forces enter linearly."""

    def __init__(self, bodies: Bodies) -> None:
        if bodies.file not in _given:
            raise InputError(
                f"the simulator '{bodies.file}' is a Python function, but rig files must not run code. Give it on the command "
                f"line, --simulator FILE.py:FUNCTION, or in Python with rigsight.simulators.give_function."
            )
        self._bodies = bodies
        self.c_text = template("simulators", "function.c.txt") + template("simulators", "probed.c.txt")
        self._error: BaseException | None = None
        self._call = _CALL(self._answer)
        self._failed = ctypes.c_int(0)
        self._libraries: list[ctypes.CDLL] = []
        _open.setdefault(bodies.file, []).append(self)

    def _answer(self, q: Any, v: Any, f: Any, p: Any, a: Any) -> None:
        bodies = self._bodies
        n = bodies.n
        numbers = dict(zip(bodies.parameters, p[: len(bodies.parameters)], strict=True))
        own = [np.frombuffer(ctypes.string_at(values, 8 * n)).copy() for values in (q, v, f)]
        try:
            found = np.asarray(_given[bodies.file](*own, numbers), dtype=np.float64)
            if found.shape != (n,):
                raise ValueError(f"it returned the shape {found.shape}, wanted is ({n},)")
        # What is raised here, Ctrl-C too, would vanish in C; `check` raises it.
        except BaseException as error:
            self._error = error
            found = np.full(n, np.nan)
        for i, acceleration in enumerate(found.tolist()):
            a[i] = acceleration

    def connect(self, library: ctypes.CDLL) -> None:
        """See `Program.connect`."""
        library.connect.restype = None
        library.connect(self._call, ctypes.byref(self._failed))
        self._libraries.append(library)

    def forget(self) -> None:
        """Let libraries forget what another function answered."""
        for library in self._libraries:
            library.bodies_forget()

    def check(self) -> None:
        """See `Program.check`."""
        (error, self._error), failed = (self._error, None), bool(self._failed.value)
        self._failed.value = 0
        if isinstance(error, Exception):
            raise InputError(
                f"The simulator '{self._bodies.file}' failed: {type(error).__name__}: {error}"
            ) from error
        if error is not None:
            raise error
        if failed:
            raise InputError(
                f"The simulator '{self._bodies.file}' returns accelerations from which no mass matrix can be derived: forces "
                f"must enter linearly, each along its own coordinate."
            )

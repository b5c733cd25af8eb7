"""Bodies that another program simulates: their names there, the interface to the program, and its results in equations.

``M(q, p) q'' = f + h(q, q', f, p)``: the program gives the mass matrix M and the force h of gravity, gyroscopic and all other
effects between and on the bodies; f are the forces of the rig's drives and joints. Numbers p are parameters of its own.
"""

from __future__ import annotations

import ctypes
import hashlib
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.libraries import library_file
from rigsight.libraries.templates import filled, template

Floats = NDArray[np.float64]

STEP = 1e-6
"""Step of a difference, relative to what is moved or in its SI unit: rounding and curvature both leave 1e-6 or less."""
KINDS = ("mujoco", "fmu", "python")
"""Supported programs."""

_MOST_REMEMBERED = 16
"""A place and the moved ones around it, of two rigs with few coordinates."""

_lock = threading.Lock()


class Program:
    """A program that is open: it gives C text, and is connected to libraries that contain it."""

    reads_forces = False
    """Whether h depends on f, as it does with contacts and other constraints; without them f enters linearly."""
    c_text = ""
    """C functions ``bodies_mass`` and ``bodies_force`` of the arguments of a leaf, and ``connect``."""
    include_folders: tuple[str, ...] = ()
    """Folders of the headers that `c_text` includes."""

    def connect(self, library: ctypes.CDLL) -> None:
        """Connect a library that contains `c_text` with the program."""

    def check(self) -> None:
        """Raise an error of the program that occurred during calls from C."""


@dataclass(frozen=True)
class Bodies:
    """The bodies of a rig that another program simulates."""

    kind: str  # one of `KINDS`
    file: str  # absolute path of its model; for Python, the name of the function in messages
    digest: str  # hash of the file: another file is another rig
    coordinates: tuple[str, ...]  # names of the rig's degrees of freedom in the program, in their order
    # Names of parameters and constants of the rig in the program, in the order of the rig.
    parameters: tuple[str, ...] = ()
    # Of MuJoCo, the names of the rig's states that are parts of a quaternion; to the program they go behind the parameters.
    states: tuple[str, ...] = ()
    # Of an FMU, the names of the states that are rates of the coordinates, and of the inputs that are forces
    # along them.
    rates: tuple[str, ...] = ()
    forces: tuple[str, ...] = ()
    step: float = 0.0  # of an FMU for co-simulation, its communication step [s]; 0 for that which it allows
    without_armature: bool = False  # of MuJoCo, whether the inertia of rotors at joints is left to the rig

    @cached_property
    def key(self) -> int:
        """A number that no other bodies have: sympy and C can carry it."""
        key = int(hashlib.sha256(repr(self).encode()).hexdigest()[:12], 16)
        _known.setdefault(key, self)
        return key

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return len(self.coordinates)

    @cached_property
    def c_text(self) -> str:
        """C functions ``simulated`` and ``simulated_slope``, which ask the program and remember its last answers."""
        fragments = {
            "KEY": self.key,
            "N": self.n,
            "P": len(self.parameters) + len(self.states),
            "GIVEN": self.n_given,
            "STEP": repr(STEP),
            "PROGRAM": self.program.c_text,
        }
        return filled(template("simulators", "simulated.c.txt"), fragments)

    @property
    def n_given(self) -> int:
        """What a force goes with, for each degree of freedom: coordinate and rate, and the rig's own force if it counts."""
        return 3 if self.program.reads_forces else 2

    @cached_property
    def answers(self) -> Responses:
        """The program as a function of numbers."""
        return Responses(self)

    @cached_property
    def program(self) -> Program:
        """The program, opened once."""
        if self.digest and model_digest(self.kind, Path(self.file)) != self.digest:
            included = ", what it includes or MuJoCo itself" if self.kind == "mujoco" else ""
            raise InputError(
                f"{self.file}{included} has changed since this rig was read; read the rig again."
            )
        program: Program = getattr(_module(self.kind), f"{self.kind.capitalize()}Program")(self)
        return program


class Responses:
    """Evaluates bodies at many points, with a compiled library."""

    def __init__(self, bodies: Bodies) -> None:
        self._bodies = bodies
        folders = bodies.program.include_folders
        head, answers = (template("simulators", part) for part in ("library.c.txt", "answers.c.txt"))
        library = ctypes.CDLL(str(library_file(f"{head}{bodies.c_text}{answers}", folders)))
        bodies.program.connect(library)
        self._answer = library.answer
        self._answer.restype = None
        self._answer.argtypes = [ctypes.c_int, ctypes.c_long, ctypes.c_void_p, ctypes.c_void_p]

    def at(self, arguments: Floats, *, is_force: bool) -> Floats:
        """Return the lower half of the mass matrix, or the forces, shape (n_values, n_places)."""
        n = self._bodies.n
        places = np.ascontiguousarray(arguments.T, dtype=np.float64)
        found = np.empty((places.shape[0], n if is_force else n * (n + 1) // 2))
        self._answer(int(is_force), places.shape[0], places.ctypes.data, found.ctypes.data)
        self._bodies.program.check()
        return np.ascontiguousarray(found.T)


_known: dict[int, Bodies] = {}
"""Bodies by their key, of which numbers alone stand in equations."""


def bodies_of(key: int) -> Bodies:
    """Return the bodies of a key."""
    return _known[key]


def model_digest(kind: str, path: Path) -> str:
    """Return the hash of a model: of MuJoCo's as it is compiled, with all files that it includes."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from None
    except ValueError as error:
        raise InputError(f"{str(path)!r} is not a file name: {error}.") from None
    if kind == "mujoco":
        content = _module(kind).compiled_model(path)
    return hashlib.sha256(content).hexdigest()


def _module(kind: str) -> ModuleType:
    """Return the module of a program, which imports this one; its library is loaded only for rigs that use it."""
    return import_module(f"rigsight.simulators.{kind}_program")


class _OfProgram(sp.Function):  # type: ignore[misc]
    """What another program computes: a number where all arguments are."""

    is_real = True

    def _eval_evalf(self, prec: int) -> sp.Expr | None:
        # Where sympy asks for a sign it evaluates arguments to two bits, and the key of the bodies with them.
        if not all(argument.is_number for argument in self.args):
            return None
        numbers = [a if a.is_Integer else float(a) for a in self.args]
        return sp.Float(self._imp_(*numbers), prec)


class simulated(_OfProgram):  # noqa: N801
    """``simulated(key, index, *arguments)``: see `mass_leaf` and `force_leaf`."""

    def fdiff(self, argindex: int = 1) -> sp.Expr:
        """Return the slope by one of the arguments."""
        key, index, *arguments = self.args
        if argindex < 3:
            return sp.Integer(0)
        return simulated_slope(key, index, sp.Integer(argindex - 3), *arguments)

    @staticmethod
    def _imp_(key: Any, index: Any, *arguments: Any) -> Any:
        return _shaped(_values(key, index, arguments), arguments)


class simulated_slope(_OfProgram):  # noqa: N801
    """``simulated_slope(key, index, argument, *arguments)``: its derivative by one argument; how that changes is left out."""

    def fdiff(self, argindex: int = 1) -> sp.Expr:  # noqa: ARG002
        """Return zero: only first derivatives are asked for."""
        return sp.Integer(0)

    @staticmethod
    def _imp_(key: Any, index: Any, by: Any, *arguments: Any) -> Any:
        by = int(by)
        here = np.asarray(arguments[by], dtype=np.float64)
        step = STEP * np.maximum(np.abs(here), 1.0)
        moved = [*arguments[:by], here + step, *arguments[by + 1 :]]
        before, behind = (_values(key, index, own) for own in (arguments, moved))
        return _shaped((behind - before) / step, arguments)


def mass_leaf(bodies: Bodies, row: int, column: int, q: Sequence[sp.Expr], p: Sequence[sp.Expr]) -> sp.Expr:
    """Return an entry of the mass matrix, of coordinates q and parameters p."""
    i, j = max(row, column), min(row, column)
    return simulated(sp.Integer(bodies.key), sp.Integer(i * (i + 1) // 2 + j), *q, *p)


def force_leaf(
    bodies: Bodies,
    row: int,
    q: Sequence[sp.Expr],
    v: Sequence[sp.Expr],
    f: Sequence[sp.Expr],
    p: Sequence[sp.Expr],
) -> sp.Expr:
    """Return the force along a coordinate that the bodies' weight, gyration and constraints put on it.

    It depends on coordinates q, rates v and parameters p, and on the forces f of drives and joints where bodies touch.
    """
    index = sp.Integer(bodies.n * (bodies.n + 1) // 2 + row)
    return simulated(sp.Integer(bodies.key), index, *q, *v, *(f if bodies.program.reads_forces else ()), *p)


def place_of(leaf: sp.Expr) -> tuple[int, ...]:
    """Return row and column of a leaf that is an entry of the mass matrix, and the row of one that is a force."""
    key, index = leaf.args[:2]
    if (force := _of_force(key, index)) >= 0:
        return (force,)
    row = next(i for i in range(bodies_of(int(key)).n) if int(index) < (i + 1) * (i + 2) // 2)
    return row, int(index) - row * (row + 1) // 2


def _of_force(key: Any, index: Any) -> int:
    """Return the row of a leaf that is a force; negative for an entry of the mass matrix."""
    n = bodies_of(int(key)).n
    return int(index) - n * (n + 1) // 2


def _shaped(values: Floats, arguments: Sequence[Any]) -> Any:
    shape = np.broadcast_shapes(*(np.shape(argument) for argument in arguments))
    return values.reshape(shape) if shape else float(values[0])


def _values(key: Any, index: Any, arguments: Sequence[Any]) -> Floats:
    """Return an entry of the mass matrix, or a force, shape (n_points,)."""
    force = _of_force(key, index)
    columns = np.stack(np.broadcast_arrays(*(np.asarray(a, dtype=np.float64).ravel() for a in arguments)))
    found = _answered(int(key), force >= 0, columns.shape, columns.tobytes())
    values: Floats = found[force if force >= 0 else int(index)]
    return values


@lru_cache(maxsize=_MOST_REMEMBERED)
def _answered(key: int, is_force: bool, shape: tuple[int, ...], content: bytes) -> Floats:
    """Return the lower half of the mass matrix, or the forces, at points given as bytes; each entry asks for the same."""
    with _lock:
        return bodies_of(key).answers.at(np.frombuffer(content).reshape(shape), is_force=is_force)


forget = _answered.cache_clear
"""Drops what is remembered: a function of Python may be another one now."""

"""What one record is: equally spaced samples of named signals in SI units, measured or simulated."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rigsight.errors import InputError, check_option, nearest

Role = Literal["estimation", "validation"]
Kind = Literal["sweep", "step", "multisine", "operation"]
Hold = Literal["zoh", "foh", "band_limited"]
Floats = NDArray[np.float64]
"""Samples, parameters, or whatever else is an array of numbers."""


@dataclass(frozen=True, eq=False)
class Record:
    """Equally spaced samples of named signals.

    Attributes
    ----------
    name
        How results call the record.
    dt
        Sample time [s].
    signals
        Signal name -> read-only samples, each of shape (n_samples,).
    units
        Signal name -> unit; a signal without an entry is dimensionless.
    t0
        Time of the first sample [s].
    role
        ``"estimation"`` may be fitted, ``"validation"`` is only ever scored.
    kind
        What drove the rig.
    amplitude
        Amplitude of the input, in its unit, where one is meaningful.
    hold
        The input between samples.
    source
        The file it was read from, None for a simulated record.
    notes
        Notes on problems and repairs while reading, one sentence each.
    constants
        Known numbers of the rig that differ from record to record (a payload), by name; they replace the campaign's.
    observed
        Bandwidth [rad/s], by sensor, of the observer that pulls a simulation towards the measurement while it is fitted.
    free_offsets
        Outputs whose sensor has its own offset in this record: a fit estimates it together with the initial state.
    window_of
        Name of the record that this is a window of; empty for a whole record.
    starting_samples
        Number of first samples that alone determine the initial state in a fit; the rest is a free run. 0: all samples do.
    clock_uncertainty
        Time [s] by which signals may be late against each other, as far as the clocks that stamped them can tell.

    Raises
    ------
    InputError
        If the signals differ in length, are not one-dimensional and finite, `dt` is not a positive number, or `t0` not finite.
    """

    name: str
    dt: float
    signals: Mapping[str, Floats]
    units: Mapping[str, str]
    t0: float = 0.0
    role: Role = "estimation"
    kind: Kind = "operation"
    amplitude: float | None = None
    hold: Hold = "foh"
    source: Path | None = None
    notes: tuple[str, ...] = ()
    constants: Mapping[str, float] = field(default_factory=dict)
    observed: Mapping[str, float] = field(default_factory=dict)
    free_offsets: tuple[str, ...] = ()
    window_of: str = ""
    starting_samples: int = 0
    clock_uncertainty: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.dt) and self.dt > 0.0):
            raise InputError(
                f"Record '{self.name}': dt must be a positive number of seconds, got {self.dt!r}."
            )
        if not math.isfinite(self.t0):
            raise InputError(f"Record '{self.name}': t0 must be a finite number of seconds, got {self.t0!r}.")
        if not self.signals:
            raise InputError(f"Record '{self.name}' has no signals: give at least one.")
        check_option(f"Record '{self.name}': role", self.role, get_args(Role))
        check_option(f"Record '{self.name}': kind", self.kind, get_args(Kind))
        check_option(f"Record '{self.name}': hold", self.hold, get_args(Hold))
        signals = {signal: self._checked(signal, samples) for signal, samples in self.signals.items()}
        lengths = {signal: samples.size for signal, samples in signals.items()}
        if len(set(lengths.values())) > 1:
            listed = ", ".join(f"{signal} {length}" for signal, length in lengths.items())
            raise InputError(
                f"Record '{self.name}': signals must have the same number of samples, got {listed}."
            )
        object.__setattr__(self, "signals", MappingProxyType(signals))
        object.__setattr__(self, "units", MappingProxyType(dict(self.units)))
        for constant, value in self.constants.items():
            if not math.isfinite(value):
                raise InputError(
                    f"Record '{self.name}': constant '{constant}' must be finite, got {value!r}."
                )
        constants = {constant: float(value) for constant, value in self.constants.items()}
        object.__setattr__(self, "constants", MappingProxyType(constants))

    def _checked(self, signal: str, samples: ArrayLike) -> Floats:
        """Return a private, read-only copy, so that a caller cannot change the record through its array."""
        array = np.array(samples, dtype=np.float64)
        if array.ndim != 1 or array.size == 0:
            raise InputError(
                f"Record '{self.name}': signal '{signal}' must have shape (n_samples,), got {array.shape}."
            )
        finite = np.isfinite(array)
        if not finite.all():
            raise InputError(
                f"Record '{self.name}': signal '{signal}' is {array[~finite][0]} at sample {int(np.argmin(finite))}; "
                "all samples must be finite."
            )
        array.flags.writeable = False
        return array

    # A mappingproxy cannot be pickled, and records travel to worker processes.
    def __getstate__(self) -> dict[str, object]:
        own = {"signals": dict(self.signals), "units": dict(self.units), "constants": dict(self.constants)}
        return {**self.__dict__, **own}

    def __setstate__(self, state: dict[str, object]) -> None:
        self.__dict__.update(state)
        self.__post_init__()

    # That of the dataclass would hold every sample.
    def __repr__(self) -> str:
        return (
            f"Record({self.name!r}, {self.n_samples} samples of {', '.join(self.signals)}, dt={self.dt:.6g} s, "
            f"role={self.role!r}, kind={self.kind!r})"
        )

    @property
    def origin(self) -> str:
        """Name of the record that this is a window of; of a whole record its own."""
        return self.window_of or self.name

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return next(iter(self.signals.values())).size

    @property
    def t(self) -> Floats:
        """Time stamps [s], shape (n_samples,)."""
        return self.t0 + self.dt * np.arange(self.n_samples, dtype=np.float64)

    @property
    def duration(self) -> float:
        """Time from the first to the last sample [s]."""
        return self.dt * (self.n_samples - 1)

    def __getitem__(self, signal: str) -> Floats:
        try:
            return self.signals[signal]
        except KeyError:
            known = f"{nearest(signal, self.signals)} It has: {', '.join(self.signals)}."
            raise InputError(f"Record '{self.name}' has no signal '{signal}'.{known}") from None

    def __contains__(self, signal: object) -> bool:
        return signal in self.signals

    def with_signals(self, /, **signals: ArrayLike) -> Record:
        """Return a copy in which signals are added or replaced.

        Parameters
        ----------
        **signals
            Signal name -> samples in SI units, each of shape (n_samples,).
        """
        added = {signal: np.asarray(samples, dtype=np.float64) for signal, samples in signals.items()}
        return replace(self, signals={**self.signals, **added})

    def with_free_offsets(self, sensors: Iterable[str]) -> Record:
        """Return a copy in which the sensors that it holds have an offset of their own.

        Parameters
        ----------
        sensors
            Names of outputs.
        """
        return replace(self, free_offsets=tuple(name for name in sensors if name in self))

    def slice(self, start: int | None, stop: int | None) -> Record:
        """Return a stretch of the record; its time stamps stay.

        Parameters
        ----------
        start, stop
            First sample and the one behind the last, counted as Python slices are.

        Raises
        ------
        InputError
            If nothing is left.
        """
        first, last, _ = slice(start, stop).indices(self.n_samples)
        if last <= first:
            raise InputError(f"Record '{self.name}': no samples in [{start}, {stop}) of {self.n_samples}.")
        return replace(
            self,
            t0=self.t0 + first * self.dt,
            signals={signal: samples[first:last] for signal, samples in self.signals.items()},
        )

"""A rig without records yet: what a simulated sweep through its natural frequencies would show."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np

from rigsight.campaign import Campaign
from rigsight.errors import InputError, SimulationError
from rigsight.excitation import log_sweep
from rigsight.records import Record
from rigsight.rigs import Rig, read_rig_file
from rigsight.simulate import compose, simulate
from rigsight.simulate.linearization import linearize

_BELOW, _ABOVE = 0.2, 5.0
"""Ends of the sweep in units of the lowest and of the highest natural frequency."""
_WIDEST = 1e3
"""Ratio of these ends at most."""
_ASIDE = 0.8
"""Ratio of the frequencies of two inputs, so that each moves the rig in its own way."""
_SAMPLES, _PER_PERIOD = 20000, 12.0
_NOISE = 1e-3
"""Noise of each reading over its standard deviation: that of a good sensor."""


def is_rig_file(path: Path) -> bool:
    """Return whether a file declares a rig and is no campaign; what cannot be read is left to who reads the campaign."""
    try:
        tables = tomllib.loads(path.read_text("utf-8-sig"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError):
        return False
    return "sensors" in tables and not {"rig", "records"} & tables.keys()


def campaign_of_rig(path: Path, amplitudes: Mapping[str, float] = MappingProxyType({})) -> Campaign:
    """Return a campaign whose one record is simulated with the numbers of a rig file.

    Each input is swept with its amplitude, or with 1.

    Raises
    ------
    InputError
        If the file leaves a number open, or its equations cannot be simulated with these numbers.
    """
    rig = read_rig_file(path)
    numbers = {p.name: p.default for p in (*rig.constants, *rig.parameters)}
    values = {name: value for name, value in numbers.items() if value is not None}
    if len(values) < len(numbers):
        missing = ", ".join(name for name in numbers if name not in values)
        raise InputError(
            f"{path}: without records every number needs a value, and these have none: {missing}. Give default = ... in the rig "
            "file, or check a campaign with records."
        )
    if not rig.inputs:
        raise InputError(
            f"{path}: the rig has no input, so nothing moves it without records. Check a campaign."
        )
    try:
        record, low, high = _swept(rig, values, amplitudes)
    except SimulationError as error:
        raise InputError(f"{path}: cannot be simulated with its numbers: {error}") from None
    sizes = ", ".join(f"{amplitudes.get(signal.name, 1.0):.3g} in {signal.name}" for signal in rig.inputs)
    note = (
        f"There are no records: a sweep from {low:.3g} to {high:.3g} rad/s with an amplitude of {sizes} was simulated "
        f"with the numbers of {path.name}, and noise of {_NOISE:.1%} was added to each reading."
    )
    return Campaign(
        rig.name,
        rig,
        {p.name: values[p.name] for p in rig.constants},
        {p.name: values[p.name] for p in rig.parameters},
        (record,),
        notes=(note,),
    )


def _swept(
    rig: Rig, values: Mapping[str, float], amplitudes: Mapping[str, float]
) -> tuple[Record, float, float]:
    """Return the simulated sweep with noise, and its first and last angular frequency [rad/s]."""
    structure = compose(rig)
    natural = np.abs(linearize(structure, values).poles)
    natural = natural[natural > 1e-6 * np.max(natural, initial=0.0)]
    high = _ABOVE * float(np.max(natural, initial=0.0)) or 1.0
    low = max(_BELOW * float(np.min(natural, initial=high)), high / _WIDEST)
    dt = 2.0 * np.pi / (_PER_PERIOD * high)
    t = np.asarray(dt * np.arange(_SAMPLES), dtype=np.float64)
    inputs = {
        signal.name: log_sweep(t, amplitudes.get(signal.name, 1.0), _ASIDE**i * low, _ASIDE**i * high)
        for i, signal in enumerate(rig.inputs)
    }
    units = {signal.name: signal.unit for signal in (*rig.inputs, *rig.outputs)}
    run = simulate(structure, values, Record("simulated sweep", dt, inputs, units, kind="sweep"))
    rng = np.random.default_rng(0)
    noisy = {
        s.name: run[s.name] + _NOISE * np.std(run[s.name]) * rng.standard_normal(t.size) for s in rig.outputs
    }
    return run.with_signals(**noisy), low, high

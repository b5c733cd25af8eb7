"""How far and how fast the inputs of a rig of any shape move: all at once, each with a different waveform.

Amplitudes follow from the equations: the motion has a random size, smaller where a control law saturates or the motion is
far from linear.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import SimulationError
from rigsight.identify.rig_equations import equations_of
from rigsight.identify.start.scales import motion_in_record
from rigsight.records import Kind
from rigsight.rigs import Rig
from rigsight.simulate import Structure, compose, simulate
from rigsight.simulate.linearization import linearize
from rigsight_bench.trials.runs import DT, Run
from rigsight_bench.trials.waveforms import Doublet, Multisine, Sweep, Waveform

Floats = NDArray[np.float64]

DURATION = 20.0
"""Of a record [s]."""
_BAND = (0.25, 2.0)
"""Ends of a sweep in units of the lowest and of the highest natural frequency."""
_WHERE_NOTHING_MOVES = (3.0, 45.0)
"""Natural frequencies [rad/s] that count for a rig on which every motion is prescribed."""
_LARGEST_FREQUENCY = 100.0
"""Highest frequency of an input [rad/s]: a tenth of the sample rate, so that linear interpolation is accurate."""
_N_LINES = 40
_RISE = 1.0
_MOTION = (0.03, 0.5)
"""Largest deviation of a coordinate from rest [rad, m], as of a rig on a table."""
_MOST_BENT = 0.3
"""Relative difference of the motion without an effect from the scaled motion at a twentieth of the inputs."""
_FRACTION = 0.05
_LESS = 0.7
_TRIES = 16


def draw_amplitudes(
    rig: Rig, values: Mapping[str, float], rng: np.random.Generator
) -> tuple[dict[str, float], tuple[float, float]]:
    """Draw how far a rig moves, and return the amplitude of each input and the ends of the band [rad/s] in which they move.

    Parameters
    ----------
    rig
        The rig, with one input at least.
    values
        Its constants and parameters.
    rng
        Source of randomness.

    Raises
    ------
    SimulationError
        If the rig cannot be simulated with inputs of any size.
    """
    structure, band = compose(rig), _band(rig, values)
    shares = {name: _unit(rig, structure, values, name, band) for name in rig.mechanism.inputs}
    size = draw_motion(rng)
    amplitudes = {name: size / max(share, 1e-300) for name, share in shares.items()}
    largest = [_trial("multisine", multisines(amplitudes, band, rng))]
    largest.append(_trial("sweep", sweeps(amplitudes, band, rng)))
    for _ in range(_TRIES):
        if all(_bent(structure, values, run) <= _MOST_BENT for run in largest):
            break
        amplitudes = {name: _LESS * a for name, a in amplitudes.items()}
        largest = [replace(run, waveforms=in_proportion(run.waveforms, _LESS)) for run in largest]
    return amplitudes, band


def draw_motion(rng: np.random.Generator) -> float:
    """Draw the largest deviation of a coordinate from rest [rad, m]."""
    return math.exp(rng.uniform(*np.log(_MOTION)))


def _trial(kind: Kind, waveforms: Mapping[str, Waveform]) -> Run:
    return Run("trial", "estimation", kind, "band_limited", waveforms, round(DURATION / DT))


def _band(rig: Rig, values: Mapping[str, float]) -> tuple[float, float]:
    """Return the ends of the band [rad/s] in which the inputs move."""
    poles = linearize(compose(rig), values).poles
    sizes = np.abs(poles[np.abs(poles.imag) > 0.0])
    lowest, highest = (sizes.min(), sizes.max()) if sizes.size else _WHERE_NOTHING_MOVES
    return float(_BAND[0] * lowest), float(min(_BAND[1] * highest, _LARGEST_FREQUENCY))


def _unit(
    rig: Rig, structure: Structure, values: Mapping[str, float], name: str, band: tuple[float, float]
) -> float:
    """Return how far any coordinate moves for a small sweep of one input, per unit of it."""
    # Small compared with the range of any control law and any angle, in SI units.
    small = 1e-3
    waves: dict[str, Waveform] = {other: Sweep(0.0, *band, DURATION) for other in rig.mechanism.inputs}
    waves[name] = Sweep(small, *band, DURATION)
    record = _trial("sweep", waves).record()
    shown = simulate(structure, values, record)
    equations = equations_of(rig)
    states, _ = motion_in_record(equations, shown, values)
    moved = [float(np.ptp(z)) / 2.0 for z in states[: equations.n_coordinates]]
    prescribed = [c.prescribed_by for c in rig.mechanism.prescribed]
    return max([*moved, small if name in prescribed else 0.0]) / small


def _bent(structure: Structure, values: Mapping[str, float], run: Run) -> float:
    """Return by how much the motion differs from that under small inputs, relative to itself; infinite if there is no motion."""
    small = replace(run, waveforms=in_proportion(run.waveforms, _FRACTION))
    try:
        whole, little = (simulate(structure, values, r.record()) for r in (run, small))
    except SimulationError:
        return math.inf
    shares = []
    for signal in structure.rig.outputs:
        rest = little[signal.name][0]
        line = (little[signal.name] - rest) / _FRACTION
        size = float(np.std(line))
        if size > 0.0:
            shares.append(float(np.sqrt(np.mean((whole[signal.name] - rest - line) ** 2))) / size)
    return max(shares, default=0.0)


def sweeps(
    amplitudes: Mapping[str, float],
    band: tuple[float, float],
    rng: np.random.Generator,
    duration: float = DURATION,
) -> dict[str, Waveform]:
    """Return a sweep for each input: every other one downwards, and none at the frequency of another for long."""
    waves: dict[str, Waveform] = {}
    for i, (name, amplitude) in enumerate(amplitudes.items()):
        low, high = (end * math.exp(rng.uniform(-0.1, 0.1)) for end in band)
        ends = (low, high) if i % 2 == 0 else (high, low)
        waves[name] = Sweep(amplitude, *ends, duration)
    return waves


def multisines(
    amplitudes: Mapping[str, float], band: tuple[float, float], rng: np.random.Generator
) -> dict[str, Waveform]:
    """Return a multisine for each input, of lines spread evenly over the logarithm of the frequency."""
    fundamental = 2.0 * math.pi / DURATION
    lines = np.unique(
        np.round(np.geomspace(max(band[0] / fundamental, 1.0), band[1] / fundamental, _N_LINES))
    )
    waves: dict[str, Waveform] = {}
    for name, amplitude in amplitudes.items():
        # As much power as a sweep of that amplitude.
        each = np.full(lines.size, amplitude / math.sqrt(lines.size))
        waves[name] = Multisine(each, fundamental * lines, rng.uniform(0.0, 2.0 * np.pi, lines.size), _RISE)
    return waves


def doublets(
    amplitudes: Mapping[str, float], band: tuple[float, float], rng: np.random.Generator
) -> dict[str, Waveform]:
    """Return a doublet for each input, one after the other, each as long as a slow period."""
    # It jumps just before a sample of the records, for plant and record alike, because a hold cannot represent a jump in between.
    length = DT * round(min(2.0 * math.pi / band[0] / 2.0, DURATION / 8.0) / DT)
    return {
        name: Doublet(
            amplitude, DT * (round((1.0 + rng.uniform(0.5, 1.5) * (1 + i) * length) / DT) - 0.1), length
        )
        for i, (name, amplitude) in enumerate(amplitudes.items())
    }


def in_proportion(waveforms: Mapping[str, Waveform], share: float) -> dict[str, Waveform]:
    """Return waveforms of this share of their size."""
    found: dict[str, Waveform] = {}
    for name, wave in waveforms.items():
        if isinstance(wave, Multisine):
            found[name] = replace(wave, amplitudes=share * wave.amplitudes)
        elif isinstance(wave, Sweep | Doublet):
            found[name] = replace(wave, amplitude=share * wave.amplitude)
    return found

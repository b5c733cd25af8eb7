"""Which experiment would distinguish the rivals of an ambiguous verdict? Both are simulated for a small set of candidate inputs.

References
----------
W. G. Hunter and A. M. Reiner, Technometrics 7 (1965) 307, for choosing the experiment where rival models differ most.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.policy import NOTES
from rigsight.errors import SimulationError
from rigsight.excitation import linear_sweep, step
from rigsight.records.record import Floats, Hold, Record
from rigsight.simulate import simulate

_Band = tuple[float, float] | None
_Experiment = tuple[str, str, float, _Band]
"""Waveform, source, amplitude and band, as in `Advice`."""


@dataclass(frozen=True)
class Advice:
    """The experiment that would distinguish a rival from the named effects."""

    rival: tuple[str, ...]  # names of the rival's effects
    # Waveform of which input: amplitude in the unit of the input, band [rad/s] where the waveform has one.
    waveform: str
    source: str
    amplitude: float
    band: _Band
    # Where the two differ most, and the RMS difference of their predictions there in standard deviations of
    # the noise.
    output: str
    separation: float


def advise(
    context: FitContext, chosen: FittedModel, rivals: Sequence[FittedModel], noise: Mapping[str, float]
) -> tuple[Advice, ...]:
    """Return, for each rival, the candidate experiment that would distinguish it best from the chosen model."""
    # The separation is the RMS difference of the two predictions, in standard deviations of the noise, at the output where it is
    # largest. Both models keep their fitted parameters, so that it is an upper bound: refitting may reduce it.
    found, menu = [], list(_menu(context))
    for rival in rivals:
        scored = [
            Advice(rival.names, *experiment, output, size)
            for experiment, inputs in menu
            for output, size in _separations(context, chosen, rival, inputs, noise)
        ]
        if scored:
            found.append(max(scored, key=lambda advice: advice.separation))
    return tuple(found)


def _separations(
    context: FitContext,
    chosen: FittedModel,
    rival: FittedModel,
    inputs: Mapping[str, Floats],
    noise: Mapping[str, float],
) -> Iterator[tuple[str, float]]:
    hold: Hold = context.estimation[0].hold
    units = {source.name: source.unit for source in context.rig.inputs}
    record = Record("advice", context.estimation[0].dt, inputs, units, hold=hold)
    try:
        one, other = (simulate(m.fit.structure, m.fit.values, record, accuracy=1e-5) for m in (chosen, rival))
    except SimulationError:
        return
    for output, size in noise.items():
        yield output, float(np.sqrt(np.mean((one[output] - other[output]) ** 2)) / size)


def _menu(context: FitContext) -> Iterator[tuple[_Experiment, dict[str, Floats]]]:
    """Yield each experiment with its inputs."""
    dt = context.estimation[0].dt
    omega = 1.0 / context.scales["time"]
    n_samples = max(200, min(40_000, round(NOTES.advised_periods * 2.0 * math.pi / omega / dt)))
    t = dt * np.arange(n_samples, dtype=np.float64)
    slow, fast = (share * omega for share in NOTES.advised_band)
    fast = min(fast, 0.4 * math.pi / dt)
    drives: tuple[tuple[str, _Band, Callable[[float], Floats]], ...] = (
        ("sweep", (slow, fast), lambda a: linear_sweep(t, a, slow, fast)),
        ("slow sine", (slow, slow), lambda a: a * np.sin(slow * t)),
        ("sine", (omega, omega), lambda a: a * np.sin(omega * t)),
    )
    if context.rig.is_driven:
        drives += (("step", None, lambda a: step(t, a, 0.1 * float(t[-1]))),)
    recorded = {
        signal.name: np.concatenate([record[signal.name] for record in context.estimation])
        for signal in context.rig.inputs
    }
    middles = {name: float(np.median(samples)) for name, samples in recorded.items()}
    rest = {name: np.full(n_samples, middle) for name, middle in middles.items()}
    for source, samples in recorded.items():
        below, above = middles[source] - float(np.min(samples)), float(np.max(samples)) - middles[source]
        for share in NOTES.advised_amplitudes:
            for waveform, band, drive in drives:
                # A step goes to one side of the middle, the others to both.
                largest = (above if above >= below else -below) if waveform == "step" else min(above, below)
                moved = {**rest, source: middles[source] + drive(share * largest)}
                if largest != 0.0:
                    yield (waveform, source, share * largest, band), moved

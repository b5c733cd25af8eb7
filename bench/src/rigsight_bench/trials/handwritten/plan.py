"""Records of a trial: sample rate, hold, kinds, amplitudes, lengths and rests are drawn at random for each trial."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rigsight.records import Hold, Kind, Role
from rigsight_bench.trials.handwritten.equations.held_inputs import Generated, Held, Input
from rigsight_bench.trials.runs import Run
from rigsight_bench.trials.waveforms import Doublet, Multisine, PlannedMoves, Signal, Sweep, Waveform

_RATES = (100.0, 200.0, 250.0, 400.0, 500.0, 1000.0)
"""Sample rates of common loggers and controllers [Hz]; natural frequencies end at 7 Hz."""
_HOLDS: tuple[Hold, ...] = ("zoh", "foh", "band_limited")
"""A digital controller's output, a trajectory generator's, an analog generator's; a step is always held."""
_DURATION = (12.0, 25.0)
"""[s]: several periods of the slowest motion, and what people wait for."""
_MOST_SAMPLES = 10_000
"""Of one record: whoever samples faster records for a shorter time."""
_N_ESTIMATION, _N_VALIDATION = (3, 5), (1, 3)
_LEAST, _SMALL = 0.25, 0.5
"""Range of the smallest record, in units of the largest."""
_REST = (0.5, 2.0)
"""Rest at the beginning of a record [s] in half of all trials; the others begin at once, so that no record shows the noise
alone."""
_LINES = (15, 60)
"""Sines of a multisine: from a hand-made one to a full band."""
_FADE = 1.0
"""Time in which a multisine fades in [s]."""
_MOVES = 6.0
"""Length of a move in units of the reciprocal of the band's middle [rad/s]."""


@dataclass(frozen=True)
class Later:
    """A waveform behind a rest.

    Attributes
    ----------
    waveform
        The waveform.
    rest
        Length of the rest [s].
    """

    waveform: Waveform
    rest: float

    @property
    def breaks(self) -> tuple[float, ...]:
        """Those of the waveform."""
        return tuple(t + self.rest for t in self.waveform.breaks)

    def piece(self, index: int) -> Signal:
        """Return a piece of the waveform."""
        piece, rest = self.waveform.piece(index), self.rest
        return lambda t: piece(t - rest)


def between_samples(run: Run) -> list[Input]:
    """Return the inputs of the plant between the samples of a record, exactly according to its hold."""
    if run.hold == "band_limited":
        return [Generated(waveform) for waveform in run.waveforms.values()]
    return [Held(u.tolist(), run.dt, lines=run.hold == "foh") for u in run.inputs().values()]


def draw_plan(
    amplitudes: Mapping[str, float],
    band: tuple[float, float],
    rng: np.random.Generator,
    *,
    prescribed: bool,
) -> tuple[Run, ...]:
    """Draw the records of a campaign, and behind them two that stay withheld from every diagnosis.

    Parameters
    ----------
    amplitudes
        Largest size of each input.
    band
        Ends of the band in which they move [rad/s].
    rng
        Source of randomness.
    prescribed
        True for an element: a prescribed motion cannot jump or have corners.
    """
    dt = 1.0 / float(rng.choice(_RATES))
    hold: Hold = "band_limited" if prescribed else _HOLDS[int(rng.integers(len(_HOLDS)))]
    # A motion at rest shows only the offset of an element, not its noise.
    rest = rng.uniform(*_REST) if rng.random() < 0.5 and not prescribed else 0.0
    kinds: tuple[Kind, ...] = ("sweep", "multisine", "operation", "step")
    any_kind = kinds[:2] if prescribed else kinds

    def recording(name: str, role: Role | None, kind: Kind, share: float) -> Run:
        n = min(round(rng.uniform(*_DURATION) / dt), _MOST_SAMPLES)
        own = {name: share * amplitude for name, amplitude in amplitudes.items()}
        moving = n * dt - rest
        waves = {name: _waveform(kind, i, a, band, moving, rng) for i, (name, a) in enumerate(own.items())}
        late: dict[str, Waveform] = {name: Later(w, rest) if rest else w for name, w in waves.items()}
        return Run(name, role, kind, "zoh" if kind == "step" else hold, late, n, dt)

    n_estimation, n_validation = (
        int(rng.integers(low, high + 1)) for low, high in (_N_ESTIMATION, _N_VALIDATION)
    )
    main: Kind = "sweep" if rng.random() < 0.5 else "multisine"
    other: Kind = "multisine" if main == "sweep" else "sweep"
    # Whatever else is recorded: a small one and a large one to fit, and one of another waveform to score.
    roles: list[tuple[Role | None, Kind, float]] = [
        ("estimation", main, rng.uniform(_LEAST, _SMALL)),
        ("estimation", main, 1.0),
    ]
    roles += [
        ("estimation", any_kind[int(rng.integers(len(any_kind)))], rng.uniform(_SMALL, 1.0))
        for _ in range(n_estimation - 2)
    ]
    roles.append(("validation", other, rng.uniform(_SMALL, 0.9)))
    roles += [
        ("validation", any_kind[int(rng.integers(len(any_kind)))], rng.uniform(_LEAST, 0.9))
        for _ in range(n_validation - 1)
    ]
    seen = [recording(f"record_{i}", *row) for i, row in enumerate(roles, 1)]
    withheld = [
        recording("withheld_1", None, "multisine", rng.uniform(_SMALL, 0.8)),
        recording("withheld_2", None, "sweep" if prescribed else "step", rng.uniform(_SMALL, 0.9)),
    ]
    return (*seen, *withheld)


def _waveform(
    kind: Kind,
    number: int,
    amplitude: float,
    band: tuple[float, float],
    duration: float,
    rng: np.random.Generator,
) -> Waveform:
    """Return what one of several inputs does for `duration` [s]."""
    low, high = (end * math.exp(rng.uniform(-0.2, 0.2)) for end in band)
    if kind == "sweep":
        # Two simultaneous sweeps run in opposite directions, so that they have the same frequency only briefly.
        return Sweep(amplitude, *((low, high) if number % 2 == 0 else (high, low)), duration)
    if kind == "multisine":
        fundamental = 2.0 * math.pi / duration
        n_lines = int(rng.integers(_LINES[0], _LINES[1] + 1))
        lines = np.unique(np.round(np.geomspace(max(low / fundamental, 1.0), high / fundamental, n_lines)))
        each = np.full(lines.size, amplitude / math.sqrt(lines.size))
        return Multisine(each, fundamental * lines, rng.uniform(0.0, 2.0 * np.pi, lines.size), _FADE)
    start = rng.uniform(0.2, 1.0)
    middle = math.sqrt(low * high)
    if kind == "operation":
        return PlannedMoves(amplitude, start, min(_MOVES / middle, (duration - start) / 6.0))
    length = min(math.pi / low, (duration - start) / 4.0)
    return Doublet(amplitude, start + 1.2 * number * length, length)

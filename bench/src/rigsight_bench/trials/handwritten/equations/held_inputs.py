"""Course of an input between its recorded samples."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from typing import Protocol

from rigsight_bench.trials.waveforms import Signal, Waveform


class Input(Protocol):
    """An input as a function of time that is smooth between its breaks."""

    @property
    def breaks(self) -> Sequence[float]:
        """Times [s] at which it or its slope jumps, increasing."""
        ...

    def during(self, begin: float, end: float) -> Signal:
        """Return the input between two times [s] with no break inside."""
        ...


class Generated:
    """The waveform itself: an analog generator, whose samples a record holds.

    Parameters
    ----------
    waveform
        The waveform.
    """

    def __init__(self, waveform: Waveform) -> None:
        self.breaks: Sequence[float] = waveform.breaks
        self._pieces = [waveform.piece(i) for i in range(len(self.breaks) + 1)]

    def during(self, begin: float, end: float) -> Signal:
        """Return the piece of the waveform."""
        return self._pieces[bisect_right(self.breaks, 0.5 * (begin + end))]


class Held:
    """What a converter makes of samples: steps, or lines from one to the next.

    Before the first sample it is that sample, behind the last one the last.

    Parameters
    ----------
    samples
        The samples.
    dt
        Sample time [s].
    lines
        True for lines.
    """

    def __init__(self, samples: Sequence[float], dt: float, *, lines: bool) -> None:
        self._samples = [float(value) for value in samples]
        self._dt = dt
        self._lines = lines
        self.breaks: Sequence[float] = [dt * i for i in range(len(self._samples))]

    def during(self, begin: float, end: float) -> Signal:
        """Return the step or the line."""
        index = math.floor(0.5 * (begin + end) / self._dt)
        last = len(self._samples) - 1
        level = self._samples[min(max(index, 0), last)]
        if not self._lines or not 0 <= index < last:
            return lambda _: level
        slope, start = (self._samples[index + 1] - level) / self._dt, self._dt * index
        return lambda t: level + slope * (t - start)


class Late:
    """An input that arrives late.

    Parameters
    ----------
    on_time
        The input.
    late
        Dead time [s].
    """

    def __init__(self, on_time: Input, late: float) -> None:
        self._on_time = on_time
        self._late = late
        self.breaks: Sequence[float] = [t + late for t in on_time.breaks]

    def during(self, begin: float, end: float) -> Signal:
        """Return what was sent so much earlier."""
        late = self._late
        sent = self._on_time.during(begin - late, end - late)
        return lambda t: sent(t - late)

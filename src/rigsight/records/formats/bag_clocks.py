"""By which clocks do the messages of a bag go, and how do they come onto one?

A header has the moment of a message by the clock of its publisher; the recorder adds that of the reception, by its own clock. A
message is received after it was stamped, and soon: what contradicts that is a difference of clocks. The lower edge of the time
between both, where messages travelled fast, shows how the clocks are related (V. Paxson, *On calibrating measurements of packet
transit times*, 1998).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigsight.records.record import Floats

Nanoseconds = NDArray[np.int64]

_LONGEST, _MOST_UNDER_WAY = 0.1, 10
"""Fast messages travel shorter [s], on one machine as in a network, or no more of them are under way at a time: pictures that are
evaluated come late, but not thousands of readings (assumptions)."""
_SYNCHRONIZED = 1e-4
"""Clocks that differ by less [s] are one: what PTP, and the rounding of stamps, leave (an assumption)."""
_FASTEST = 0.01
"""Speeds of two real clocks differ by less, of crystals by a hundredth of it; simulated time goes at any (an assumption)."""
_STRETCHES, _FEWEST = 20, 5
"""Stretches of a bag, each with an edge, and how many of them can show a drift (conventions)."""
_FEWEST_IN_STRETCH = 10
_FAST = 0.05
"""Share of messages that may be faster than the edge: some are stamped wrongly, or swapped (a convention)."""
_CLEAR = 3.0
"""A drift moves the lower edge by so many times what it scatters about a line (a convention)."""
_SECOND = 1_000_000_000
_NO_DATE = 1e8
"""Seconds between clocks from which they count from different moments, not wrongly from the same."""


@dataclass(frozen=True, eq=False)
class Stamps:
    """When the messages of a topic were received, and stamped where they have a header [ns], shape (n_messages,) each."""

    topic: str
    received: Nanoseconds
    stamped: Nanoseconds  # 0 where a message is not stamped

    def have_headers(self) -> bool:
        """Return True if messages are stamped, and not all with one moment."""
        given = self.stamped[self.stamped != 0]
        return given.size > 1 and bool(np.any(given != given[0]))


@dataclass(frozen=True, eq=False)
class OnOneClock:
    """The times of a topic on the clock of a bag."""

    stamps: Nanoseconds  # shape (n_messages,)
    late: float = 0.0  # median time from them to the reception [s]
    notes: tuple[str, ...] = ()  # what was done to them


@dataclass(frozen=True, eq=False)
class _Clock:
    """A clock, by moments of the recorder and what it shows then."""

    topic: str
    # The first of both [ns], and points of a line behind them [s].
    origin: tuple[int, int]
    received: Floats
    shown: Floats
    is_of_recorder: bool = False
    is_even: bool = True  # whether the line is straight and nearly as fast as the recorder

    def shows(self, received: Nanoseconds) -> Nanoseconds:
        """Return what it shows at moments of the recorder."""
        if self.is_of_recorder:
            return received
        return _along(received - self.origin[0], self.received, self.shown) + self.origin[1]

    def moment(self, shown: Nanoseconds) -> Nanoseconds:
        """Return the moments of the recorder at which it shows something."""
        if self.is_of_recorder:
            return shown
        return _along(shown - self.origin[1], self.shown, self.received) + self.origin[0]

    def describe(self) -> str:
        """Return how it differs from the recorder's."""
        span, own = float(np.ptp(self.received)), float(np.ptp(self.shown))
        ahead = (self.origin[1] - self.origin[0]) / _SECOND + float(self.shown[0] - self.received[0])
        if abs(ahead) > _NO_DATE:
            where = "count from another moment than the times of reception"
        else:
            side = "ahead of" if ahead > 0.0 else "behind"
            where = f"are {abs(ahead):.3g} s {side} the times of reception"
            if ahead < -_LONGEST:
                where += " (longer than messages travel)"
        if not self.is_even:
            speed = f"{own / span:.3g} of their speed on average"
            return f"{where} and run at {speed}, as simulated time or a clock that is set"
        drift = own - span
        if abs(drift) < _SYNCHRONIZED:
            return where
        return f"{where} and drift by {drift:.3g} s in {span:.3g} s"


def on_one_clock(topics: Sequence[Stamps]) -> list[OnOneClock]:
    """Return the times of each topic, by the clock of most headers; by that of the recorder where there are no headers."""
    recorder = _Clock("", (0, 0), np.array([0.0, 1.0]), np.array([0.0, 1.0]), is_of_recorder=True)
    clocks, own_clock = [recorder], {}
    order = sorted(range(len(topics)), key=lambda number: -np.count_nonzero(topics[number].stamped))
    for number in order:
        topic = topics[number]
        if not topic.have_headers():
            continue
        found = next((clock for clock in clocks if _is_of(topic, clock)), None)
        if found is None:
            clocks.append(found := _clock_of(topic))
        own_clock[number] = found
    weights = {id(clock): 0 for clock in clocks}
    for number, clock in own_clock.items():
        weights[id(clock)] += topics[number].stamped.size
    base = max(clocks, key=lambda clock: weights[id(clock)])
    return [_onto(base, own_clock.get(i), topic, bool(own_clock)) for i, topic in enumerate(topics)]


def _onto(base: _Clock, own: _Clock | None, topic: Stamps, others_have_headers: bool) -> OnOneClock:
    """Return the times of a topic on a clock."""
    if own is None:
        if not others_have_headers:
            return OnOneClock(topic.received)
        note = f"'{topic.topic}' has no headers: its times are those of its reception"
        if not base.is_of_recorder:
            note += f", moved onto the clock of the headers of '{base.topic}', which {base.describe()}"
        return OnOneClock(base.shows(topic.received), 0.0, (note,))
    stamped, is_given = topic.stamped, topic.stamped != 0
    expected = own.shows(topic.received)
    late = int(np.median((expected - stamped)[is_given]))
    notes = []
    if not is_given.all():
        stamped = np.where(is_given, stamped, expected - late)
        notes.append(
            f"'{topic.topic}': {np.count_nonzero(~is_given)} of {is_given.size} messages are not stamped; their times are "
            f"{late / _SECOND:.2g} s before their reception, as those of the others are"
        )
    if own is base:
        if not own.is_even:
            notes.append(f"the headers of '{topic.topic}' {own.describe()}; the record goes by them")
        return OnOneClock(stamped, late / _SECOND, tuple(notes))
    if base.is_of_recorder:
        whose, how = "that of the recorder", f"they {own.describe()}"
    else:
        whose, how = f"those of '{base.topic}'", f"the latter {base.describe()}"
    moved = "they were moved onto it, so that the fastest messages take no time"
    notes.append(f"the headers of '{topic.topic}' are from another clock than {whose}: {how}; {moved}")
    return OnOneClock(base.shows(own.moment(stamped)), late / _SECOND, tuple(notes))


def _along(at: Nanoseconds, points: Floats, values: Floats) -> Nanoseconds:
    """Return values [ns] on a line through points [s], with its mean slope beyond its ends, shape of `at` [ns]."""
    seconds = at / _SECOND
    rate = (values[-1] - values[0]) / (points[-1] - points[0])
    beyond = np.minimum(seconds - points[0], 0.0) + np.maximum(seconds - points[-1], 0.0)
    found = np.interp(seconds, points, values) + rate * beyond
    return np.asarray(np.rint(found * _SECOND), dtype=np.int64)


def _longest(topic: Stamps) -> float:
    """Return the time for which fast messages of a topic may travel [s]."""
    steps = np.abs(np.diff(topic.stamped[topic.stamped != 0])) / _SECOND
    return max(_LONGEST, _MOST_UNDER_WAY * float(np.median(steps)))


def _edge(topic: Stamps, expected: Nanoseconds) -> tuple[Floats, Floats]:
    """Return the middle [s] of each stretch of a bag, and how long fast messages took there [s] if a clock is `expected`."""
    given = np.flatnonzero(topic.stamped)
    took = (expected - topic.stamped)[given] / _SECOND
    times = (topic.received - topic.received[given[0]])[given] / _SECOND
    n_stretches = max(1, min(_STRETCHES, given.size // _FEWEST_IN_STRETCH))
    cut = [np.array_split(part, n_stretches) for part in (times, took)]
    return np.array([np.mean(part) for part in cut[0]]), np.array([np.quantile(p, _FAST) for p in cut[1]])


def _is_of(topic: Stamps, clock: _Clock) -> bool:
    """Return True if the messages of a topic can be stamped by a clock."""
    times, took = _edge(topic, clock.shows(topic.received))
    if not clock.is_of_recorder:
        return bool(np.abs(took).max() <= _longest(topic))
    possible = took.min() >= -_SYNCHRONIZED and took.max() <= _longest(topic)
    return bool(possible) and _drift(times, took) == 0.0


def _drift(times: Floats, took: Floats) -> float:
    """Return the slope of the lower edge if it is straight and clearly moves, else 0."""
    if times.size < _FEWEST or np.ptp(times) <= 0.0:
        return 0.0
    slope, start = np.polyfit(times, took, 1)
    scatter = float(np.abs(took - start - slope * times).max())
    moves = abs(float(slope)) * float(np.ptp(times))
    return float(slope) if moves > max(_CLEAR * scatter, _SYNCHRONIZED) else 0.0


def _clock_of(topic: Stamps) -> _Clock:
    """Return the clock by which the messages of a topic are stamped."""
    given = topic.stamped != 0
    received, stamped = topic.received[given], topic.stamped[given]
    origin = int(received[0]), int(stamped[0])
    times, took = _edge(topic, topic.received - origin[0] + origin[1])
    drift = _drift(times, took)
    straight = origin[1] + np.rint((1.0 - drift) * (topic.received - origin[0])).astype(np.int64)
    _, apart = _edge(topic, straight)
    if np.ptp(apart) > _longest(topic) or (abs(drift) > _FASTEST and np.ptp(took) > _LONGEST):
        points = np.sort(received - origin[0]) / _SECOND, np.sort(stamped - origin[1]) / _SECOND
        return _Clock(topic.topic, origin, *points, is_even=False)
    ends = np.array([0.0, max(float(received[-1] - received[0]) / _SECOND, 1.0)])
    return _Clock(topic.topic, origin, ends, (1.0 - drift) * ends - float(apart.min()))

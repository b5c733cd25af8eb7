"""Which channel of time belongs to which other channel of a file that holds several?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from rigsight.records.channel_names import NAMES_OF, closeness, plain_words

TIME = "t"
_NAMED = 2.0
_WORDS_OF_TIME = tuple(sorted(NAMES_OF[TIME], key=len, reverse=True))


def is_time(name: str) -> bool:
    """Return True if a channel is called like time, whatever its group."""
    return closeness(name, TIME) >= _NAMED


def own_clocks(names: Sequence[str]) -> Mapping[int, int]:
    """Return the number of each channel -> the number of the time that is its own, where a file shows that; else without it.

    A file shows it by names (``Time Force`` beside ``Force``), by groups (a time in the group of a channel, or in the nearest one
    around it), or by order (columns of time of one name, each in front of its signals). One time alone belongs to no one in
    particular.

    Parameters
    ----------
    names
        Of all channels, in the order of the file; ``group/channel`` where it has groups.
    """
    times = [number for number, name in enumerate(names) if is_time(name)]
    named = _by_name(names)
    if len(set(times) | set(named.values())) < 2:
        return {}
    clocks = {}
    for number, name in enumerate(names):
        if number in times or number in named.values():
            continue
        own = named.get(number, _nearest(names, times, number, name))
        if own is not None:
            clocks[number] = own
    return clocks


def _by_name(names: Sequence[str]) -> dict[int, int]:
    """Return the times that are called like another channel and a word of time."""
    found: dict[int, int] = {}
    by_words: dict[tuple[str, str], int] = {}
    for number, name in enumerate(names):
        by_words.setdefault(_parts(name), number)
    for number, name in enumerate(names):
        group, words = _parts(name)
        for word in _WORDS_OF_TIME:
            for rest in (words.removeprefix(f"{word} "), words.removesuffix(f" {word}")):
                other = by_words.get((group, rest))
                if rest != words and other is not None and other != number:
                    found.setdefault(other, number)
    return found


def _parts(name: str) -> tuple[str, str]:
    group, _, short = name.rpartition("/")
    return group, plain_words(short)


def _nearest(names: Sequence[str], times: Sequence[int], number: int, name: str) -> int | None:
    """Return the only time in the group of a channel or the nearest around it; of several of one name the one in front."""
    group = name.rpartition("/")[0]
    while True:
        inside = [time for time in times if names[time].rpartition("/")[0] == group]
        if len(inside) == 1:
            return inside[0]
        if inside:
            return _in_front(names, inside, number)
        if not group:
            return None
        group = group.rpartition("/")[0]


def _in_front(names: Sequence[str], times: Sequence[int], number: int) -> int | None:
    called = {_parts(names[time])[1].rstrip("0123456789 ") for time in times}
    apart = all(after - before > 1 for before, after in zip(times, [*times[1:], len(names)], strict=True))
    if len(called) > 1 or not apart or number < times[0]:
        return None
    return max(time for time in times if time < number)


def possible_clocks(
    names: Sequence[str],
    signals: Mapping[str, int],
    given: Mapping[str, int],
    declared: int | None,
) -> dict[str, list[int]]:
    """Return the numbers of the times by which each signal may go, the first that increases is its own.

    Parameters
    ----------
    names
        Of all channels of the file.
    signals
        Signal -> number of its channel.
    given
        Signal -> number of the time that the campaign gives to it alone; it is the only one then.
    declared
        Number of the time that the campaign gives to all; a clock of its own that the file shows comes before it, because signals
        on a foreign clock would be shifted in silence.
    """
    own = own_clocks(names)
    return {
        signal: [given[signal]]
        if signal in given
        else list(dict.fromkeys(one for one in (own.get(number), declared) if one is not None))
        for signal, number in signals.items()
    }


def increases(stamps: NDArray[np.float64]) -> bool:
    """Return True if numbers can be the stamps of a clock, shape (n_samples,)."""
    return stamps.size > 1 and bool(np.all(np.diff(stamps) > 0.0))

"""Guess which channels of a file are the signals of a rig, and which rig it is."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

from rigsight.errors import InputError
from rigsight.records.channel_names import closeness, is_command, may_be_command, may_be_reading, split_unit
from rigsight.records.channel_units import DRIVES, has_si, is_a
from rigsight.records.clocks import increases, is_prefixed_time, own_clocks
from rigsight.records.formats.channel import Channel, as_floats
from rigsight.records.read_record import TIME
from rigsight.records.signals import REFERENCE
from rigsight.rigs import Rig, rotational

_FITTING_UNIT = 0.5
_CLEAR = 2.0
_REGRESSION = ("x", "y")
_MOVING, _TURNING = "x", "angle"
"""The position of one moving mass, and what it is called where it turns."""
_READ = ("t", "x", "angle", "velocity", "acceleration")
"""What sensors show that a rig may be without."""


@dataclass(frozen=True)
class Guess:
    """The guessed channel of a signal."""

    # Signal of the rig and its unit.
    signal: str
    si: str
    channel: Channel | None = None  # the best matching channel; None if none or several match
    unit: str | None = None  # unit of the channel: stated by the file, or else in its name
    is_stated: bool = False  # whether the file itself states the unit, in a place made for it
    candidates: tuple[str, ...] = ()  # names of the channels that match equally well, if there are several
    assumed: str = ""  # the only reason for the guess, where it is not the channel's name

    @property
    def is_clear(self) -> bool:
        """True if the signal has a channel."""
        return self.channel is not None


@dataclass(frozen=True)
class FileGuess:
    """What the channels of a file probably are, for one rig.

    Where signals have clocks of their own, `times` are their names, and `clocks` what a campaign calls those of the
    signals that are known.
    """

    rig: Rig
    time: Guess
    signals: tuple[Guess, ...] = field(default=())
    score: float = 0.0
    reference: Guess = field(default=Guess(REFERENCE, ""))
    clocks: Mapping[str, str] = field(default_factory=dict)
    times: frozenset[str] = frozenset()

    @property
    def open_questions(self) -> int:
        """Number of characteristic signals of the rig without a channel."""
        return sum(not guess.is_clear for guess in self.signals if guess.signal in distinguishing(self.rig))


def distinguishing(rig: Rig) -> tuple[str, ...]:
    """Return the signals that distinguish a rig from others: those of every record on a rig of one motion, else all."""
    outputs = rig.required_outputs or tuple(signal.name for signal in rig.outputs)
    return (*(signal.name for signal in rig.inputs), *outputs)


def guess_file(
    channels: Sequence[Channel], rigs: Iterable[Rig], rising: Channel | None = None, *, is_log: bool = False
) -> FileGuess:
    """Return the rig that matches the channels best, with the channel of each signal."""
    # In the log of a robot commands and readings have groups that are called so.
    rise = [
        number
        for number, channel in enumerate(channels)
        if is_prefixed_time(channel.name) and _rises(channel)
    ]
    own = own_clocks([channel.name for channel in channels], rise)
    times = [channels[number] for number in set(own.values())]
    moves = cache(_moves)
    guesses = [_guess_rig(rig, channels, rising, times, moves, is_log) for rig in rigs]
    found = min(guesses, key=_unlikely)
    other = rotational(found.rig)
    in_units = (
        [found] if other is None else [found, _guess_rig(other, channels, rising, times, moves, is_log)]
    )
    in_units = [replace(one, reference=_guess_reference(one, channels)) for one in in_units]
    in_units = [replace(one, signals=_completed_by_unit(one, channels, times)) for one in in_units]

    def misfit(guess: FileGuess) -> tuple[int, int]:
        units = [(one.unit, one.si) for one in guess.signals if one.unit is not None and has_si(one.si)]
        return guess.open_questions, sum(not is_a(unit, si) for unit, si in units)

    return _with_clocks(min(in_units, key=misfit), channels, own)


def _with_clocks(found: FileGuess, channels: Sequence[Channel], own: Mapping[int, int]) -> FileGuess:
    """Return the guess with the time of each signal, where the file shows that they have several."""
    numbers = {channel.name: number for number, channel in enumerate(channels)}
    clocks = {
        one.signal: channels[own[numbers[one.channel.name]]]
        for one in found.signals
        if one.channel is not None and numbers[one.channel.name] in own
    }
    # A channel that is yet to be filled in has the time of its own as well.
    mapped = [one for one in found.signals if one.channel is not None]
    axes = [c.axis for c in [one.channel for one in mapped if one.channel is not None] or channels]
    if axes and all(axis is not None and axis.load is not None for axis in axes):
        # Beside stamps of the file, reading finds out what is a clock.
        return replace(found, time=Guess(TIME, "s"), times=frozenset(channels[i].name for i in own.values()))
    free = set(range(len(channels))) - own.keys() - set(own.values())
    if not own or len(clocks) < len(mapped) or (not mapped and free):
        return found
    if len(mapped) == len(found.signals) and len({id(clock) for clock in clocks.values()}) == 1:
        clock = next(iter(clocks.values()))
        return replace(found, time=Guess(TIME, "s", clock, _unit_of(clock), clock.unit is not None))
    named = {signal: clock.label for signal, clock in clocks.items()}
    return replace(
        found, time=Guess(TIME, "s"), clocks=named, times=frozenset(channels[i].name for i in own.values())
    )


def _guess_reference(found: FileGuess, channels: Sequence[Channel]) -> Guess:
    """Return a channel that is no signal of the rig and has the name of a controller's reference; its unit is ignored."""
    none = Guess(REFERENCE, "")
    if any(one.signal == REFERENCE for one in found.signals):
        return none
    taken = [one.channel for one in (found.time, *found.signals)]
    called = [c for c in channels if c not in taken and closeness(c.name, REFERENCE) >= _CLEAR]
    return replace(none, channel=called[0]) if len(called) == 1 else none


def _unlikely(guess: FileGuess) -> tuple[int, bool, bool, float, int]:
    """Return the sort key of rigs: one motion before several, then the better and the more specific names."""
    return (
        guess.open_questions,
        not guess.rig.has_one_motion,
        not _is_spoken_of(guess),
        -guess.score,
        -len(guess.signals),
    )


def _is_spoken_of(guess: FileGuess) -> bool:
    """Return False if the only evidence for a rig with a downstream motion are the common names u and y."""
    # The running gear is one, and most files whose output is called y are of something else.
    if guess.rig.follower is None:
        return True
    needed = guess.rig.required_outputs
    outputs = guess.signals[len(guess.rig.inputs) :]
    return any(
        one.channel is not None and (one.signal in needed or len(split_unit(one.channel.short_name)[0]) > 1)
        for one in outputs
    )


def _completed_by_unit(
    found: FileGuess, channels: Sequence[Channel], times: Sequence[Channel]
) -> tuple[Guess, ...]:
    """Return the guesses; a signal without a match takes the only remaining channel with its unit, whatever its name."""
    # The only output without a channel also takes the only remaining channel without a unit; so does the only input, of
    # those that can drive.
    guesses = list(found.signals)

    def free() -> list[Channel]:
        taken = [found.time.channel, found.reference.channel, *times, *(own.channel for own in guesses)]
        return [c for c in channels if c not in taken]

    alone = [c for c in channels if c not in times and c is not found.time.channel]
    if len(alone) == len(found.rig.required_outputs) == 1:
        # Without a reading there is no record: a single channel is that of a motion that nothing drives, whatever its name.
        read = next(own for own in guesses if own.signal in found.rig.required_outputs)
        unit = _unit_of(alone[0])
        if unit is None or not has_si(read.si) or is_a(unit, read.si):
            only = replace(
                _of_channel(read, alone[0]), assumed=read.assumed if read.is_clear else "the only channel"
            )
            guesses = [only if own is read else Guess(own.signal, own.si) for own in guesses]
    for i, guess in enumerate(guesses):
        angles = [c for c in free() if closeness(c.name, _TURNING) >= _CLEAR]
        # One moving mass may turn as well; only once its rig is chosen, because rigs of several motions have angles beside x.
        if found.rig.has_one_motion and guess.signal == _MOVING and not guess.is_clear and len(angles) == 1:
            guesses[i] = _of_channel(guess, angles[0])
    for i, guess in enumerate(guesses):
        if guess.is_clear or guess.candidates:
            continue
        # The input of a drive has the unit of its amplifier.
        units = [guess.si] if has_si(guess.si) else DRIVES
        fitting = [c for c in free() if any(is_a(_unit_of(c) or "", u) for u in units)]
        rivals = [own for own in guesses if not own.is_clear and own.si == guess.si]
        if len(fitting) == len(rivals) == 1:
            guesses[i] = _of_channel(guess, fitting[0])
    needed = (*(signal.name for signal in found.rig.inputs), *found.rig.required_outputs)
    lacking = [i for i, own in enumerate(guesses) if own.signal in needed and own.channel is None]
    if len(lacking) == 1 and not guesses[lacking[0]].candidates:
        own = guesses[lacking[0]]
        is_output = own.signal in found.rig.required_outputs
        remaining = free() if is_output else [c for c in free() if _may_drive(c, own)]
        unit = _unit_of(remaining[0]) if len(remaining) == 1 else None
        if len(remaining) == 1 and (unit is None or not has_si(own.si) or is_a(unit, own.si)):
            absent = "" if is_output else "; or remove this line if nothing drove the rig"
            assumed = f"the only remaining channel{absent}"
            guesses[lacking[0]] = replace(_of_channel(own, remaining[0]), assumed=assumed)
    return tuple(guesses)


def _may_drive(channel: Channel, signal: Guess) -> bool:
    """Return True for a channel that changes, is no counter, and has neither the name of a reading nor another unit."""
    unit = _unit_of(channel)
    fits = unit is None or any(is_a(unit, own) for own in ([signal.si] if has_si(signal.si) else DRIVES))
    is_read = any(closeness(channel.name, called) >= _CLEAR for called in _READ)
    is_possible = fits and not is_read and may_be_command(channel.name, signal.si)
    return is_possible and _moves(channel) and not _rises(channel)


def _of_channel(guess: Guess, channel: Channel) -> Guess:
    return Guess(guess.signal, guess.si, channel, _unit_of(channel), channel.unit is not None)


def _unit_of(channel: Channel) -> str | None:
    return channel.unit or split_unit(channel.name)[1]


def _guess_rig(
    rig: Rig,
    channels: Sequence[Channel],
    rising: Channel | None,
    times: Sequence[Channel],
    moves: Callable[[Channel], bool],
    is_log: bool,
) -> FileGuess:
    time, _ = _guess(TIME, "s", channels, ())
    if rising is not None and not time.is_clear and not time.candidates:
        time = replace(_of_channel(time, rising), assumed="it rises throughout")
    taken = [*times, *([time.channel] if time.channel is not None else [])]
    signals, names = (*rig.inputs, *rig.outputs), _names_of(rig)
    found, score = {}, 0.0
    suited: dict[str, list[Channel]] = {}
    first: dict[str, list[Channel]] = {}
    for signal in signals:
        called, suits = names[signal.name], may_be_command if signal in rig.inputs else may_be_reading
        suited[signal.name] = [
            c for c in channels if not is_log or c.short_name == signal.name or suits(c.name, signal.unit)
        ]
        # What never changes drove nothing, as the efforts of a robot without sensors for them, unless nothing else is called so.
        clear = [c for c in suited[signal.name] if signal in rig.inputs and _closeness(c, called) >= _CLEAR]
        first[signal.name] = [c for c in clear if len(clear) > 1 and moves(c)] or suited[signal.name]
    # Signals with a clear name come first, so that no other signal takes their channel.
    for signal in sorted(
        signals, key=lambda s: -max((_closeness(c, names[s.name]) for c in first[s.name]), default=0.0)
    ):
        for possible in (first[signal.name], suited[signal.name]):
            guess, closest = _guess(signal.name, signal.unit, possible, taken, names[signal.name])
            if guess.is_clear:
                break
        if guess.channel is not None:
            taken.append(guess.channel)
            score += closest
        found[signal.name] = guess
    if is_log:
        found |= _commands_in_order([found[signal.name] for signal in rig.inputs], channels, moves)
    return FileGuess(rig, time, tuple(found[signal.name] for signal in signals), score / len(signals))


def _names_of(rig: Rig) -> dict[str, tuple[str, ...]]:
    """Return the names of each signal: its own, and in logs of robots the quantity of the coordinate that it reads or moves."""
    mechanism = rig.mechanism
    quantities = {c.symbol: f"{c.name} angle" for c in mechanism.coordinates}
    quantities |= {c.rate: f"{c.name} velocity" for c in mechanism.coordinates}
    called = {s.name: quantities[s.reads] for s in mechanism.sensors if s.reads in quantities}
    moved = {c.symbol: f"{c.name} ctrl" for c in mechanism.coordinates}
    for drive in mechanism.drives:
        commands = {symbol.name for symbol in drive.signal.free_symbols} & set(mechanism.inputs)
        if len(commands) == 1 and drive.along in moved:
            called[commands.pop()] = moved[drive.along]
    return {name: (name, called[name]) if name in called else (name,) for name in rig.signal_units}


def _closeness(channel: Channel, names: Sequence[str]) -> float:
    return max(closeness(channel.name, name) for name in names)


def _moves(channel: Channel) -> bool:
    """Return True if a channel takes several finite values."""
    with suppress(InputError):
        samples = as_floats(channel.load())
        samples = samples[np.isfinite(samples)]
        return bool(np.any(samples != samples[:1]))
    return False


def _rises(channel: Channel) -> bool:
    """Return True if a channel increases up to its end, behind which the cells of a text may be blank."""
    with suppress(InputError):
        samples = as_floats(channel.load())
        return increases(samples[: samples.size - int(np.argmax(np.isfinite(samples[::-1])))])
    return False


def _commands_in_order(
    inputs: Sequence[Guess], channels: Sequence[Channel], moves: Callable[[Channel], bool]
) -> dict[str, Guess]:
    """Return the inputs as the entries of the only list of commands without names that has as many; empty if there is none."""
    lists: dict[str, list[Channel]] = {}
    units = {own.si for own in inputs}
    for channel in channels:
        suits = all(may_be_command(channel.name, unit) for unit in units)
        if channel.short_name.isdecimal() and is_command(channel.name) and suits:
            lists.setdefault(channel.group, []).append(channel)
    fitting = [own for own in lists.values() if len(own) == len(inputs)]
    found = [own.channel for own in inputs if own.channel is not None]
    moving = [own for own in fitting if any(map(moves, own))]
    fitting = moving if moving or found else fitting
    if len(fitting) != 1 or any(map(moves, found)):
        return {}
    ordered = sorted(fitting[0], key=lambda channel: int(channel.short_name))
    return {
        own.signal: replace(_of_channel(own, channel), assumed="in the order of the drives")
        for own, channel in zip(inputs, ordered, strict=True)
    }


def _are_of_regression(channels: Sequence[Channel]) -> bool:
    """Return True if a file has X and y and nothing that is called an input: X may be the input, y the output."""
    called = {channel.name for channel in channels}
    has_input = any(closeness(name, "u") >= _CLEAR for name in called)
    return "X" in called and bool(called & {"y", "Y"}) and not has_input


def _guess(
    signal: str, si: str, channels: Sequence[Channel], taken: Sequence[Channel], names: Sequence[str] = ()
) -> tuple[Guess, float]:
    """Return the possible channels of a signal, which may have several names, and how well they match."""
    scores: list[tuple[float, Channel]] = []
    for channel in channels:
        score = 0.0 if channel in taken else _closeness(channel, names or (signal,))
        if score > 0.0:
            unit = _unit_of(channel)
            if unit is not None and has_si(si):
                score += _FITTING_UNIT if is_a(unit, si) else -_FITTING_UNIT
            scores.append((score, channel))
    none = Guess(signal, si)
    if not scores:
        return none, 0.0
    best = max(score for score, _ in scores)
    closest = [channel for score, channel in scores if score == best]
    # With several groups, the time channel is the one in the group of the signals.
    is_one = len(closest) == 1 or (signal == TIME and len({channel.short_name for channel in closest}) == 1)
    if signal in _REGRESSION and _are_of_regression(channels):
        possible = [channel for channel in channels if channel.name.lower() in _REGRESSION]
    elif not is_one or best < _CLEAR - _FITTING_UNIT:
        possible = closest[:1] if is_one else closest
    else:
        return _of_channel(none, closest[0]), best
    return replace(none, candidates=tuple(channel.name for channel in possible)), 0.0

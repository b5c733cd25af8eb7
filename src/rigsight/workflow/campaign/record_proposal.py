"""Draft the entry of a measured file in a campaign, with comments on what was guessed: signals, kind, stretches of motion."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label, maximum_filter1d, minimum_filter1d

from rigsight.errors import InputError
from rigsight.records import Floats, Kind, Role
from rigsight.records.channel_units import UnknownUnitError, factor, has_si, in_drive_unit, is_a
from rigsight.records.clocks import increases, is_time
from rigsight.records.formats.channel import Channel, ChannelFile, as_floats, as_stamps
from rigsight.records.formats.known import LOGS
from rigsight.records.read_record import TIME
from rigsight.records.signals import repeated_period
from rigsight.records.stamps import step_and_gaps
from rigsight.rigs import Rig
from rigsight.workflow.campaign.signal_guesses import FileGuess, Guess, distinguishing, guess_file

# Share of samples that equal the one before: above it the input rests but for a few jumps.
_STANDING = 0.9
_MOST_JUMPS = 50
# A sweep's frequency goes one way: from stretch to stretch, and by at least this ratio in all.
_FEWEST_CROSSINGS = 12
_STRETCHES = 5
_RATIO = 1.5
BLANK = '"FILL IN"'
"""Written where nothing could be guessed; a diagnosis refuses it and names the key."""
_LISTED = 200
_EPISODE = "episode_index"
"""Column that shows a Parquet file to be a LeRobot data set."""
_COARSE = 0.5
"""Sample time [s] from which a comment asks about the unit of time."""
ASSUMED_HOLD = (
    'hold = "foh"  # assumed; "zoh" if a controller holds the input between samples, "band_limited" for a filtered analog '
    "signal: a wrong one looks like a delay of half a sample"
)
SEEN_HOLD = 'hold = "zoh"  # guessed: the input stays and jumps; check'
KNOWN_HOLD = 'hold = "zoh"  # the controller holds each command until the next one'
_REPEATED, _JUMP = 0.25, 0.05
"""Share of samples that equal the one before, and median jump of the others in units of the range, from which an input is held (a
convention)."""
_STEP = 0.02
"""Time step at which channels are compared [s]."""
_PAUSE, _SHORTEST = 1.0, 1.0
"""Shortest pause and shortest motion [s]."""
_LEAD = 1.0
"""Rest in front of and behind a motion that belongs to its record, up to half a pause [s]: it shows the equilibrium, and motions
begin slowly."""
_HELD, _STILL = 1e-3, 1e-2
"""Shares of their ranges that a command and a reading may change in a pause, beside their noise: a joint creeps to its rest."""
_WIDTH = 7.0
"""Width of a band in standard deviations that noise of a pause stays within."""
_MOST_STEPS = 3_000_000
"""Length of a log that is divided: 17 hours."""


@dataclass(frozen=True, eq=False)
class Proposal:
    """A file as a record of a campaign."""

    file: str  # its name, as the campaign is to call it
    guess: FileGuess  # the probable channel of each signal
    lines: tuple[str, ...]  # lines of TOML below ``role``, with what must be checked as comments
    n_blanks: int  # how many values are left to be filled in
    stretches: tuple[tuple[float, float], ...] = ()  # of a log of a robot: those in which it moves [s]
    is_held: bool = False  # whether every input stays and jumps

    @property
    def each_stretch(self) -> tuple[Proposal, ...]:
        """A record for each stretch of motion; the file itself where it is not divided."""
        if not self.stretches:
            return (self,)
        remark = "# [s], one stretch of motion between pauses; check"
        return tuple(
            replace(self, lines=(f"start = {begin:.2f}  {remark}", f"end = {end:.2f}", *self.lines))
            for begin, end in self.stretches
        )

    def toml(self, role: Role, remark: str = "", hold: str = "") -> str:
        """Return the ``[[records]]`` entry, for a role that is explained by a remark, with the line on the hold of the input."""
        head = [
            "[[records]]",
            f"file = {quoted(self.file)}",
            f'role = "{role}"' + (f"  # {remark}" if remark else ""),
        ]
        hold = hold or (SEEN_HOLD if self.is_held else ASSUMED_HOLD)
        held = [hold] if self.guess.rig.inputs else []
        return "\n".join([*head, *held, *self.lines]) + "\n"


def propose(path: Path, file: ChannelFile, rigs: Iterable[Rig]) -> Proposal:
    """Return how an open file is written into a campaign."""
    is_log = file.format in LOGS or any(channel.name == _EPISODE for channel in file.channels)
    guess = guess_file(file.channels, rigs, _rising(file.channels), is_log=is_log)
    no_time = ""
    if guess.time.channel is not None and not _rises(guess.time.channel):
        no_time = f"{quoted(guess.time.channel.name)} does not increase"
        guess = replace(guess, time=replace(guess.time, channel=None))
    # With several inputs, the kind cannot be guessed from one of them.
    driven = guess.signals[0] if len(guess.rig.inputs) == 1 else None
    kind: Kind = "operation"
    amplitude = None
    if driven is not None and driven.channel is not None:
        samples = as_floats(driven.channel.load())
        if samples.size > 1 and np.isfinite(samples).all():
            kind = guess_kind(samples)
            amplitude = guess_amplitude(_in_si(samples, driven), kind)
    remark = "" if driven is None or driven.channel is None else f"guessed from {driven.signal}; check: "
    lines = [f'kind = "{kind}"  # {remark}sweep, step, multisine or operation']
    if driven is not None and amplitude:
        unit = f" [{driven.si}]" if has_si(driven.si) else ""
        lines.append(f"amplitude = {amplitude:g}  # of {driven.signal}{unit}, guessed; check")
    timing, timing_blanks = _timing(guess, file.channels, no_time)
    columns, column_blanks = _columns(guess, file.channels)
    lines += timing
    if columns:
        lines += ["[records.columns]", *columns]
    stretches = tuple(_stretches(guess)) if is_log else ()
    inputs = [one.channel for one in guess.signals[: len(guess.rig.inputs)]]
    is_asked = bool(inputs) and not is_log  # Of a log of a robot the hold is known.
    is_held = is_asked and all(one is not None and _is_held(as_floats(one.load())) for one in inputs)
    return Proposal(path.name, guess, tuple(lines), timing_blanks + column_blanks, stretches, is_held)


def _is_held(samples: Floats) -> bool:
    known = samples[np.isfinite(samples)]
    steps = np.abs(np.diff(known))
    if not np.any(steps) or np.mean(steps == 0.0) < _REPEATED:
        return False
    return bool(np.median(steps[steps > 0.0]) >= _JUMP * np.ptp(known))


def _stretches(guess: FileGuess) -> list[tuple[float, float]]:
    """Return the stretches in which what is known of a robot moves; empty where no command or no reading is known."""
    n_inputs = len(guess.rig.inputs)
    driving, read = (
        [one.channel for one in part if one.channel is not None]
        for part in (guess.signals[:n_inputs], guess.signals[n_inputs:])
    )
    return moving_stretches(driving, read) if driving and read else []


def quoted(text: str) -> str:
    """Return a text as TOML writes it."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _in_si(samples: Floats, guess: Guess) -> Floats:
    if guess.unit is None:
        return samples
    if not has_si(guess.si):
        found = in_drive_unit(guess.unit)
        return samples if found is None else found[0] * samples
    with suppress(UnknownUnitError):
        return factor(guess.unit, guess.si) * samples
    return samples


def _rises(time: Channel) -> bool:
    with suppress(InputError):
        return step_and_gaps(as_stamps(time.load()))[0] is not None
    return False


def _timing(guess: FileGuess, channels: Sequence[Channel], no_time: str) -> tuple[list[str], int]:
    """Return the keys of timing other than the time column, and the number of blanks."""
    found = [one.channel for one in guess.signals if one.channel is not None] or channels
    if guess.time.is_clear or guess.time.candidates or guess.times:
        return [], 0
    if not found or any(channel.axis is None for channel in found):
        why = no_time or "no channel of time was found"
        return [f"dt = {BLANK}  # sample time [s]: {why}"], 1
    return [], 0


def _rising(channels: Sequence[Channel]) -> Channel | None:
    """Return the first channel if it rises throughout; none where a channel is called like time or has its own."""
    if not channels or any(channel.axis is not None or is_time(channel.name) for channel in channels):
        return None
    with suppress(InputError):
        if increases(as_floats(channels[0].load())):
            return channels[0]
    return None


def _columns(guess: FileGuess, channels: Sequence[Channel]) -> tuple[list[str], int]:
    """Return the lines of the columns table, and the number of blanks in them."""
    lines, blanks = [], 0
    needed = _needed(guess)
    remaining = _remaining(guess, channels)
    source = remaining or "no channel remains"
    for one in (guess.time, *guess.signals):
        if one.channel is not None and one.assumed:
            line = _column(one, guess.clocks)
            mark = "; " if "  # " in line else "  # "
            lines.append(f"{line}{mark}guessed: {one.assumed}; check")
        elif one.channel is not None:
            lines += filter(None, [_column(one, guess.clocks)])
        elif one.candidates:
            lines.append(f"{one.signal} = {BLANK}  # {_unit_of(one)}may be: {_listed(one.candidates)}")
            blanks += 1
        elif one.signal in guess.rig.absent_inputs and not remaining:
            lines.append(f"# {one.signal} =    # {_unit_of(one)}not recorded: taken as 0 (no excitation)")
        elif one.signal in needed:
            may_rest = one.signal in guess.rig.absent_inputs
            free = "; or remove this line if nothing drove the rig" if may_rest else ""
            lines.append(f"{one.signal} = {BLANK}  # {_unit_of(one)}{source}{free}")
            blanks += 1
        elif one.signal in distinguishing(guess.rig):
            lines.append(f"# {one.signal} =    # {_unit_of(one)}{source}; or not recorded here")
    reference = guess.reference.channel
    if reference is not None and reference.name != guess.reference.signal:
        lines.append(
            f"{guess.reference.signal} = {quoted(reference.name)}  # reference of the controller; remove this line if it is not"
        )
    return lines, blanks


def _needed(guess: FileGuess) -> set[str]:
    """Return the signals without which a record cannot be used: inputs, the outputs of every record, and one output at all."""
    rig = guess.rig
    needed = {*(signal.name for signal in rig.inputs), *rig.required_outputs}
    outputs = guess.signals[len(rig.inputs) :]
    if not any(one.is_clear or one.candidates for one in outputs):
        needed.add(outputs[0].signal)
    return needed


def _remaining(guess: FileGuess, channels: Sequence[Channel]) -> str:
    """Return the channels that belong to no signal yet; empty if there are none."""
    known = (guess.time, guess.reference, *guess.signals)
    taken = {one.channel.name for one in known if one.channel is not None}
    taken |= guess.times
    # Constants beside the signals, such as the gains of the controller, have another length than the time.
    length = None if guess.time.channel is None else guess.time.channel.n_samples
    free = [c.name for c in channels if c.name not in taken and length in (None, c.n_samples)]
    return f"one of: {_listed(free)}" if free else ""


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - _LISTED} more, see rigsight inspect" if len(names) > _LISTED else ""
    return ", ".join(quoted(name) for name in names[:_LISTED]) + more


def _coarse_step(time: Channel) -> float | None:
    """Return the sample time if it is implausibly large when the values are taken as seconds."""
    with suppress(InputError):
        stamps = as_floats(time.load())
        if stamps.size > 1 and np.isfinite(stamps).all():
            step = float(np.median(np.diff(stamps)))
            return step if step >= _COARSE else None
    return None


def _unit_of(guess: Guess) -> str:
    return f"[{guess.si}], " if has_si(guess.si) else ""


def _column(guess: Guess, clocks: Mapping[str, str]) -> str:
    """Return the line that maps a signal, with its own time where it has one; empty if its channel has the name of the signal."""
    assert guess.channel is not None
    keys = {"name": quoted(guess.channel.short_name if guess.signal == "t" else guess.channel.name)}
    if guess.signal in clocks:
        keys["time"] = quoted(clocks[guess.signal])
    is_other_name, unit, remark = guess.channel.name != guess.signal, guess.unit, ""
    if unit is None:
        if guess.signal == TIME and (step := _coarse_step(guess.channel)):
            remark = f"assumed in s, which gives a sample time of {step:.3g} s; is it in ms? check"
        elif is_other_name and has_si(guess.si):
            remark = f"assumed in {guess.si}; check"
        elif is_other_name:
            remark = "unit unknown, used without conversion; check"
    elif not has_si(guess.si):
        found = in_drive_unit(unit)
        remark = f"in {unit}, used without conversion"
        if found is not None and found[0] != 1.0:
            keys["unit"], remark = quoted(unit), f"converted to {found[1]}; check gain"
    elif not is_a(unit, guess.si):
        keys["scale"] = "1.0"
        remark = f"in {unit}, used without conversion; {guess.signal} should be in {guess.si}: check"
    elif guess.is_stated:
        remark = f"converted from {unit}, as stated in the file" if is_other_name else ""
    elif unit != guess.si:
        keys["unit"] = quoted(unit)
    if not (is_other_name or remark or len(keys) > 1):
        return ""
    table = ", ".join(f"{key} = {value}" for key, value in keys.items())
    value = keys["name"] if len(keys) == 1 else f"{{ {table} }}"
    return f"{guess.signal} = {value}" + (f"  # {remark}" if remark else "")


def guess_kind(samples: Floats) -> Kind:
    """Return the kind of an input of shape (n_samples,): a guess that the user should check."""
    steps = np.diff(samples)
    jumps = int(np.count_nonzero(steps))
    if np.mean(steps == 0.0) > _STANDING and 0 < jumps <= _MOST_JUMPS:
        return "step"
    if _is_sweep(samples):
        return "sweep"
    if repeated_period(samples) is not None:
        return "multisine"
    return "operation"


def guess_amplitude(samples: Floats, kind: Kind) -> float | None:
    """Return the amplitude of an input, in its unit; None for operation, which has none."""
    if kind == "operation":
        return None
    size = float(np.max(np.abs(samples - samples[0]))) if kind == "step" else 0.5 * float(np.ptp(samples))
    return float(f"{size:.3g}")


def _is_sweep(samples: Floats) -> bool:
    """Return True if zero crossings become ever denser, or ever rarer."""
    centered = samples - 0.5 * (samples.min() + samples.max())
    where = np.flatnonzero(np.abs(centered) > 0.05 * np.max(np.abs(centered)))
    signs = np.sign(centered[where])
    crossings = where[1:][signs[1:] != signs[:-1]]
    if crossings.size < _FEWEST_CROSSINGS:
        return False
    distances = [float(part.mean()) for part in np.array_split(np.diff(crossings), _STRETCHES)]
    rising = np.diff(distances) > 0.0
    ratio = max(distances[0], distances[-1]) / min(distances[0], distances[-1])
    return bool((rising.all() or not rising.any()) and ratio > _RATIO)


def moving_stretches(commands: Sequence[Channel], readings: Sequence[Channel]) -> list[tuple[float, float]]:
    """Return begin and end of each stretch of motion [s], by the time of the file; empty with fewer than two."""
    each = [(channel, _HELD) for channel in commands] + [(channel, _STILL) for channel in readings]
    series = [(*one, still) for channel, still in each if (one := _series(channel)) is not None]
    if not series:
        return []
    begin = max(float(stamps[0]) for stamps, _, _ in series)
    end = min(float(stamps[-1]) for stamps, _, _ in series)
    if not 2.0 * _SHORTEST + _PAUSE < end - begin < _STEP * _MOST_STEPS:
        return []
    grid = np.arange(begin, end, _STEP)
    resting = np.ones(grid.size, dtype=bool)
    for stamps, samples, still in series:
        band = _WIDTH * _noise(samples) + still * float(np.ptp(samples))
        resting &= _resting(np.interp(grid, stamps, samples), band)
    numbered, count = label(~resting)
    places = [np.flatnonzero(numbered == number + 1) for number in range(count)]
    moved = [(float(grid[own[0]]), float(grid[own[-1]])) for own in places if own.size * _STEP >= _SHORTEST]
    if len(moved) < 2:
        return []
    halfway = [(last + first) / 2.0 for (_, last), (first, _) in pairwise(moved)]
    return [
        (max(first - _LEAD, before), min(last + _LEAD, behind))
        for (first, last), before, behind in zip(moved, [begin, *halfway], [*halfway, end], strict=True)
    ]


def _series(channel: Channel) -> tuple[Floats, Floats] | None:
    """Return time [s] and samples of a channel that has a time of its own; None for any other."""
    if channel.axis is None or channel.n_samples < 2:
        return None
    samples, stamps = as_floats(channel.load()), channel.axis.stamps() * factor(channel.axis.unit, "s")
    usable = np.isfinite(samples) & np.isfinite(stamps)
    samples, stamps = samples[usable], stamps[usable]
    ordered = stamps.size > 1 and bool(np.all(np.diff(stamps) >= 0.0))
    return (stamps, samples) if ordered else None


def _noise(samples: Floats) -> float:
    """Return the standard deviation of white noise, which is all that most second differences show."""
    bends = np.diff(samples, 2)
    return float(np.median(np.abs(bends))) / 0.6745 / np.sqrt(6.0) if bends.size else 0.0


def _resting(samples: Floats, band: float) -> NDArray[np.bool_]:
    """Return where samples stay within a band for the length of a pause, shape (n_samples,)."""
    width = round(_PAUSE / _STEP)
    span = maximum_filter1d(samples, width) - minimum_filter1d(samples, width)
    return np.asarray(maximum_filter1d((span <= band).astype(np.uint8), width), dtype=bool)

"""What does it mean if a parameter is not the same everywhere? Pattern -> likely cause -> next experiment.

Causes are likely, not proven: the table gives the most frequent reason why a parameter of a wrong or incomplete model differs in
this way.

References
----------
A. Gelb and W. E. Vander Velde, *Multiple-Input Describing Functions and Nonlinear System Design* (McGraw-Hill 1968): equivalent
stiffness and damping of nonlinear laws as functions of the amplitude. Coulomb friction acts as a damping 4 T_c / (pi omega A),
quadratic damping as one that grows with omega A, a clearance g as a spring that is absent below g.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from rigsight.diagnose.policy import TRUST
from rigsight.identify.fit.windows import leading_output
from rigsight.records.record import Record
from rigsight.rigs import Rig


class Pattern(StrEnum):
    """Pattern in which a parameter differs."""

    STABLE = "stable"
    AMPLITUDE = "with amplitude"
    CONSTANT = "with a constant"
    TIME = "with time"
    RECORD = "between records"
    PORTION = "along the record"
    WINDOW = "with window length"
    UNKNOWN = "not known"
    """By itself the number is determined by no two groups that could be compared."""


class Role(StrEnum):
    """Role of a parameter in the equations."""

    DAMPING = "damping"
    STIFFNESS = "stiffness"
    MASS = "mass"
    DRIVE = "drive"
    OFFSET = "offset"
    EFFECT = "effect"
    OTHER = "other"


@dataclass(frozen=True)
class Meaning:
    """Likely meaning of a pattern."""

    cause: str  # likely cause, a main clause without a full stop
    experiment: str  # the experiment that would decide, a sentence


_LADDER = "Record the same input at three amplitudes or more, each twice."
_REPEAT = "Record the first input again at the end, and write down temperature, supply and load."

_MEANINGS: Mapping[tuple[Pattern, Role | None, int | None], Meaning] = {
    # Its share of the damping is 4 T_c / (pi omega A).
    (Pattern.AMPLITUDE, Role.DAMPING, -1): Meaning(
        "damping depends on the motion: dry friction is missing, or has another form", _LADDER
    ),
    (Pattern.AMPLITUDE, Role.DAMPING, 1): Meaning(
        "damping depends on the motion: damping that grows with speed or displacement is missing, or has another form",
        _LADDER,
    ),
    # In the sliding range the spring of a hysteresis or of presliding friction slips.
    (Pattern.AMPLITUDE, Role.STIFFNESS, -1): Meaning(
        "stiffness depends on the motion: a softening spring, hysteresis or presliding friction is missing, or has another form",
        _LADDER,
    ),
    # Within a clearance the spring does not act on small motions.
    (Pattern.AMPLITUDE, Role.STIFFNESS, 1): Meaning(
        "stiffness depends on the motion: a hardening spring, an end stop or free play is missing, or has another form",
        _LADDER,
    ),
    (Pattern.AMPLITUDE, Role.DRIVE, -1): Meaning(
        "the output of the drive grows less than its input: a saturation is missing, or has another form",
        "Record steps of the input up to its largest value.",
    ),
    (Pattern.AMPLITUDE, Role.DRIVE, 1): Meaning(
        "the output of the drive grows more than its input: a dead zone or dry friction is missing, or has another form",
        "Record slow steps of the input, starting from its smallest value.",
    ),
    (Pattern.AMPLITUDE, Role.EFFECT, None): Meaning(
        "the equation of the effect does not quite fit the rig: it depends on amplitude in another way",
        _LADDER,
    ),
    # A mass does not depend on the amplitude: it compensates for a law that does.
    (Pattern.AMPLITUDE, None, None): Meaning(
        "it compensates for an effect that depends on the motion and is missing or has another form", _LADDER
    ),
    # A load increases friction: the constant acts at a place where the equations do not contain it.
    (Pattern.CONSTANT, Role.DAMPING, None): Meaning(
        "friction depends on it, like the friction of a loaded joint, which the equations do not include",
        "Record three values of it with the same input.",
    ),
    (Pattern.CONSTANT, Role.EFFECT, None): Meaning(
        "the effect depends on it, like the friction of a loaded joint, which its equation does not include",
        "Record three values of it with the same input.",
    ),
    (Pattern.CONSTANT, None, None): Meaning(
        "the equations have it in the wrong place, or its stated values are wrong",
        "Measure it, and record three values of it with the same input.",
    ),
    (Pattern.TIME, Role.OFFSET, None): Meaning("a zero drifts from record to record", _REPEAT),
    (Pattern.TIME, None, None): Meaning(
        "something unrecorded changes slowly, such as temperature or wear, if the records were made in this order",
        _REPEAT,
    ),
    (Pattern.RECORD, Role.OFFSET, None): Meaning(
        "the zero of a sensor or a constant load differs from record to record",
        'Write offsets = "per_record" in campaign.toml, or record a rest before each run.',
    ),
    (Pattern.RECORD, None, None): Meaning(
        "something unrecorded changes, such as temperature, load or mounting",
        "Record one input several times without touching the rig, then again after remounting it.",
    ),
    # Along a sweep frequency changes with time, along a decay amplitude does.
    (Pattern.PORTION, None, None): Meaning(
        "it depends on what changes along a record: the frequency of a sweep, the amplitude of a decay, or warming up",
        "Record the same input reversed in time: a dependence on time stays, a dependence on frequency reverses.",
    ),
    # A window's own initial state takes up what is slow.
    (Pattern.WINDOW, None, None): Meaning(
        "in long records it absorbs slow errors of the model: a drift, a disturbance or a slow effect is missing",
        "Trust the value from short windows, and record the slow part separately: very slow motion, or rest after a step.",
    ),
}


def meaning(pattern: Pattern, role: Role, direction: int) -> Meaning | None:
    """Return the likely meaning of a pattern, from the most specific entry; None where nothing differs."""
    for known_role, known_direction in ((role, direction), (role, None), (None, None)):
        found = _MEANINGS.get((pattern, known_role, known_direction))
        if found is not None:
            return found
    return None


def roles(rig: Rig, effects: Iterable[str]) -> dict[str, Role]:
    """Return the role of each parameter in the equations."""
    found: dict[str, Role] = {}
    mechanism = rig.mechanism
    for drive in mechanism.drives:
        found |= dict.fromkeys((symbol.name for symbol in drive.signal.free_symbols), Role.DRIVE)
    found |= dict.fromkeys((symbol.name for symbol in mechanism.kinetic.free_symbols), Role.MASS)
    for joint in mechanism.joints:
        found |= dict.fromkeys((symbol.name for symbol in joint.stiffness.free_symbols), Role.STIFFNESS)
        found |= dict.fromkeys((symbol.name for symbol in joint.damping.free_symbols), Role.DAMPING)
    if rig.has_one_motion:
        resting = rig.motion.rest.free_symbols | rig.motion.bias.free_symbols
        found |= dict.fromkeys((symbol.name for symbol in resting), Role.OFFSET)
    named = {p.name: found.get(p.name, Role.OTHER) for p in rig.parameters}
    return named | dict.fromkeys(effects, Role.EFFECT)


@dataclass(frozen=True)
class Order:
    """A quantity by which records differ."""

    pattern: Pattern  # pattern of a parameter that changes with it
    name: str  # in words, such as ``"amplitude"`` or the name of a constant
    unit: str  # of the quantity; empty for a plain number
    levels: Mapping[str, float]  # its value by the name of the record


def orders(rig: Rig, records: Sequence[Record], constants: Mapping[str, float]) -> tuple[Order, ...]:
    """Return the quantities by which records differ; set values first, the order of the records last."""
    found = []
    units = {p.name: _reported(p.unit) for p in rig.constants}
    for name in dict.fromkeys(name for record in records for name in record.constants):
        levels = {r.name: r.constants.get(name, constants.get(name, np.nan)) for r in records}
        if len(set(levels.values())) > 1 and all(map(np.isfinite, levels.values())):
            found.append(Order(Pattern.CONSTANT, name, units.get(name, ""), levels))
    amplitude = _amplitudes(rig, records)
    if len(set(amplitude.levels.values())) > 1:
        found.append(amplitude)
    if len(records) >= TRUST.fewest_in_time:
        found.append(Order(Pattern.TIME, "time", "", {r.name: float(i) for i, r in enumerate(records)}))
    return tuple(found)


def _amplitudes(rig: Rig, records: Sequence[Record]) -> Order:
    """Return the stated amplitude of each record if all have one, else the measured one, grouped in levels."""
    moving = [s for s in rig.inputs if all(s.name in r and np.ptp(r[s.name]) > 0.0 for r in records)]
    # A free motion has no amplitude but its own.
    outputs = {signal.name: signal for signal in rig.outputs}
    signal = moving[0] if moving else outputs[leading_output(rig, records)]
    stated = [record.amplitude for record in records]
    known = [amplitude for amplitude in stated if amplitude is not None]
    if moving and len(known) == len(records):
        levels = dict(zip((r.name for r in records), map(float, known), strict=True))
        return Order(Pattern.AMPLITUDE, "amplitude", _reported(signal.unit), levels)
    sizes = {r.name: float(np.sqrt(2.0) * np.std(r[signal.name])) for r in records if signal.name in r}
    if len(sizes) < len(records):
        return Order(Pattern.AMPLITUDE, "amplitude", _reported(signal.unit), {})
    level, measured = 0.0, {}
    for name, size in sorted(sizes.items(), key=lambda item: item[1]):
        level = level if size <= TRUST.one_level * level else size
        measured[name] = level
    return Order(Pattern.AMPLITUDE, "amplitude", _reported(signal.unit), measured)


def _reported(unit: str) -> str:
    """Return a unit as written behind a number; the unit of an axis' input is called "input"."""
    return "" if unit in ("input", "1") else unit

"""Is what a model leaves noise and disturbance, or does it still go with motion, drive, reading, time or record?

What is left is compared with the answers of the model's own readings to small pushes that go with one of these: a force that
depends on a joint's velocity or position, a drive that is another function of its signal, a number that changes with time or
from record to record. Noise and disturbance agree with such an answer in one stretch of a record as often as they contradict it
in the next, so that the signs of what is left may be turned stretch by stretch: how often chance agrees as well is the p-value.
What is compared is what is new at each sample (`innovations.py`), as a disturbance hangs together for as long as a rig swings,
and pushes go with the motion that the equations have, as the measured one goes with the disturbance itself. No floor of the
noise is needed, and noise may be colored and of changing size. Whether that size goes with the motion can be asked beside it: an
effect that no push resembles, such as a pulsating stiffness, leaves more where there is more motion; a sensor's noise does not.

References
----------
E. Flachaire, Comput. Stat. Data Anal. 49 (2005) 361, for turning signs (the wild bootstrap with Rademacher weights).
R. De Santis, J. J. Goeman, J. Hemerik, S. Davenport and L. Finos, J. Am. Stat. Assoc. (2025), doi 10.1080/01621459.2025.2491775,
for turned signs beside fitted numbers.
P. H. Westfall and S. S. Young, *Resampling-Based Multiple Testing* (Wiley 1993), for the smallest of several p-values.
T. S. Breusch and A. R. Pagan, Econometrica 47 (1979) 1287, for what the size of a remainder goes with; here by ranks.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import spearmanr

from rigsight.diagnose.innovations import Innovations
from rigsight.diagnose.places.answers import Answers, Followed, orthonormal
from rigsight.diagnose.places.probes import motion_columns, signal_columns
from rigsight.diagnose.workbench import Scored, Workbench
from rigsight.effects import Effect, Place
from rigsight.effects import symbols as canonical
from rigsight.units import characteristic_value

Floats = NDArray[np.float64]

BY_RECORD = "record: "
"""Before what differs from record to record."""
SIGNIFICANCE = 0.01
"""p-value below which a model is not adequate: one adequate model of a hundred is refused."""
AGAINST_A_FLOOR = 0.1
"""The same for a model that leaves more than a measured floor allows: that floor speaks against it already."""
_TURNS = 9999
_PORTIONS = 10
"""Turns are counted a tenth at a time, so that they need no more than some ten megabytes."""
_SINGULAR = 1e-9
"""Keeps a turn that parameters could follow whole from a division by zero."""
_STRETCHES = 64
"""Stretches of all records together whose signs are turned: so many that a number which differs in one record shows, and so few
that what a disturbance does to a sliding or sticking mass hardly reaches from one into the next (`experiments/adequacy`)."""
_LONG_STRETCHES = 32
"""Stretches over which a remainder must be spread: noise alone is of about the same size in each."""
_LEAST_SPREAD = 0.25
"""Share of the stretches over which a remainder must be spread, as their number that would hold its power evenly. Noise is spread
over nearly all; what stands in a few of them agrees with anything there by one turn in two, so that no p-value can tell."""
_KNOTS = (0.02, 0.15, 0.35, 0.5, 0.65, 0.85, 0.98)
"""Quantiles of a signal at which the corners of a piecewise linear function of it stand."""
_PUSH = 1e-3
"""Size of a push in units of the typical force, signal or reading at its place: the answer is proportional."""
_TIMES = 4
_TOO_FAST = "motion that is too fast for the sample time"
"""What a model is blamed for whose steps between samples cannot be as short as its motion needs: nothing can be compared."""


@dataclass(frozen=True)
class Agreement:
    """How what a model leaves goes with one thing.

    Attributes
    ----------
    what
        In words, such as ``"velocity of load_bearing"``.
    place
        Joint, drive or sensor; empty for what has no place.
    p_value
        Probability of such an agreement by chance, this one thing looked at alone.
    share
        Share of the squared remainder that goes with it beyond chance.
    """

    what: str
    place: str
    p_value: float
    share: float


@dataclass(frozen=True)
class Adequacy:
    """Is what a model leaves noise and disturbance?

    Attributes
    ----------
    p_value
        Probability that noise and disturbance alone agree as well with anything that was looked at.
    agreements
        With what it goes: what chance hardly makes first, of that the largest share.
    is_spread
        False where it stands in a few stretches of the records, as noise does not.
    significance
        p-value below which it is not adequate.
    """

    p_value: float
    agreements: tuple[Agreement, ...]
    is_spread: bool = True
    significance: float = SIGNIFICANCE

    @property
    def adequate(self) -> bool:
        """True where nothing contradicts that noise and disturbance are all that is left."""
        return self.is_spread and self.p_value >= self.significance

    @property
    def goes_with(self) -> str:
        """With what the largest part of it goes; empty where it is adequate."""
        if self.adequate:
            return ""
        if self.p_value >= self.significance:
            return "a few stretches of the records"
        return self.agreements[0].what

    @property
    def place(self) -> str:
        """Joint, drive or sensor of what it goes with; empty where that has none."""
        return "" if self.p_value >= self.significance else self.agreements[0].place


def adequacy(
    bench: Workbench,
    model: Scored,
    rng: np.random.Generator,
    significance: float = SIGNIFICANCE,
    of_steady_size: bool = False,
) -> Adequacy:
    """Say whether what a model leaves of all records goes with anything.

    Those that were fitted too: their other amplitudes show a law that has not quite the right form. Numbers that the fit bent to
    hide it move with the answers, so that they hide nothing here.

    Parameters
    ----------
    bench
        Records, scales and noise.
    model
        Fitted and scored.
    rng
        Source of the turned signs.
    significance
        p-value below which it is not adequate.
    of_steady_size
        Whether noise and disturbance are to be as large where nothing moves.
    """
    records = bench.records
    answers = Answers(bench, records, bench.on_all_records(model), model.effects, model.fit.free)
    if not answers.can_be_compared:
        return Adequacy(0.0, (Agreement(_TOO_FAST, "", 0.0, 1.0),), significance=significance)
    innovations = Innovations(answers)
    seen_left, new = answers.seen_left, innovations.without_free(innovations.of(answers.seen_left))
    stretches = _stretches(answers, _STRETCHES)
    signs = rng.choice([-1.0, 1.0], size=(_TURNS, len(stretches)))
    found: list[tuple[Agreement, _Turned]] = []
    for what, place, columns in _things(answers):
        fresh = innovations.without_free(innovations.of(columns))
        told = _turned(fresh, new, stretches, signs, innovations.followed)
        if told is None:
            continue
        # How large it is counts in the readings themselves; what is new in them says only whether it is there.
        seen = _turned(answers.without_free(columns), seen_left, stretches, signs)
        share = (
            0.0 if seen is None else max(0.0, seen.reached - seen.mean) / float(answers.left @ answers.left)
        )
        found.append((Agreement(what, place, told.p_value, share), told))
    grown = _growth(answers, stretches) if of_steady_size else None
    agreements = [agreement for agreement, _ in found] + ([grown] if grown is not None else [])
    p_values = [_smallest([told for _, told in found])] if found else [1.0]
    p_values += [grown.p_value] if grown is not None else []
    ordered = tuple(sorted(agreements, key=lambda a: (a.p_value >= significance, -a.share)))
    return Adequacy(min(p_values), ordered, _is_spread(answers), significance)


@dataclass(frozen=True)
class _Turned:
    """How much of what is left goes with some columns, and how much where the signs of its stretches are turned."""

    reached: float
    by_chance: Floats

    @property
    def mean(self) -> float:
        return float(np.mean(self.by_chance))

    @property
    def p_value(self) -> float:
        return float((1.0 + np.sum(self.by_chance >= self.reached)) / (1.0 + self.by_chance.size))


def _turned(
    columns: Floats, left: Floats, stretches: Sequence[slice], signs: Floats, followed: Followed | None = None
) -> _Turned | None:
    """Return how much goes with columns that no parameter follows; None if there are none.

    What parameters and initial states took of what is left is missing from it once signs are turned, so that chance would seem
    smaller than it is: with `followed` each turn counts in units of what it then expects.
    """
    basis = orthonormal(columns)
    if basis.shape[1] == 0:
        return None
    # Their sum is that of what no parameter follows; each alone is whole, as chance would have it.
    along = np.array([left[part] @ basis[part] for part in stretches])
    turned = signs @ along
    sizes = np.sum(turned**2, axis=1)
    if followed is not None:
        shared = followed.along(basis, stretches)
        for some in np.array_split(np.arange(len(signs)), _PORTIONS):
            taken = np.tensordot(signs[some], shared, axes=1)
            expected = (1.0 + _SINGULAR) * np.eye(basis.shape[1]) - taken @ taken.transpose(0, 2, 1)
            whole = np.linalg.solve(expected, turned[some, :, None])[:, :, 0]
            sizes[some] = np.einsum("ij,ij->i", turned[some], whole)
    return _Turned(float(np.sum(np.sum(along, axis=0) ** 2)), sizes)


def _smallest(found: Sequence[_Turned]) -> float:
    """Return the probability that chance makes any of several p-values as small as the smallest one here."""
    table = np.array([told.by_chance for told in found])
    ranks = (table.shape[1] - np.argsort(np.argsort(table, axis=1), axis=1)) / (1.0 + table.shape[1])
    seen = min(told.p_value for told in found)
    by_chance = np.min(ranks, axis=0)
    return float((1.0 + np.sum(by_chance <= seen)) / (1.0 + by_chance.size))


def _is_spread(answers: Answers) -> bool:
    stretches = _stretches(answers, _LONG_STRETCHES)
    powers = np.array([float(np.mean(answers.seen_left[part] ** 2)) for part in stretches])
    return float(np.sum(powers)) ** 2 / float(np.sum(powers**2)) >= _LEAST_SPREAD * len(stretches)


def _growth(answers: Answers, stretches: Sequence[slice]) -> Agreement | None:
    """Return how the size of what is left goes with how much moves: with what of several chance explains least."""
    left = [float(np.mean(answers.seen_left[part] ** 2)) for part in stretches]
    rig = answers.bench.rig
    moving: list[tuple[str, str, Sequence[Floats]]] = []
    for joint in motion_columns(rig):
        moving.append((f"how far {joint} moves", joint, answers.simulated(joint)))
        moving.append((f"how fast {joint} moves", joint, _slopes(answers, joint)))
    for drive in signal_columns(rig):
        moving.append((f"how much {drive} drives", drive, answers.simulated(drive)))
    told = [
        (float(spearmanr(left, powers, alternative="greater").pvalue), what, place)
        for what, place, signals in moving
        if np.ptp(powers := _powers(answers, signals, stretches)) > 0.0
    ]
    if not told:
        return None
    p_value, what, place = min(told)
    return Agreement(what, place, min(1.0, len(told) * p_value), 1.0)


def _powers(answers: Answers, signals: Sequence[Floats], stretches: Sequence[slice]) -> list[float]:
    """Return the mean square of a signal, counted from its median, in each stretch of the stacked readings."""
    n_outputs, middle = len(answers.bench.rig.outputs), float(np.median(np.concatenate(signals)))
    stacked = np.concatenate([np.repeat((signal - middle) ** 2, n_outputs) for signal in signals])
    return [float(np.mean(stacked[part])) for part in stretches]


def _stretches(answers: Answers, most: int) -> list[slice]:
    """Return stretches of about equal length that cover all records, none of which reaches from one record into the next."""
    length = max(1.0, answers.spans[-1].stop / most)
    found = []
    for part in answers.spans:
        count = max(1, round((part.stop - part.start) / length))
        edges = np.linspace(part.start, part.stop, count + 1).astype(int)
        found += [slice(int(a), int(b)) for a, b in itertools.pairwise(edges)]
    return found


def law_columns(answers: Answers, effect: Effect) -> Floats:
    """Return what any other law of the signals that an effect reads would change, at its place; shape (n, n_columns).

    Parameters
    ----------
    answers
        Of the equations with the effect.
    effect
        Any.
    """
    place = answers.bench.rig.acts_at(effect)
    if effect.place in (Place.SENSOR, Place.ACTUATOR):
        # What is limited or dead at once is no other form of what comes late, nor the other way round.
        is_late = bool(effect.states) or effect.delay is not None or effect.measured_late is not None
        if effect.place is Place.SENSOR:
            return (_changes_of if is_late else _readings_of)(answers, place)
        return (_signal_changes_of if is_late else _signals_of)(answers, place)
    laws = [law for law in (effect.torque, effect.spring, effect.deflection) if law is not None]
    read = {symbol for law in laws for symbol in law.free_symbols}
    found = []
    if canonical.v in read or effect.states:
        found.append(_velocities_of(answers, place))
    if canonical.v not in read or effect.states:
        found.append(_positions_of(answers, place))
    return np.column_stack(found)


def _things(answers: Answers) -> Iterator[tuple[str, str, Floats]]:
    """Yield what a remainder may go with, in words, with the place and the answers of all readings, shape (n, n_columns)."""
    rig = answers.bench.rig
    for joint in motion_columns(rig):
        yield f"velocity of {joint}", joint, _velocities_of(answers, joint)
        yield f"position of {joint}", joint, _positions_of(answers, joint)
        yield f"time, at {joint}", joint, _pushes(answers, joint, _course(answers), _force(answers, joint))
    for drive in signal_columns(rig):
        yield f"signal of {drive}", drive, _signals_of(answers, drive)
        yield f"change of {drive}", drive, _signal_changes_of(answers, drive)
        yield f"time, at {drive}", drive, _fading_of(answers, drive)
    for sensor in (s.name for s in rig.outputs):
        yield f"reading of {sensor}", sensor, _readings_of(answers, sensor)
        yield f"change of {sensor}", sensor, _changes_of(answers, sensor)
    if len(answers.records) > 1:
        for name in answers.free:
            yield f"{BY_RECORD}{name}", "", _by_record(answers, answers.to_parameter(name))
        for sensor in (s.name for s in rig.outputs):
            ones = [np.ones(r.n_samples) for r in answers.records]
            yield (
                f"{BY_RECORD}offset of {sensor}",
                sensor,
                _by_record(answers, _reading(answers, sensor, ones)),
            )


def _force(answers: Answers, joint: str) -> float:
    return _PUSH * characteristic_value(f"force@{joint}", answers.scales)


def _signal(answers: Answers, drive: str) -> float:
    return _PUSH * characteristic_value(f"input@{drive}", answers.scales)


def _slopes(answers: Answers, place: str) -> list[Floats]:
    return [np.gradient(s, r.dt) for s, r in zip(answers.simulated(place), answers.records, strict=True)]


def _velocities_of(answers: Answers, joint: str) -> Floats:
    return _pushes(answers, joint, _corners(_slopes(answers, joint)), _force(answers, joint))


def _positions_of(answers: Answers, joint: str) -> Floats:
    return _pushes(answers, joint, _corners(answers.simulated(joint)), _force(answers, joint))


def _signals_of(answers: Answers, drive: str) -> Floats:
    return _pushes(answers, drive, _corners(answers.simulated(drive)), _signal(answers, drive))


def _signal_changes_of(answers: Answers, drive: str) -> Floats:
    return _pushes(answers, drive, _corners(_slopes(answers, drive)), _signal(answers, drive))


def _fading_of(answers: Answers, drive: str) -> Floats:
    """Return what a drive whose strength changes slowly over each record would change."""
    size = characteristic_value(f"input@{drive}", answers.scales)
    faded = [
        [c * s / size for c, s in zip(course, answers.simulated(drive), strict=True)]
        for course in _course(answers)
    ]
    return _pushes(answers, drive, faded, _signal(answers, drive))


def _readings_of(answers: Answers, sensor: str) -> Floats:
    return _shown(answers, sensor, _corners(answers.simulated(sensor)))


def _changes_of(answers: Answers, sensor: str) -> Floats:
    return _shown(answers, sensor, _corners(_slopes(answers, sensor)))


def _corners(signals: Sequence[Floats]) -> list[list[Floats]]:
    """Return the ramps of a piecewise linear function of a signal, for each record."""
    everything = np.concatenate(signals)
    knots = np.unique(np.quantile(everything, _KNOTS))
    scale = float(np.std(everything)) or 1.0
    return [[np.maximum(s - knot, 0.0) / scale for s in signals] for knot in knots]


def _course(answers: Answers) -> list[list[Floats]]:
    """Return slow changes over each record."""
    times = [np.linspace(0.0, np.pi, record.n_samples) for record in answers.records]
    return [[np.cos(n * t) for t in times] for n in range(1, _TIMES + 1)]


def _pushes(answers: Answers, place: str, signals: Sequence[list[Floats]], size: float) -> Floats:
    return np.column_stack([answers.to_push(place, signal, size) for signal in signals])


def _shown(answers: Answers, sensor: str, signals: Sequence[list[Floats]]) -> Floats:
    return np.column_stack([answers.stacked(_reading(answers, sensor, signal)) for signal in signals])


def _reading(answers: Answers, sensor: str, signals: Sequence[Floats]) -> list[Floats]:
    names = [s.name for s in answers.bench.rig.outputs]
    found = []
    for signal in signals:
        part = np.zeros((signal.size, len(names)))
        part[:, names.index(sensor)] = signal
        found.append(part)
    return found


def _by_record(answers: Answers, parts: Sequence[Floats]) -> Floats:
    whole = answers.stacked(parts)
    columns = np.zeros((whole.size, len(parts)))
    for index, part in enumerate(answers.spans):
        columns[part, index] = whole[part]
    return columns

"""Is what a model leaves noise and disturbance, or does it still go with motion, drive, reading, time or record?

What is left is compared with the answers of the model's own readings to small pushes that go with one of these: a force that
depends on a joint's velocity or position, a drive that is another function of its signal, a number that changes with time or
from record to record. Noise and disturbance agree with such an answer in one stretch of a record as often as they contradict it
in the next, so that the signs of what is left may be turned stretch by stretch: how often chance agrees as well is the p-value.
No floor of the noise is needed, and noise may be colored and of changing size.

References
----------
E. Flachaire, Comput. Stat. Data Anal. 49 (2005) 361, for turning signs (the wild bootstrap with Rademacher weights).
P. H. Westfall and S. S. Young, *Resampling-Based Multiple Testing* (Wiley 1993), for the smallest of several p-values.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigsight.diagnose.places.answers import Answers, orthonormal
from rigsight.diagnose.places.probes import motion_columns, signal_columns
from rigsight.diagnose.workbench import Scored, Workbench
from rigsight.effects import Effect, Place
from rigsight.effects import symbols as canonical
from rigsight.units import characteristic_value

Floats = NDArray[np.float64]

SIGNIFICANCE = 0.01
"""p-value below which a model is not adequate: one adequate model of a hundred is refused."""
AGAINST_A_FLOOR = 0.1
"""The same for a model that leaves more than a measured floor allows: that floor speaks against it already."""
_TURNS = 9999
_STRETCHES = 32
"""Stretches of all records together whose signs are turned: as long as can be, so that neighbors hang together little, and so
many that a number which differs in one record shows. On 33 true models of the blind bench (seed 9) p-values were uniform with 16
and with 32 of them, and too small with 64 and more (`experiments/adequacy`)."""
_LEAST_SPREAD = 0.25
"""Share of the stretches over which a remainder must be spread, as their number that would hold its power evenly. Noise is spread
over nearly all; what stands in a few of them agrees with anything there by one turn in two, so that no p-value can tell."""
_KNOTS = (0.02, 0.15, 0.35, 0.5, 0.65, 0.85, 0.98)
"""Quantiles of a signal at which the corners of a piecewise linear function of it stand."""
_PUSH = 1e-3
"""Size of a push in units of the typical force, signal or reading at its place: the answer is proportional."""
_TIMES = 4


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
        With what it goes, the largest share first.
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
    bench: Workbench, model: Scored, rng: np.random.Generator, significance: float = SIGNIFICANCE
) -> Adequacy:
    """Say whether what a model leaves of the records that score it goes with anything.

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
    """
    fit = bench.problem(model.fit.structure, bench.scoring).fit(model.fit.values, [])
    answers = Answers(bench, bench.scoring, fit, model.effects, model.fit.free)
    left, seen = answers.left, answers.seen_left
    stretches = _stretches(answers)
    signs = rng.choice([-1.0, 1.0], size=(_TURNS, len(stretches)))
    power = float(left @ left)
    found: list[tuple[Agreement, Floats, float]] = []
    for what, place, columns in _things(answers):
        basis = orthonormal(answers.without_free(columns))
        if basis.shape[1] == 0:
            continue
        # Their sum is that of what no parameter follows; each alone is whole, as chance would have it.
        along = np.array([seen[part] @ basis[part] for part in stretches])
        turned = np.sum((signs @ along) ** 2, axis=1)
        reached = float(np.sum(np.sum(along, axis=0) ** 2))
        beyond = max(0.0, reached - float(np.mean(turned))) / power
        found.append((Agreement(what, place, _p_value(reached, turned), beyond), turned, reached))
    powers = np.array([float(seen[part] @ seen[part]) / (part.stop - part.start) for part in stretches])
    spread = float(np.sum(powers)) ** 2 / float(np.sum(powers**2)) >= _LEAST_SPREAD * len(stretches)
    if not found:
        return Adequacy(1.0, (), spread, significance)
    ordered = tuple(sorted((agreement for agreement, _, _ in found), key=lambda a: -a.share))
    p_value = _smallest([turned for _, turned, _ in found], [reached for _, _, reached in found])
    return Adequacy(p_value, ordered, spread, significance)


def _p_value(reached: float, turned: Floats) -> float:
    return float((1.0 + np.sum(turned >= reached)) / (1.0 + turned.size))


def _smallest(turned: Sequence[Floats], reached: Sequence[float]) -> float:
    """Return the probability that chance makes any of several p-values as small as the smallest one here."""
    table = np.array(turned)
    ranks = (table.shape[1] - np.argsort(np.argsort(table, axis=1), axis=1)) / (1.0 + table.shape[1])
    seen = min(_p_value(r, row) for r, row in zip(reached, table, strict=True))
    by_chance = np.min(ranks, axis=0)
    return float((1.0 + np.sum(by_chance <= seen)) / (1.0 + by_chance.size))


def _stretches(answers: Answers) -> list[slice]:
    """Return stretches of about equal length that cover all records, none of which reaches from one record into the next."""
    spans = [answers.span(i) for i in range(len(answers.records))]
    length = max(1.0, spans[-1].stop / _STRETCHES)
    found = []
    for part in spans:
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
    if effect.place is Place.SENSOR:
        return np.column_stack([_readings_of(answers, place), _changes_of(answers, place)])
    if effect.place is Place.ACTUATOR:
        return np.column_stack([_signals_of(answers, place), _signal_changes_of(answers, place)])
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
            yield f"record: {name}", "", _by_record(answers, answers.to_parameter(name))
        for sensor in (s.name for s in rig.outputs):
            ones = [np.ones(r.n_samples) for r in answers.records]
            yield f"record: offset of {sensor}", sensor, _by_record(answers, _reading(answers, sensor, ones))


def _force(answers: Answers, joint: str) -> float:
    return _PUSH * characteristic_value(f"force@{joint}", answers.scales)


def _signal(answers: Answers, drive: str) -> float:
    return _PUSH * characteristic_value(f"input@{drive}", answers.scales)


def _slopes(answers: Answers, place: str) -> list[Floats]:
    return [np.gradient(s, r.dt) for s, r in zip(answers.seen(place), answers.records, strict=True)]


def _velocities_of(answers: Answers, joint: str) -> Floats:
    return _pushes(answers, joint, _corners(_slopes(answers, joint)), _force(answers, joint))


def _positions_of(answers: Answers, joint: str) -> Floats:
    return _pushes(answers, joint, _corners(answers.seen(joint)), _force(answers, joint))


def _signals_of(answers: Answers, drive: str) -> Floats:
    return _pushes(answers, drive, _corners(answers.seen(drive)), _signal(answers, drive))


def _signal_changes_of(answers: Answers, drive: str) -> Floats:
    return _pushes(answers, drive, _corners(_slopes(answers, drive)), _signal(answers, drive))


def _fading_of(answers: Answers, drive: str) -> Floats:
    """Return what a drive whose strength changes slowly over each record would change."""
    size = characteristic_value(f"input@{drive}", answers.scales)
    faded = [
        [c * s / size for c, s in zip(course, answers.seen(drive), strict=True)]
        for course in _course(answers)
    ]
    return _pushes(answers, drive, faded, _signal(answers, drive))


def _readings_of(answers: Answers, sensor: str) -> Floats:
    return _shown(answers, sensor, _corners(answers.seen(sensor)))


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
    for index in range(len(parts)):
        part = answers.span(index)
        columns[part, index] = whole[part]
    return columns

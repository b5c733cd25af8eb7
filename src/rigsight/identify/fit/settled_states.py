"""Initial state of a record: fitted from an estimate over increasingly long stretches up to the whole record.

The effect of an initial state is simpler over a short stretch than over a long one, above all if the motion is unstable or
chaotic: a descent on the whole record would fail from a slightly wrong estimate. If the effect of the initial state decays, the
fit itself converges, and longer stretches are left to it.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigsight.effects import Effect
from rigsight.identify.fit.coordinates import Coordinates
from rigsight.identify.fit.first_states import first_state, moves_freely, state_at_rest
from rigsight.identify.fit.fit_data import FitData, RecordData
from rigsight.identify.rig_equations import equations_of
from rigsight.records.record import Floats
from rigsight.simulate import has_dry_friction, parameter_vector, simulate_sets

_STATE_RANGE = 20.0
"""Largest distance of an initial state from its first estimate, in units of its size."""
_ROUNDING = 1e-12
"""Initial states below this, in units of their sizes, are zero: rounding leaves them."""
_HIDDEN_RANGE = 3.0
"""The same for a state of an effect, which no sensor shows and whose estimate is its equilibrium. Further off, its own motion
would explain what its equation does not: a resonance that begins at twenty times the motion of the mass on which it hangs."""


_FIRST_SAMPLES = 25
"""Number of samples of the first stretch."""
_STEP = 1e-6
"""Difference step of a state in units of its size."""
_STEPS = 4
"""Gauss-Newton steps on each stretch."""
_SHORTER = (0.3, 0.1, 0.03)
"""Shares of a step that are tried in addition to the whole one."""
_WORTH_A_STEP = 0.1
"""Share of the squared error by which a step must lower it for another step; the fit itself continues from here."""
_LONGER = 4
"""Length of a stretch relative to the previous one. With four instead of two, the stretches take two thirds of the time."""
_PULL = 1e-3
"""Weight of the first estimate against an error of size one: it determines only what the stretch does not."""
_LARGEST = 1e9
"""Error above which a motion counts as diverged."""
_SUBSTEPS = 4
_FIRST_PLACES = (0.0, -1.0, -0.5, 0.5, 1.0)
"""Values of limited states that are tried at the beginning of a record, as shares of their range: a descent from a wrong end
stays there."""
_LOST = 2.0
"""Growth of the RMS error from one stretch to the next at which longer ones are not tried: the parameters are too inaccurate."""
_STEADY = 0.5
"""Share of the squared sensitivity in the second half of a stretch if the effect of a state neither grows nor decays."""


def guessed_states(data: FitData, values: Mapping[str, float]) -> list[Floats]:
    """Return an estimate of each record's initial state."""
    # With limited states it is the best of several, moving and at rest. For a rig with more than one motion, and for a free
    # motion, it is fitted to the beginning of the record.
    guesses = [first_state(data.structure, d.record, values) for d in data.records]
    p = parameter_vector(data.structure, values)
    if np.any(data.limited):

        def placed(index: int) -> Floats:
            record, guess = data.records[index], guesses[index]
            ranges = np.where(data.limited, data.state_sizes(record.parameters(p)[:, None])[:, 0], 0.0)
            at_rest = state_at_rest(data.structure, record.record, guess, values)
            places = [g + place * ranges for place in _FIRST_PLACES for g in (guess, at_rest)]
            return _likeliest(data, record, p, np.column_stack(places))

        return data.of_each_record(placed)

    def settled(index: int) -> Floats:
        record = data.records[index]
        rig = data.structure.rig
        # If an input drives one mass, the initial state soon has no effect; a free motion depends on it alone.
        if rig.has_one_motion and not moves_freely(rig, record.record):
            return guesses[index]
        if not rig.has_one_motion and equations_of(rig).shows_all_states(set(record.record.signals)):
            return guesses[index]
        return settled_state(data, record, p, guesses[index])

    found = data.of_each_record(settled)
    rectified = [effect for effect in data.structure.effects if effect.loses_sign]
    if not rectified:
        return found
    return data.of_each_record(
        lambda i: _of_either_direction(data, data.records[i], values, rectified, found[i], guesses[i])
    )


def _of_either_direction(
    data: FitData,
    record: RecordData,
    values: Mapping[str, float],
    rectified: Sequence[Effect],
    found: Floats,
    guess: Floats,
) -> Floats:
    """Return the most likely initial state where sensors show magnitudes: that found, or one of a reading with either sign."""
    # A descent cannot pass the sign change. There the magnitude is least, or the sign stays over the first samples.
    structure = data.structure
    outputs = [signal.name for signal in structure.rig.outputs]
    places = [outputs.index(structure.rig.acts_at(effect)) for effect in rectified]
    signless = [place for place in places if record.weights[place] > 0.0]
    if not signless:
        return found
    nulls = {
        structure.parameter_name(effect, q.name): q.null
        for effect in rectified
        for q in effect.parameters
        if q.null is not None
    }
    p, signed = (parameter_vector(structure, {**values, **own}) for own in ({}, nulls))
    states = [found]
    least = np.nanargmin(record.measured[:_FIRST_SAMPLES, signless], axis=0)
    later = np.arange(record.measured.shape[0])[:, None] > least
    for sign, turns in itertools.product((1.0, -1.0), (False, True)):
        measured = record.measured.copy()
        measured[:, signless] *= np.where(later & turns, -sign, sign)
        begin = settled_state(data, replace(record, measured=measured), signed, sign * guess)
        states.append(settled_state(data, record, p, begin))
    return _likeliest(data, record, p, np.column_stack(states))


def moving_or_at_rest(data: FitData, values: Mapping[str, float], states: Sequence[Floats]) -> list[Floats]:
    """Return each record's initial state: the given one or rest, whichever fits the record better."""
    # While a joint sticks, its initial velocity has no effect: a fit neither leaves the state of rest nor finds it.
    p = parameter_vector(data.structure, values)

    def likelier(index: int) -> Floats:
        record = data.records[index]
        at_rest = state_at_rest(data.structure, record.record, states[index], values)
        return _likeliest(data, record, p, np.column_stack([states[index], at_rest]))

    return data.of_each_record(likelier)


def _likeliest(data: FitData, record: RecordData, p: Floats, states: Floats) -> Floats:
    """Return of several initial states, shape (n_states, n), the one with which the parameters fit the record best."""
    sets = np.repeat(record.parameters(p)[:, None], states.shape[1], axis=1)
    with np.errstate(all="ignore"):
        out = data.simulated(record, sets, states, _SUBSTEPS)
        errors = (record.measured[:, :, None] - out) * record.weights[:, None]
        costs = np.nansum(errors**2, axis=(0, 1))
    costs[~np.all(np.isfinite(out), axis=(0, 1))] = np.inf
    return states[:, int(np.argmin(costs))] if np.any(np.isfinite(costs)) else states[:, 0]


def settled_state(data: FitData, record: RecordData, p: Floats, guess: Floats) -> Floats:
    """Return the initial state that fits a record from its beginning, as far as the parameters allow."""
    state, n_samples, before = guess, min(_FIRST_SAMPLES, record.record.n_samples), np.inf
    while True:
        found, error, slopes = _fitted(data, record, record.parameters(p), state, n_samples)
        if not error <= _LOST * max(before, 1.0):
            return state
        state, before = found, error
        if n_samples == record.record.n_samples or _dies_away(slopes, n_samples):
            return state
        n_samples = min(_LONGER * n_samples, record.record.n_samples)


def _fitted(
    data: FitData, record: RecordData, p: Floats, start: Floats, n_samples: int
) -> tuple[Floats, float, Floats]:
    """Return the end of a descent on the first samples: state, root mean square of the weighted error, and its slopes."""
    sizes = data.state_sizes(p[:, None])[:, 0]
    sizes = np.where(sizes > 0.0, sizes, 1.0)
    beginning = record.first(n_samples)

    def errors(places: Floats) -> Floats:
        """Return the errors of places about the start, shape (n_errors, n_places)."""
        lanes = start[:, None] + sizes[:, None] * places
        sets = np.repeat(p[:, None], lanes.shape[1], axis=1)
        with np.errstate(all="ignore"):
            out = simulate_sets(data.structure, beginning.held, sets, lanes, n_samples, _SUBSTEPS)
            used = np.flatnonzero(beginning.weights > 0.0)
            remainder = (beginning.measured[:, used, None] - out[:, used]) * beginning.weights[used, None]
        remainder = remainder.swapaxes(0, 1).reshape(-1, lanes.shape[1])
        remainder = np.clip(np.nan_to_num(remainder, nan=_LARGEST), -_LARGEST, _LARGEST)
        return np.vstack([remainder, _PULL * places])

    n = start.size
    around, place = np.column_stack([np.zeros(n), _STEP * np.eye(n)]), np.zeros(n)
    lanes = errors(place[:, None] + around)
    for _ in range(_STEPS):
        cost, slopes = float(lanes[:, 0] @ lanes[:, 0]), (lanes[:, 1:] - lanes[:, :1]) / _STEP
        step = np.linalg.lstsq(slopes, -lanes[:, 0], rcond=None)[0]
        # A whole step is usually the best, so the slopes for the next step are computed with it.
        tried = np.column_stack([(place + step)[:, None] + around, place[:, None] + np.outer(step, _SHORTER)])
        ahead = errors(tried)
        costs = np.sum(ahead**2, axis=0)
        best = min((0, *range(n + 1, tried.shape[1])), key=lambda lane: costs[lane])
        if not costs[best] < cost:
            break
        place, gained = tried[:, best], cost - float(costs[best])
        lanes = ahead[:, : n + 1] if best == 0 else errors(place[:, None] + around)
        if gained < _WORTH_A_STEP * cost:
            break
    n_measured = max(1, n_samples * int(np.count_nonzero(record.weights)))
    error = float(np.linalg.norm(lanes[:, 0]) / np.sqrt(n_measured))
    return start + sizes * place, error, (lanes[:, 1:] - lanes[:, :1]) / _STEP


def _dies_away(slopes: Floats, n_samples: int) -> bool:
    """Return True if the effect of any change of the state is smaller in the second half of a stretch than in the first."""
    n_states = slopes.shape[1]
    if n_states == 0:
        return True
    directions = np.linalg.qr(slopes)[0][:-n_states].reshape(-1, n_samples, n_states)
    late = directions[:, n_samples // 2 :].reshape(-1, n_states)
    return bool(np.linalg.norm(late, ord=2) ** 2 <= _STEADY)


@dataclass(frozen=True)
class SearchStart:
    """Start of a search, dimensionless."""

    coordinates: Coordinates  # of the free parameters
    # Free parameters, then the initial states of each record, shape (n_free + n_records * n_states,).
    theta: Floats
    # Initial states of each record in units of their sizes, each of shape (n_states,).
    places: list[Floats]
    # Bounds of the initial states of each record, as `places`.
    lower: list[Floats]
    upper: list[Floats]

    @property
    def n_states(self) -> int:
        """Number of states of the structure."""
        return self.lower[0].size

    @classmethod
    def of(
        cls,
        data: FitData,
        scales: Mapping[str, float],
        values: Mapping[str, float],
        free: Sequence[str],
        initial_states: Sequence[Floats] | None = None,
        as_given: bool = False,
    ) -> SearchStart:
        """Return the start of a search; initial states stay `as_given` also where rest would fit the records better."""
        coordinates = Coordinates.of(data.structure, free, values, scales)
        states = list(initial_states) if initial_states is not None else guessed_states(data, values)
        if has_dry_friction(data.structure) and not as_given:
            states = moving_or_at_rest(data, values, states)
        own = coordinates.from_values(values)
        sizes = data.state_sizes(coordinates.to_parameters(own)[:, None])[:, 0]
        limited = data.limited
        of_effects = tuple(f"{effect.name}." for effect in data.structure.effects)
        hidden = [name.startswith(of_effects) for name in data.structure.state_names]
        reach = np.where(hidden, _HIDDEN_RANGE, _STATE_RANGE)
        places = [np.where(limited, np.clip(s / sizes, -1.0, 1.0), s / sizes) for s in states]
        # The sign of a speed of 1e-19 would decide whether a joint sticks.
        places = [np.where(np.abs(place) < _ROUNDING, 0.0, place) for place in places]
        return cls(
            coordinates=coordinates,
            theta=np.concatenate([own, *places]),
            places=places,
            lower=[np.where(limited, -1.0, place - reach) for place in places],
            upper=[np.where(limited, 1.0, place + reach) for place in places],
        )

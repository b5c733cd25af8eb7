"""In which section of the signal path does the gap arise? Each section is driven by its measured input.

A delay before the motion does not affect the lateral section. A delay of the motion sensor shifts it the other way: the motion is
measured late, so y seems early.

The lateral part is judged by its linear equation with the measured motion as input, ``y' = b (c + g x(t + shift) - y)`` with x
joined by straight lines. For each rate b and shift, gain g, offset c and initial values follow by linear least squares, so that
the search has two dimensions at most. Errors of the model of x do not matter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.optimize
import scipy.signal
from scipy.interpolate import CubicSpline

from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.location.gap_parts import PathPart
from rigsight.diagnose.policy import MAPS, NOTES, VERDICT
from rigsight.effects import Place
from rigsight.effects.symbols import derivative
from rigsight.metrics import rms
from rigsight.records.record import Floats, Record
from rigsight.rigs import Rig


def path_parts(
    context: FitContext, before: FittedModel, reidentified: FittedModel, after: FittedModel
) -> tuple[PathPart, ...]:
    """Return the error of every section of the signal path when it is driven by its measured input."""
    rig = context.rig
    source, motion = rig.inputs[0].name, rig.outputs[0].name
    own = _motion_alone(context, reidentified)
    parts = [
        _part(
            context.scoring,
            motion,
            source,
            {"before": _column(before, 0), "reidentified": _column(own, 0), "after": _column(after, 0)},
            context.noise[motion],
        )
    ]
    leg = fit_lateral_leg(context, before.fit.values)
    if leg is not None and rig.follower is not None:
        parts.append(_lateral_part(context, leg, motion, rig.follower.symbol.name))
    return tuple(parts)


def path_sentence(parts: Sequence[PathPart], rig: Rig) -> str:
    """Return a sentence on the sections of the signal path; empty where there is none."""
    if not parts:
        return ""
    first = parts[0]
    motion = f"{first.path} leaves {_times(first.reidentified, first)}"
    if len(parts) == 1:
        return f"One section of the signal path can be checked: {motion} after re-identification."
    lateral = parts[1]
    clean = lateral.reidentified <= VERDICT.at_floor * lateral.noise_floor
    said = (
        f"{lateral.path}, with {lateral.source} as measured, leaves {_times(lateral.reidentified, lateral)}"
    )
    moved = (
        abs(lateral.shift) > NOTES.clearly * lateral.shift_std
        and lateral.shifted * VERDICT.worthwhile < lateral.reidentified
    )
    if clean and first.reidentified > VERDICT.at_floor * first.noise_floor:
        return (
            f"The gap arises before {lateral.source} is measured: {motion}, but {said}. So the cause is the drive or "
            f"{rig.place_name(Place.DYNAMICS).replace('_', ' ')}, not the lateral part and not a delay of the {lateral.source} "
            "sensor."
        )
    if clean:
        return f"No section of the signal path has a noticeable gap: {motion}, {said}."
    shifted = _times(lateral.shifted, lateral)
    if moved and lateral.shifted <= VERDICT.at_floor * lateral.noise_floor:
        late, early = (
            (lateral.source, lateral.output) if lateral.shift > 0.0 else (lateral.output, lateral.source)
        )
        return (
            f"The sensors are not synchronous: {said}, but only {shifted} if {late} is assumed to be measured "
            f"{1e3 * abs(lateral.shift):.3g} ms later than {early}; {motion}."
        )
    better = f" ({shifted} with {lateral.source} shifted by {1e3 * lateral.shift:.3g} ms)" if moved else ""
    return f"The lateral part or a sensor has a gap of its own: {said}{better}; {motion}."


def _times(value: float, part: PathPart) -> str:
    return f"{value / part.noise_floor:.3g} times its noise floor"


def _motion_alone(context: FitContext, reidentified: FittedModel) -> FittedModel:
    """Re-identify the motion without what it drives, so that a gap there does not distort these parameters."""
    downstream = context.rig.downstream_parameters
    if not downstream or downstream <= context.held:
        return reidentified
    names = {symbol.name for symbol in context.rig.downstream}
    alone = replace(
        context,
        estimation=tuple(_without(record, names) for record in context.estimation),
        scoring=tuple(_without(record, names) for record in context.scoring),
        held=context.held | downstream,
    )
    structure = reidentified.fit.structure
    fit = alone.problem(structure, alone.estimation).fit(
        reidentified.fit.values, alone.free_parameters(structure)
    )
    return alone.score((), fit) if fit.residuals else reidentified


def _without(record: Record, names: set[str]) -> Record:
    return replace(record, signals={n: s for n, s in record.signals.items() if n not in names})


def _column(model: FittedModel, index: int) -> list[Floats]:
    return [residual[:, index] for residual in model.residuals]


def _lateral_part(context: FitContext, leg: LateralLeg, motion: str, output: str) -> PathPart:
    records = [record for record in context.scoring if output in record]
    noise = float(np.hypot(context.noise[output], leg.noise_gain * context.noise[motion]))
    part = _part(records, output, motion, {"before": leg.given, "reidentified": leg.fitted}, noise)
    spread = float(np.std(np.concatenate([record[output] for record in records]))) or 1.0
    shifted = rms(np.concatenate(leg.shifted)) / spread
    return replace(part, shift=leg.shift, shift_std=leg.shift_std, shifted=shifted)


def _part(
    records: Sequence[Record], output: str, source: str, residuals: dict[str, Sequence[Floats]], noise: float
) -> PathPart:
    spread = float(np.std(np.concatenate([record[output] for record in records]))) or 1.0
    remainder = {stage: rms(np.concatenate(list(parts))) / spread for stage, parts in residuals.items()}
    floor = noise / spread
    return PathPart(
        output=output,
        before=remainder["before"],
        reidentified=remainder["reidentified"],
        after=remainder.get("after", float("nan")),
        noise_floor=floor,
        share=1.0,
        noise_share=min(1.0, (floor / remainder["reidentified"]) ** 2)
        if remainder["reidentified"] > 0.0
        else 1.0,
        path=f"{source} -> {output}",
        source=source,
        units={"shift": "s", "shift_std": "s"},
    )


@dataclass(frozen=True)
class LateralLeg:
    """The section from the measured motion to y."""

    # Residual of y per scored record, shape (n_samples,): as given, with the best numbers, and with the
    # motion shifted too.
    given: tuple[Floats, ...]
    fitted: tuple[Floats, ...]
    shifted: tuple[Floats, ...]
    # How much earlier the motion must have come for the best fit [s], and its standard error from a white
    # residual.
    shift: float
    shift_std: float
    noise_gain: float  # gain from the noise of the motion to y, [unit of y per unit of x]


@dataclass(frozen=True)
class _Numbers:
    rate: float
    gain: float
    offset: float
    shift: float = 0.0


def fit_lateral_leg(context: FitContext, given: Mapping[str, float]) -> LateralLeg | None:
    """Fit the lateral equation with the measured motion as input; None where no record holds both."""
    rig = context.rig
    if rig.follower is None:
        return None
    names = (rig.outputs[0].name, rig.follower.symbol.name)
    fitted_to = [r for r in context.estimation if names[1] in r]
    scored_on = [r for r in context.scoring if names[1] in r]
    if not fitted_to or not scored_on:
        return None
    start = _given(rig, given)
    longest = max(r.duration for r in fitted_to)
    lowest, highest = np.log(MAPS.slowest_rate / longest), np.log(MAPS.fastest_rate / fitted_to[0].dt)
    first = float(np.clip(np.log(start.rate), lowest + 1e-6, highest - 1e-6))

    def residual(theta: Floats) -> Floats:
        shift = float(theta[1]) * fitted_to[0].dt if theta.size > 1 else 0.0
        return _projected(fitted_to, names, float(np.exp(theta[0])), shift)[0]

    plain = scipy.optimize.least_squares(residual, [first], bounds=([lowest], [highest]), x_scale=0.1)
    reach = MAPS.largest_shift * longest / fitted_to[0].dt
    free = scipy.optimize.least_squares(
        residual,
        [plain.x[0], 0.0],
        bounds=([lowest, -reach], [highest, reach]),
        x_scale=[0.1, 1.0],
        diff_step=[1e-4, 1e-4],
    )
    best, moved = (_solved(fitted_to, names, solution.x) for solution in (plain, free))
    slopes = np.asarray(free.jac)
    curvature = np.linalg.pinv(slopes.T @ slopes)
    scatter = 2.0 * free.cost / max(1, free.fun.size - 2)
    return LateralLeg(
        given=tuple(_remainder(r, names, start) for r in scored_on),
        fitted=tuple(_remainder(r, names, best) for r in scored_on),
        shifted=tuple(_remainder(r, names, moved) for r in scored_on),
        shift=moved.shift,
        shift_std=float(np.sqrt(scatter * curvature[1, 1])) * fitted_to[0].dt,
        noise_gain=_noise_gain(best, scored_on[0].dt),
    )


def _given(rig: Rig, values: Mapping[str, float]) -> _Numbers:
    """Return rate, gain and offset of the rig's own lateral equation."""
    lateral = rig.follower
    assert lateral is not None
    rates = lateral.gain * lateral.creepage
    numbers = {s: values[s.name] for s in rates.free_symbols if s.name in values}
    x, y = rig.motion.displacement, lateral.symbol
    rate = -float(derivative(rates, y).subs(numbers))
    gain = float(derivative(rates, x).subs(numbers)) / rate
    offset = float(rates.subs({**numbers, x: 0.0, y: 0.0})) / rate
    return _Numbers(rate, gain, offset)


def _solved(records: Sequence[Record], names: tuple[str, str], theta: Floats) -> _Numbers:
    shift = float(theta[1]) * records[0].dt if theta.size > 1 else 0.0
    coefficients = _projected(records, names, float(np.exp(theta[0])), shift)[1]
    return _Numbers(float(np.exp(theta[0])), float(coefficients[0]), float(coefficients[1]), shift)


def _projected(
    records: Sequence[Record], names: tuple[str, str], rate: float, shift: float
) -> tuple[Floats, Floats]:
    """Return residuals of all records and gain, offset and initial values that are best for a rate and a shift."""
    columns, targets = [], []
    for i, record in enumerate(records):
        rows = np.zeros((record.n_samples, 2 + len(records)))
        decay = _decay(record, rate)
        rows[:, 0] = _response(_moved(record, names[0], shift), record.dt, rate)
        rows[:, 1] = 1.0 - decay
        rows[:, 2 + i] = decay
        columns.append(rows)
        targets.append(record[names[1]])
    matrix, target = np.concatenate(columns), np.concatenate(targets)
    size = np.sqrt(np.sum(matrix**2, axis=0)) + 1e-300
    normal = (matrix / size).T @ (matrix / size)
    coefficients = np.linalg.lstsq(normal, (matrix / size).T @ target, rcond=1e-12)[0] / size
    return target - matrix @ coefficients, coefficients


def _remainder(record: Record, names: tuple[str, str], numbers: _Numbers) -> Floats:
    """Return the residual of y with these parameters; only the initial value is fitted."""
    decay = _decay(record, numbers.rate)
    follows = numbers.gain * _response(_moved(record, names[0], numbers.shift), record.dt, numbers.rate)
    remainder = record[names[1]] - follows - numbers.offset * (1.0 - decay)
    return np.asarray(remainder - decay * (decay @ remainder) / (decay @ decay))


def _moved(record: Record, name: str, shift: float) -> Floats:
    if shift == 0.0:
        return record[name]
    time = record.dt * np.arange(record.n_samples)
    at = np.clip(time + shift, 0.0, time[-1])
    return np.asarray(CubicSpline(time, record[name])(at))


def _decay(record: Record, rate: float) -> Floats:
    return np.asarray(np.exp(-rate * record.dt * np.arange(record.n_samples)))


def _response(motion: Floats, dt: float, rate: float) -> Floats:
    """Return the answer from rest of ``y' = rate (x - y)`` to samples joined by straight lines, shape (n_samples,)."""
    ahead, behind, kept = _coefficients(rate * dt)
    response = scipy.signal.lfilter([ahead, behind], [1.0, -kept], motion)
    first = ahead * motion[0] * kept ** np.arange(motion.size)
    return np.asarray(response - first)


def _coefficients(z: float) -> tuple[float, float, float]:
    kept = float(np.exp(-z))
    mean = -float(np.expm1(-z)) / z
    return 1.0 - mean, mean - kept, kept


def _noise_gain(numbers: _Numbers, dt: float) -> float:
    """Return the RMS answer of y to white noise of unit size in the measured motion."""
    ahead, behind, kept = _coefficients(numbers.rate * dt)
    first, then = ahead, behind + ahead * kept
    return abs(numbers.gain) * float(np.sqrt(first**2 + then**2 / (1.0 - kept**2)))

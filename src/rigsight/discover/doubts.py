"""Warnings before the equations are used: doubts about terms and about the records."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from rigsight.discover.bench import Trial
from rigsight.discover.regression import STRONG, RegressionData
from rigsight.discover.result import Coefficient, Term
from rigsight.discover.selection import Selection, criterion
from rigsight.discover.terms.force_law import ForceEquation
from rigsight.effects import Effect
from rigsight.records.record import Record
from rigsight.records.signals import same_signal

_SURE = 0.9
_ZERO = 3.0
_VAGUE = 0.05
_FLOOR = 1.5
"""Held-out error in noise floors above which an effect is still missing."""
_NOISY = 0.1
"""Noise floor, relative to the motion, from which it may mask terms."""
_MOST_NAMED = 3
_SAME_RATE = 1e-6
"""Relative difference up to which sample times, computed from time columns, count as equal."""
_NEAR = 1.5
"""Factor of the held-out error within which another equation is nearly as good."""


def doubts(effect: Effect, own: Mapping[str, Coefficient], inclusion: float, same: Sequence[str]) -> str:
    """Return the reasons to doubt a kept term; empty if there are none."""
    found = []
    for name, coefficient in own.items():
        # Beside another effect with such a parameter its name is qualified.
        counts_from_zero = name.removeprefix(f"{effect.name}.") not in effect.special_cases
        size = abs(coefficient.value)
        if not math.isfinite(coefficient.std):
            found.append(f"{name} is not determined by these records")
        elif counts_from_zero and coefficient.std > size / _ZERO:
            found.append(f"{name} is not significantly different from zero")
        elif coefficient.std > _VAGUE * size:
            found.append(f"{name} is known to {100.0 * coefficient.std / size:.0f} % only")
    if inclusion < _SURE:
        found.append(f"sparse regression selects it in {100.0 * inclusion:.0f} % of the draws")
    if same:
        found.append(f"{' and '.join(same)} would fit equally well on these records")
    return "; ".join(found)


def warnings_of(
    data: RegressionData,
    estimation: Sequence[Record],
    held_out: Sequence[Record],
    how: str,
    selection: Selection,
    chosen: Trial,
    error_over_noise: float,
    terms: Sequence[Term],
    held: str,
    force: ForceEquation | None,
    floor: float,
    likeliest: str,
) -> tuple[str, ...]:
    """Return the warnings for the user, one sentence each."""
    found = [note for note in (how, held) if note]
    source = data.rig.inputs[0].name
    sizes = [float(np.std(record[source])) for record in estimation]
    if max(sizes) < 1.2 * min(sizes):
        found.append(_one_amplitude(selection, chosen))
    found += _same_input(source, estimation, held_out)
    best = criterion(chosen, selection.independent)
    rivals = [
        trial
        for trial in selection.trials
        if trial.support != chosen.support
        and criterion(trial, selection.independent) < best + STRONG
        and trial.n_free <= chosen.n_free
    ]
    richer = [
        trial
        for trial in selection.trials
        if trial.support > chosen.support and criterion(trial, selection.independent) < best
    ]
    if rivals:
        listed = "; ".join(", ".join(sorted(trial.support)) or "no term at all" for trial in rivals[:3])
        found.append(
            f"The noise is too high, or the records too short, to select the terms: {listed} fits equally well. Add records at "
            f"other amplitudes, or average repeated ones."
        )
    extra = sorted({name for trial in richer for name in trial.support - chosen.support})
    if extra:
        found.append(f"In doubt: {', '.join(extra)}. It lowers the held-out error, but not significantly.")
    if floor > _NOISY and likeliest:
        found.append(
            f"The noise is {100.0 * floor:.0f} % of the held-out motion, too high to decide on terms that change the motion by "
            f"less: every omitted term is in doubt. Regression would select {likeliest} next, which proves nothing at this noise "
            f"level."
        )
    found += still_missing(error_over_noise)
    found += [f"{term.name}: {term.doubt}." for term in terms if term.kept and term.doubt]
    if force is not None:
        fitted = {p.name for p in force.law.effect.parameters if p.fitted}
        blind = [
            parameter
            for term, parameter in force.law.parameters.items()
            if parameter in fitted and force.inclusion.get(term, 0.0) < _SURE
        ]
        if blind:
            found.append(
                f"The regressed equation of the hysteretic force does not show {' and '.join(blind)} of "
                f"{force.law.effect.name} for sure; "
                f"{'its' if len(blind) == 1 else 'their'} value comes from the free-run fit alone."
            )
    return tuple(found)


def still_missing(error_over_noise: float) -> list[str]:
    """Return a warning about an error that the noise does not explain; empty if it does."""
    if error_over_noise <= _FLOOR:
        return []
    return [
        f"The equations leave {error_over_noise:.1f} times the noise floor in free run on the held-out records: "
        "an effect is still missing, or disturbances are larger than the noise floor."
    ]


def _same_input(source: str, estimation: Sequence[Record], held_out: Sequence[Record]) -> list[str]:
    """Return a warning about held-out records that have the same input as a fitted one."""
    twins = {
        record.name: fitted.name
        for record in held_out
        for fitted in estimation
        if math.isclose(record.dt, fitted.dt, rel_tol=_SAME_RATE)
        and same_signal(record[source], fitted[source])
    }
    if not twins:
        return []
    listed = "; ".join(f"'{name}' as '{fitted}'" for name, fitted in list(twins.items())[:_MOST_NAMED])
    return [
        f"Held-out records have the input of fitted ones: {listed}. With the same input even wrong terms may fit, so the error "
        f"says little about other motion. Add a validation record with another waveform or amplitude."
    ]


def _one_amplitude(selection: Selection, chosen: Trial) -> str:
    """Return a warning that the records have a single amplitude, and the equations that they do not distinguish."""
    others = sorted(
        (
            t
            for t in selection.trials
            if not t.support >= chosen.support and math.isfinite(t.error_over_noise)
        ),
        key=lambda t: t.error_over_noise,
    )
    near = [t for t in others if t.error_over_noise < _NEAR * chosen.error_over_noise]
    if not others:
        reported = (
            "Softening, hardening, friction or hysteresis may look like other parameters of the same equation at this "
            "amplitude"
        )
    elif near:
        listed = "; ".join(", ".join(sorted(trial.support)) or "no term at all" for trial in near[:3])
        reported = f"At this amplitude {listed} is nearly as good"
    else:
        ratio = others[0].error_over_noise / chosen.error_over_noise
        reported = (
            f"At this amplitude the terms are distinguished (the error of the next equation is {ratio:.3g} times as large), "
            f"at others they are untested"
        )
    return (
        f"The records have only one amplitude, so they do not show how a force grows with amplitude. {reported}. "
        "Add a record at half or twice the amplitude."
    )

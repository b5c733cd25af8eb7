"""Results of all stages put together: equations, terms with their doubts, warnings about the records, free runs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import sympy as sp

from rigsight.discover.along_motion import AlongMotion
from rigsight.discover.bench import Bench, Trial
from rigsight.discover.input_noise import error_of_inputs
from rigsight.discover.own_laws import own_laws
from rigsight.discover.records import DiscoveryData, same_input, strength
from rigsight.discover.result import (
    Alternative,
    Coefficient,
    Discovery,
    HeldOut,
    JointForce,
    OfferedShape,
    Run,
    Term,
)
from rigsight.discover.selection import BY_NOISE, STRONG, Selection, criterion
from rigsight.discover.terms import POWERS
from rigsight.effects import Effect
from rigsight.effects.placed import kind_of
from rigsight.identify import FitResult
from rigsight.metrics import rms
from rigsight.records.record import Floats, Record
from rigsight.rigs import Rig
from rigsight.simulate import Structure
from rigsight.simulate.model import Model
from rigsight.simulate.printing.notation import latex_equation, text_equation
from rigsight.simulate.printing.shown import ShownEquation, flat_equations
from rigsight.units import behind

_DIGITS = 4
"""Significant digits of numbers in an effect's equation; parameters are written as symbols."""


def held_numbers(fit: FitResult) -> dict[str, float]:
    """Return the held parameters whose values are written into the equations: only 0 and 1, which make them shorter."""
    constants = {p.name for p in fit.structure.rig.constants}
    return {
        name: value
        for name, value in fit.values.items()
        if name not in fit.free and name not in constants and value in (0.0, 1.0)
    }


def equations(structure: Structure, numbers: Mapping[str, float]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the equations of a structure as text and as LaTeX: of motion, of states, of outputs other than single states."""
    symbols = dict(zip(structure.names, structure.parameter_symbols, strict=True))
    written = {
        symbols[name]: sp.Integer(value) if float(value).is_integer() else sp.Float(value)
        for name, value in numbers.items()
    }
    shown = flat_equations(structure, written)
    rounded = [_rounded(equation) for equation in shown.equations]
    # The text uses the same parameter names as the tables of their values.
    plain = {symbol: name.plain.replace(" ", "_") for symbol, name in shown.names.items()}
    plain |= {symbol: name for name, symbol in symbols.items()}
    text = tuple(text_equation(equation, plain) for equation in rounded)
    return text, tuple(" = ".join(latex_equation(equation, shown.names)) for equation in rounded)


def _rounded(equation: ShownEquation) -> ShownEquation:
    def short(expression: sp.Expr) -> sp.Expr:
        return expression.xreplace(
            {number: sp.Float(f"{float(number):.{_DIGITS}g}") for number in expression.atoms(sp.Float)}
        )

    limit = None if equation.limit is None else (equation.limit[0], short(equation.limit[1]))
    inertia = tuple((short(mass), acceleration) for mass, acceleration in equation.inertia)
    terms = tuple(map(short, equation.terms))
    return replace(equation, left=short(equation.left), terms=terms, limit=limit, inertia=inertia)


_ZERO = 3.0
_VAGUE = 0.05
_NOISY = 0.1
"""Noise floor, relative to the motion, from which it may mask terms."""
_AT_BOUND = 0.1
"""Distance in standard errors at which a parameter is at a bound."""
_NEAR = 1.5
"""Factor of the held-out error within which another equation is nearly as good."""


@dataclass(frozen=True, eq=False)
class Found:
    """Results of the stages of a discovery, from which its result is assembled."""

    estimation: tuple[Record, ...]
    held_out: tuple[Record, ...]
    how: str
    bench: Bench
    selection: Selection
    judged: Trial
    final: FitResult
    along: AlongMotion | None
    inclusion: Mapping[str, float]
    held: str
    offered: OfferedShape | None


def doubts(effect: Effect, own: Mapping[str, Coefficient]) -> str:
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
    return "; ".join(found)


def warnings_of(data: DiscoveryData, stages: Found, terms: Sequence[Term], floor: float) -> tuple[str, ...]:
    """Return the warnings for the user, one sentence each."""
    selection, chosen = stages.selection, stages.selection.best
    found = [note for note in (stages.how, stages.held) if note]
    sizes = [strength(data.rig, record) for record in stages.estimation]
    if max(sizes) < 1.2 * min(sizes):
        found.append(_one_amplitude(selection, chosen))
    sources = [signal.name for signal in data.rig.inputs]
    found += same_input(sources, stages.estimation, stages.held_out) if sources else []
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
    if floor > _NOISY:
        found.append(
            f"The noise is {100.0 * floor:.0f} % of the held-out motion, too high to decide on terms that change the motion by "
            f"less: every omitted term is in doubt."
        )
    found += _still_missing(stages)
    if stages.judged.error_over_noise > BY_NOISE:
        found += at_bounds(data.rig, stages.final)
    unknown = [name for name, c in coefficients_of(stages.final).items() if not math.isfinite(c.std)]
    if unknown and data.rig.mechanism.joints[1:]:
        found.append(f"These records do not determine {', '.join(unknown)}.")
    found += [f"{term.name}: {term.doubt}." for term in terms if term.kept and term.doubt]
    return tuple(found)


def at_bounds(rig: Rig, final: FitResult) -> list[str]:
    """Return a warning about each parameter of the rig at a bound, which the terms may have to make up for."""
    found = []
    for p in rig.parameters:
        for side, bound in (("lower", p.lower), ("upper", p.upper)):
            if (
                p.name in final.free
                and abs(final.values[p.name] - bound) <= _AT_BOUND * final.standard_errors[p.name]
            ):
                found.append(
                    f"{p.name} is at its {side} bound of {bound:.3g}{behind(p.unit)}: the terms may make up for a value beyond "
                    "it. If this rig can have one, as a self-excited rig has negative damping, allow it in a rig file."
                )
    return found


def _still_missing(stages: Found) -> list[str]:
    """Return a warning about an error that the noise does not explain; empty if it does."""
    error = stages.judged.error_over_noise
    if error <= BY_NOISE:
        return []
    of_inputs = error_of_inputs(stages.judged.fit, stages.bench.held_out, stages.bench.noise)
    if of_inputs > 1.0:
        outside = (
            "Noise of the measured inputs, if their fastest changes are noise that does not reach the rig, leaves "
            f"{of_inputs:.1f}; what exceeds that is an effect that is missing, or a disturbance."
        )
    elif stages.along is None:
        outside = "An effect is still missing, or disturbances are larger than the noise floor."
    else:
        outside = (
            "No further term lowers it: what is missing is outside the library, or disturbances are larger than the noise floor. "
            "The figure shows the force missing at each joint over its motion; "
        )
        outside += (
            "it is no clear function of one argument. A law read from it can be offered with --effects."
            if stages.offered is None
            else f"a function of the {stages.offered.argument} alone explains more of it than these equations."
        )
    return [
        f"The equations leave {error:.1f} times the noise floor in free run on the held-out records. {outside} Standard errors "
        "count what scatters, not what is missing: they are too small here."
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


def assembled(data: DiscoveryData, found: Found) -> Discovery:
    """Return the result of a discovery: equations, terms with their doubts, alternatives, free runs, model."""
    rig, selection, final, judged = data.rig, found.selection, found.final, found.judged
    terms = _terms(found)
    error, floor = _relative(data, found)
    text, latex = equations(final.structure, held_numbers(final))
    own = {p.name for p in rig.parameters}
    runs = _runs(data, found)
    model = Model.of(final.structure, final.values, found.estimation[0].hold)
    return Discovery(
        title=data.campaign.title,
        rig=rig.name,
        equations=text,
        latex=latex,
        rig_parameters={name: c for name, c in coefficients_of(final).items() if name in own},
        terms=terms,
        alternatives=tuple(_alternative(trial, selection) for trial in selection.trials),
        held_out=tuple(_held_out(data, record, runs) for record in found.held_out),
        held_out_error=judged.error_over_noise,
        held_out_nrmse=error,
        noise_floor=floor,
        independent=selection.independent,
        runs=runs,
        output=rig.outputs[0].name,
        unit=rig.outputs[0].unit,
        model=model.to_json(),
        warnings=warnings_of(data, found, terms, floor),
        joints=_joints(found),
        offered=found.offered,
        own_laws=own_laws(model, found.bench.modelled, found.bench.scales),
    )


def _held_out(data: DiscoveryData, record: Record, runs: Sequence[Run]) -> HeldOut:
    """Return the error of the free run of one record, RMS over its outputs."""
    own = [run for run in runs if run.record == record.name]
    errors = [rms(run.measured - run.simulated) for run in own]
    over_noise = [error / data.noise[run.output] for error, run in zip(errors, own, strict=True)]
    relative = [error / (float(np.std(run.measured)) or 1.0) for error, run in zip(errors, own, strict=True)]
    return HeldOut(record.name, rms(np.array(over_noise)), rms(np.array(relative)))


def _joints(found: Found) -> tuple[JointForce, ...]:
    """Return the missing force of each joint, those with terms first."""
    along, effects = found.along, found.final.structure.effects
    if along is None:
        return ()
    joints = []
    for joint in along.rig.mechanism.joints:
        missing, law = along.missing(found.final, joint.name)
        here = (e for e in effects if along.is_at(e, joint))
        joints.append(JointForce(missing, law, tuple(kind_of(effect.name) for effect in here)))
    return tuple(sorted(joints, key=lambda own: (not own.terms, -own.missing.share)))


def _relative(data: DiscoveryData, found: Found) -> tuple[float, float]:
    """Return held-out error and noise floor relative to the standard deviation of each output, RMS over the scored outputs."""
    errors, floors = [], []
    for column, name, floor in _scored(data, found):
        spread = float(np.std(np.concatenate([r[name] for r in found.held_out if name in r]))) or 1.0
        shown = column[np.isfinite(column)]
        errors.append(float(np.sqrt(np.mean(shown**2))) * floor / spread)
        floors.append(floor / spread)
    return math.hypot(*errors) / math.sqrt(len(errors)), math.hypot(*floors) / math.sqrt(len(floors))


def _scored(data: DiscoveryData, found: Found) -> list[tuple[Floats, str, float]]:
    """Return the outputs with held-out errors: these in units of the noise floor, the name and the noise floor."""
    columns = zip(found.judged.residuals.T, found.judged.fit.structure.rig.outputs, strict=True)
    return [
        (column, signal.name, data.noise[signal.name])
        for column, signal in columns
        if np.any(np.isfinite(column))
    ]


def coefficients_of(fit: FitResult) -> dict[str, Coefficient]:
    """Return the fitted parameters with standard errors and units."""
    units = {p.name: p.unit for p in fit.structure.parameters}
    return {name: Coefficient(fit.values[name], fit.standard_errors[name], units[name]) for name in fit.free}


def _terms(found: Found) -> tuple[Term, ...]:
    structure, coefficients, inclusion = found.final.structure, coefficients_of(found.final), found.inclusion
    terms = []
    for effect in structure.effects:
        if effect in found.bench.modelled:
            continue
        names = [structure.parameter_name(effect, p.name) for p in effect.parameters]
        own = {name: coefficients[name] for name in names if name in coefficients}
        terms.append(_term(found, effect, own))
    there = set(structure.effect_names)
    fitted = {name for trial in found.selection.trials for name in trial.support}
    others = {*inclusion, *fitted} - there
    offered = [_term(found, found.bench.effects[name]) for name in sorted(others)]
    tried = [term for term in offered if math.isfinite(term.otherwise)]
    rest = [term for term in offered if term not in tried]
    terms += sorted(tried, key=lambda term: term.otherwise)
    return (*terms, *sorted(rest, key=lambda term: -(term.inclusion or 0.0)))


def _term(found: Found, effect: Effect, own: Mapping[str, Coefficient] | None = None) -> Term:
    """Return a term: with its coefficients one of the equation, else one that was offered."""
    kind = kind_of(effect.name)
    return Term(
        name=kind,
        summary=effect.summary,
        kept=own is not None,
        inclusion=found.inclusion.get(effect.name),
        coefficients=own or {},
        doubt=doubts(effect, own or {}),
        where=effect.at or "",
        family="" if kind in POWERS else str(effect.family),
        otherwise=found.selection.otherwise(effect.name),
    )


def _alternative(trial: Trial, selection: Selection) -> Alternative:
    bic = criterion(trial, selection.independent)
    aic = bic - trial.n_free * (math.log(selection.independent) - 2.0)
    return Alternative(tuple(sorted(trial.support)), trial.n_free, trial.error_over_noise, aic, bic)


def _runs(data: DiscoveryData, found: Found) -> tuple[Run, ...]:
    """Return the free runs of the chosen model on the held-out records, one for each scored output."""
    ends = np.cumsum([record.n_samples for record in found.held_out])[:-1]
    units = {signal.name: signal.unit for signal in data.rig.outputs}
    errors = {name: np.split(column * floor, ends) for column, name, floor in _scored(data, found)}
    return tuple(
        Run(r.name, r.role, r.t, r[name], r[name] - parts[i], name, units[name])
        for i, r in enumerate(found.held_out)
        for name, parts in errors.items()
        if name in r
    )

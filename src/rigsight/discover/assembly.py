"""Assembly of the results of all stages."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rigsight.discover.bench import Bench, Trial
from rigsight.discover.doubts import doubts, warnings_of
from rigsight.discover.regression import RegressionData
from rigsight.discover.result import Alternative, Coefficient, Discovery, Run, Term
from rigsight.discover.selection import Selection, criterion, next_terms
from rigsight.discover.terms.equations import equations, held_numbers
from rigsight.discover.terms.force_law import ForceEquation
from rigsight.identify import FitResult
from rigsight.records.record import Record
from rigsight.simulate.model import Model


@dataclass(frozen=True, eq=False)
class Found:
    """Results of the stages of a discovery, from which its result is assembled."""

    estimation: tuple[Record, ...]
    held_out: tuple[Record, ...]
    how: str
    selection: Selection
    chosen: Trial
    judged: Trial
    final: FitResult
    inclusion: Mapping[str, float]
    force: ForceEquation | None
    same: Mapping[str, list[str]]
    held: str


def assembled(data: RegressionData, method: str, pointwise: bool, bench: Bench, found: Found) -> Discovery:
    """Return the result of a discovery: equations, terms with their doubts, alternatives, free runs, model."""
    rig, final, selection = data.rig, found.final, found.selection
    output = rig.outputs[0].name
    structure = final.structure
    text, latex = equations(structure, held_numbers(final))
    own = {p.name for p in rig.parameters}
    units = {p.name: p.unit for p in structure.parameters}
    coefficients = {
        name: Coefficient(final.values[name], final.standard_errors[name], units[name]) for name in final.free
    }
    terms = _terms(bench, found, coefficients)
    measured = np.concatenate([record[output] for record in found.held_out])
    size = float(np.std(measured)) or 1.0
    warnings = warnings_of(
        data,
        found.estimation,
        found.held_out,
        found.how,
        selection,
        found.chosen,
        found.judged.error_over_noise,
        terms,
        found.held,
        found.force,
        data.noise[output] / size,
        next(iter(next_terms(bench, found.chosen.support)), ""),
    )
    return Discovery(
        title=data.campaign.title,
        rig=rig.name,
        method=method,
        form="pointwise" if pointwise else "weak",
        equations=text,
        latex=latex,
        rig_parameters={name: c for name, c in coefficients.items() if name in own},
        terms=terms,
        alternatives=tuple(_alternative(trial, selection) for trial in selection.trials),
        force_equation={} if found.force is None else dict(found.force.inclusion),
        held_out=tuple(record.name for record in found.held_out),
        held_out_error=found.judged.error_over_noise,
        held_out_nrmse=found.judged.error_over_noise * data.noise[output] / size,
        noise_floor=data.noise[output] / size,
        independent=selection.independent,
        runs=_runs(bench, found, output),
        output=output,
        unit=rig.outputs[0].unit,
        model=Model.of(structure, final.values, found.estimation[0].hold).to_json(),
        warnings=warnings,
    )


def _terms(bench: Bench, found: Found, coefficients: Mapping[str, Coefficient]) -> tuple[Term, ...]:
    structure = found.final.structure
    kept = {effect.name for effect in structure.effects}
    terms = []
    for name in bench.own_terms:
        stays = name in coefficients
        own = {name: coefficients[name]} if stays else {}
        terms.append(Term(name, "The rig's own.", stays, found.inclusion.get(name, 0.0), own))
    for effect in structure.effects:
        names = [structure.parameter_name(effect, p.name) for p in effect.parameters]
        own = {name: coefficients[name] for name in names if name in coefficients}
        terms.append(
            Term(
                effect.name, effect.summary, True, found.inclusion.get(effect.name, 0.0), own,
                doubts(effect, own, found.inclusion.get(effect.name, 0.0), found.same.get(effect.name, [])),
            )
        )  # fmt: skip
    rest = sorted(set(found.inclusion) - kept - set(bench.own_terms), key=lambda n: (-found.inclusion[n], n))
    terms += [Term(n, bench.candidates[n].effect.summary, False, found.inclusion[n], {}) for n in rest]
    return tuple(terms)


def _alternative(trial: Trial, selection: Selection) -> Alternative:
    bic = criterion(trial, selection.independent)
    aic = bic - trial.n_free * (math.log(selection.independent) - 2.0)
    return Alternative(tuple(sorted(trial.support)), trial.n_free, trial.error_over_noise, aic, bic)


def _runs(bench: Bench, found: Found, output: str) -> tuple[Run, ...]:
    """Return the free runs of the chosen model on the held-out records."""
    ends = np.cumsum([record.n_samples for record in found.held_out])
    parts = np.split(found.judged.residuals * bench.noise[output], ends[:-1])
    return tuple(
        Run(
            record.name,
            record.role,
            record.t,
            record[output],
            record[output] - error,
            output,
            bench.rig.outputs[0].unit,
        )
        for record, error in zip(found.held_out, parts, strict=True)
    )

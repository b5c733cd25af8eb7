"""The content of `identification.json`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from scipy.stats import norm

from rigsight.identify.hysteresis.derived import Derived
from rigsight.identify.identification import (
    HysteresisIdentification,
    Identification,
    JointIdentification,
    PathIdentification,
    RecordIdentification,
)
from rigsight.identify.transfer.conicity import ConicityEstimate
from rigsight.identify.transfer.running_gear_parameters import LEVEL, PhysicalEstimates
from rigsight.identify.transfer.transfer_fit import TransferFit
from rigsight.workflow.identification.linear_json import (
    finite,
    identifiability_json,
    response_json,
    view_json,
)

SCHEMA_VERSION = 1


def identification_json(identification: Identification, figures: Mapping[str, str]) -> dict[str, Any]:
    """Return the content of ``identification.json``."""
    units = identification.units
    reported = identification.identifiability
    # Rigs of one motion with transfer functions of their own have neither.
    of_any_rig = (
        {}
        if reported is None
        else {
            "identifiability": identifiability_json(reported),
            "linear": [view_json(view, units) for view in identification.views],
        }
    )
    return {
        "schema_version": SCHEMA_VERSION,
        "title": identification.title,
        "rig": identification.rig,
        "effects": list(identification.model["effects"]),
        "method": identification.method,
        "level": LEVEL,
        "warnings": list(identification.warnings),
        "amplitudes": {
            "statement": identification.amplitude_statement,
            "changing": list(identification.changing),
            "table": [_row(record, units) for record in identification.records],
        },
        "joint": _joint(identification, units),
        "validation": [
            {"record": s.record, "amplitude": finite(s.amplitude), "nrmse": _all_finite(s.nrmse)}
            for s in identification.joint.scores
            if s.role == "validation"
        ],
        "records": [_record(record, units) for record in identification.records],
        **of_any_rig,
        **(
            {}
            if identification.hysteresis is None
            else {"hysteresis": hysteresis_json(identification.hysteresis)}
        ),
        "figures": dict(figures),
    }


def _all_finite(values: Mapping[str, float]) -> dict[str, float | None]:
    return {name: finite(value) for name, value in values.items()}


def _row(found: RecordIdentification, units: Mapping[str, str]) -> dict[str, Any]:
    return {
        "record": found.record.name,
        "kind": found.record.kind,
        "amplitude": finite(found.amplitude),
        **{
            name: {"value": value, "std": finite(error), "unit": units.get(name, "")}
            for name, (value, error) in found.estimates.items()
        },
        "resonance": finite(found.resonance),
    }


def _record(found: RecordIdentification, units: Mapping[str, str]) -> dict[str, Any]:
    return {
        "record": found.record.name,
        "kind": found.record.kind,
        "amplitude": finite(found.amplitude),
        "identified": found.is_identified,
        "warnings": list(found.warnings),
        "paths": [_path(path, units) for path in found.paths],
        "offsets": None if found.offsets is None else _physical(found.offsets, units),
        "delta_0": None if found.conicity is None else _conicity(found.conicity),
        **({} if found.own is None else {"parameters": _physical(found.own, units)}),
    }


def _path(path: PathIdentification, units: Mapping[str, str]) -> dict[str, Any]:
    return {
        "source": path.source,
        "response": path.response,
        "problem": path.problem,
        "fit": None if path.fit is None else _fit(path.fit),
        "physical": None if path.physical is None else _physical(path.physical, units),
        "frequency_response": None if path.measured is None else response_json(path.measured),
        "coherence": None
        if path.coherence is None or path.coherence.coherence is None
        else {
            "method": path.coherence.method,
            "omega": path.coherence.omega.tolist(),
            "values": path.coherence.coherence.tolist(),
        },
    }


def _fit(fit: TransferFit) -> dict[str, Any]:
    return {
        "form": fit.form.order.upper(),
        "gain_unit": fit.unit,
        "method": fit.method,
        "message": fit.message,
        "misfit": finite(fit.misfit),
        "values": fit.values,
        "std": _all_finite(fit.standard_errors),
    }


def _physical(found: PhysicalEstimates, units: Mapping[str, str]) -> dict[str, Any]:
    errors = found.standard_errors
    return {
        name: {
            "value": found.values[name],
            "std": finite(errors[name]),
            "interval": [finite(end) for end in found.interval(name)],
            "unit": units.get(name, ""),
            "method": found.method,
        }
        for name in found.names
    }


def _conicity(found: ConicityEstimate) -> dict[str, Any]:
    return {
        "value": found.value,
        "unbounded": finite(found.unbounded),
        "std": finite(found.standard_error),
        "interval": None if found.interval is None else list(found.interval),
        "determined": found.determined,
        "statement": found.statement,
        "unit": "rad",
    }


def _joint(identification: Identification, units: Mapping[str, str]) -> dict[str, Any]:
    joint, fit = identification.joint, identification.joint.fit
    reached = {bound.name: bound for bound in identification.reached}
    return {
        "statement": joint.statement,
        "probability": finite(fit.probability),
        "success": fit.fit.success,
        "message": fit.fit.message,
        "left_out": list(joint.left_out),
        "parameters": {
            name: {
                "value": fit.fit.values[name],
                "given": identification.given.get(name),
                "std": finite(fit.fit.standard_errors[name]),
                "interval": [finite(end) for end in fit.interval(name)],
                "unit": units.get(name, ""),
                **({"at_bound": reached[name].side, "asked": reached[name].asked} if name in reached else {}),
            }
            for name in joint.names
        },
        "pooled": {} if joint.pooled is None else _physical(joint.pooled, units),
        "delta_0": None if joint.conicity is None else _conicity(joint.conicity),
        "residual_std": _all_finite(fit.noise),
        "records": _scores(joint),
    }


def _scores(joint: JointIdentification) -> Sequence[dict[str, Any]]:
    shifts = {kind.kind: kind.shift for kind in joint.fit.kinds}
    alone = {kind.kind: kind.fit.values for kind in joint.fit.kinds}
    return [
        {
            "record": score.record,
            "nrmse": _all_finite(score.nrmse),
            "nrmse_alone": _all_finite(score.own_nrmse),
            "values_alone": {name: alone[score.record][name] for name in joint.names},
            "shift_in_std": _all_finite(shifts[score.record]),
        }
        for score in joint.scores
        if score.role == "estimation"
    ]


def hysteresis_json(found: HysteresisIdentification) -> dict[str, Any]:
    """Return the content of the key ``hysteresis``."""
    fit, derived = found.calibration.fit, found.calibration.derived
    width = float(norm.ppf(0.5 + 0.5 * LEVEL))
    errors = fit.standard_errors
    return {
        "effects": list(found.effects),
        "statement": found.statement,
        "success": fit.success,
        "message": fit.message,
        "parameters": {
            name: {
                "value": fit.values[name],
                "std": finite(errors[name]),
                "interval": [
                    finite(fit.values[name] - width * errors[name]),
                    finite(fit.values[name] + width * errors[name]),
                ],
                "unit": found.units[name],
            }
            for name in fit.free
        },
        "held": dict(found.held),
        "covariance": {
            "parameters": list(fit.free),
            "values": [[finite(value) for value in row] for row in fit.covariance],
        },
        "derived": {
            "pairs": {pair.name: _derived(pair) for pair in derived.pairs},
            "saturation": None
            if derived.saturation is None
            else {**_derived(derived.saturation), "statement": derived.saturation_in_words},
            "loop_areas": [
                {"amplitude": area.amplitude, **_derived(area.energy)} for area in derived.loop_areas
            ],
        },
        "records": [
            {
                "record": score.record,
                "role": score.role,
                "nrmse_without": _all_finite(score.without),
                "nrmse": _all_finite(score.nrmse),
            }
            for score in found.scores
        ],
        "minima": [
            {"values": dict(minimum.values), "cost": finite(minimum.cost)}
            for minimum in found.calibration.minima
        ],
    }


def _derived(one: Derived) -> dict[str, Any]:
    return {
        "value": finite(one.value),
        "interval": [finite(one.lower), finite(one.upper)],
        "unit": one.unit,
    }

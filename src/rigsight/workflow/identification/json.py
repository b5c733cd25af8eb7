"""The content of `identification.json`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rigsight.frequency import FrequencyResponse
from rigsight.frequency.signal_pair import ratio_unit
from rigsight.identify.fit.covariance import LEVEL, normal_interval
from rigsight.identify.hysteresis.derived import Derived
from rigsight.identify.identifiability import Identifiability
from rigsight.identify.identification import (
    HysteresisIdentification,
    Identification,
    JointIdentification,
    PathIdentification,
    RecordIdentification,
)
from rigsight.identify.linear_view import LinearView
from rigsight.identify.transfer.conicity import ConicityEstimate
from rigsight.identify.transfer.physical_parameters import PhysicalEstimates
from rigsight.identify.transfer.transfer_form import TransferFit
from rigsight.json_data import json_data

SCHEMA_VERSION = 1


def identification_json(identification: Identification, figures: Mapping[str, str]) -> dict[str, Any]:
    """Return the content of ``identification.json``."""
    units = identification.units
    content: dict[str, Any] = {
        "schema_version": SCHEMA_VERSION,
        "title": identification.title,
        "rig": identification.rig,
        "effects": identification.model["effects"],
        "method": identification.method,
        # Of a free run; 0 where initial states are fitted.
        "initial_samples": identification.records[0].record.starting_samples,
        "level": LEVEL,
        "warnings": identification.warnings,
        "amplitudes": {
            "statement": identification.amplitude_statement,
            "changing": identification.changing,
            "table": [_row(record, units) for record in identification.records],
        },
        "joint": _joint(identification, units),
        "validation": [
            {"record": s.record, "amplitude": s.amplitude, "nrmse": s.nrmse}
            for s in identification.joint.scores
            if s.role == "validation"
        ],
        "records": [_record(record, units) for record in identification.records],
    }
    # A fit that failed determines nothing.
    if identification.identifiability is not None:
        content["identifiability"] = _identifiability(identification.identifiability)
        content["linear"] = [_view(view, units) for view in identification.views]
    if identification.hysteresis is not None:
        content["hysteresis"] = _hysteresis(identification.hysteresis)
    return json_data({**content, "figures": figures})


def _row(found: RecordIdentification, units: Mapping[str, str]) -> dict[str, Any]:
    return {
        "record": found.record.name,
        "kind": found.record.kind,
        "amplitude": found.amplitude,
        **{
            name: {"value": value, "std": error, "unit": units.get(name, "")}
            for name, (value, error) in found.estimates.items()
        },
        "resonance": found.resonance,
    }


def _record(found: RecordIdentification, units: Mapping[str, str]) -> dict[str, Any]:
    return {
        "record": found.record.name,
        "kind": found.record.kind,
        "amplitude": found.amplitude,
        "identified": found.is_identified,
        "warnings": found.warnings,
        "paths": [_path(path, units) for path in found.paths],
        "offsets": found.offsets and _physical(found.offsets, units),
        "delta_0": found.conicity and _conicity(found.conicity),
        **({"parameters": _physical(found.own, units)} if found.own else {}),
    }


def _path(path: PathIdentification, units: Mapping[str, str]) -> dict[str, Any]:
    coherence = path.coherence
    return {
        "source": path.source,
        "response": path.response,
        "problem": path.problem,
        "fit": path.fit and _fit(path.fit),
        "physical": path.physical and _physical(path.physical, units),
        "frequency_response": path.measured and _frequency_response(path.measured),
        "coherence": None
        if coherence is None or coherence.coherence is None
        else {"method": coherence.method, "omega": coherence.omega, "values": coherence.coherence},
    }


def _fit(fit: TransferFit) -> dict[str, Any]:
    return {
        "form": fit.form.order.upper(),
        "gain_unit": fit.unit,
        "method": fit.method,
        "message": fit.message,
        "misfit": fit.misfit,
        "values": fit.values,
        "std": fit.standard_errors,
    }


def _physical(found: PhysicalEstimates, units: Mapping[str, str]) -> dict[str, Any]:
    return {
        name: {
            "value": found.values[name],
            "std": found.standard_errors[name],
            "interval": found.interval(name),
            "unit": units.get(name, ""),
            "method": found.method,
        }
        for name in found.names
    }


def _conicity(found: ConicityEstimate) -> dict[str, Any]:
    return {
        "value": found.value,
        "unbounded": found.unbounded,
        "std": found.standard_error,
        "interval": found.interval,
        "determined": found.determined,
        "statement": found.statement,
        "unit": "rad",
    }


def _joint(identification: Identification, units: Mapping[str, str]) -> dict[str, Any]:
    joint, fit = identification.joint, identification.joint.fit
    reached = {bound.name: bound for bound in identification.reached}
    return {
        "statement": joint.statement,
        "probability": fit.probability,
        "success": fit.fit.success,
        "message": fit.fit.message,
        # Every estimation record is fitted; the key is that of older files.
        "left_out": [],
        "parameters": {
            name: {
                "value": fit.fit.values[name],
                "given": identification.given.get(name),
                "std": fit.fit.standard_errors[name],
                "interval": fit.interval(name),
                "unit": units.get(name, ""),
                **({"at_bound": reached[name].side, "asked": reached[name].asked} if name in reached else {}),
            }
            for name in joint.names
        },
        "pooled": {} if joint.pooled is None else _physical(joint.pooled, units),
        "delta_0": joint.conicity and _conicity(joint.conicity),
        "residual_std": fit.noise,
        "records": _scores(joint),
    }


def _scores(joint: JointIdentification) -> Sequence[dict[str, Any]]:
    shifts = {kind.kind: kind.shift for kind in joint.fit.kinds}
    alone = {kind.kind: kind.fit.values for kind in joint.fit.kinds}
    return [
        {
            "record": score.record,
            "nrmse": score.nrmse,
            "nrmse_alone": score.own_nrmse,
            "values_alone": {name: alone[score.record][name] for name in joint.names},
            "shift_in_std": shifts[score.record],
        }
        for score in joint.scores
        if score.role == "estimation"
    ]


def _identifiability(found: Identifiability) -> dict[str, Any]:
    return {
        "sentence": found.sentence,
        "determined": found.determined,
        "relative_std": found.relative_errors,
        "combinations": [
            {
                "combination": c.text,
                "parameters": c.members,
                "value": c.value,
                "std": c.std,
                "unit": c.unit,
            }
            for c in found.combinations
        ],
        "not_determined": found.statements,
        "free_directions": found.free_directions,
        "would_help": found.remedies,
    }


def _view(view: LinearView, units: Mapping[str, str]) -> dict[str, Any]:
    linear = view.linearization
    return {
        "constants": view.constants,
        "records": view.records,
        "at": {
            "inputs": dict(zip(linear.inputs, linear.at_inputs, strict=True)),
            "states": dict(zip(linear.states, linear.at_state, strict=True)),
            "rests": linear.rests,
        },
        "stability": linear.stability,
        "poles": [
            {
                "real": mode.pole.real,
                "imaginary": mode.pole.imag,
                "natural_frequency": mode.natural_frequency,
                "natural_frequency_std": mode.frequency_std,
                "damping_ratio": mode.damping_ratio,
                "damping_ratio_std": mode.damping_std,
            }
            for mode in view.modes
        ],
        "state_space": {
            "A": linear.state_matrix,
            "B": linear.input_matrix,
            "C": linear.output_matrix,
            "D": linear.feedthrough[0],
            "D_of_rates": linear.feedthrough[1:],
        },
        "paths": [
            _linear_path(view, source, response, units)
            for source in linear.inputs
            for response in linear.outputs
        ],
    }


def _linear_path(view: LinearView, source: str, response: str, units: Mapping[str, str]) -> dict[str, Any]:
    transfer = view.linearization.transfer_function(source, response)
    measured = None if view.measured is None else view.measured.found.get((source, response))
    values, std = view.model.get((source, response), (None, None))
    return {
        "source": source,
        "response": response,
        "problem": "" if view.measured is None else view.measured.problems.get((source, response), ""),
        "transfer_function": {
            "unit": ratio_unit(units.get(response, ""), units.get(source, "")),
            "numerator": transfer.numerator,
            "denominator": transfer.denominator,
            "zeros": [[zero.real, zero.imag] for zero in transfer.zeros],
            "poles": [[pole.real, pole.imag] for pole in transfer.poles],
        },
        "frequency_response": measured and _frequency_response(measured),
        "model_response": None
        if measured is None or values is None
        else {"omega": measured.omega, "real": values.real, "imaginary": values.imag, "std": std},
        "misfit": measured and view.misfit(source, response),
    }


def _frequency_response(response: FrequencyResponse) -> dict[str, Any]:
    return {
        "method": response.method,
        "unit": response.unit,
        "omega": response.omega,
        "real": response.values.real,
        "imaginary": response.values.imag,
        "variance": response.variance,
        "coherence": response.coherence,
    }


def _hysteresis(found: HysteresisIdentification) -> dict[str, Any]:
    fit, derived = found.calibration.fit, found.calibration.derived
    errors = fit.standard_errors
    return {
        "effects": found.effects,
        "statement": found.statement,
        "success": fit.success,
        "message": fit.message,
        "parameters": {
            name: {
                "value": fit.values[name],
                "std": errors[name],
                "interval": normal_interval(fit.values[name], errors[name]),
                "unit": found.units[name],
            }
            for name in fit.free
        },
        "held": found.held,
        "covariance": {"parameters": fit.free, "values": fit.covariance},
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
                "nrmse_without": score.without,
                "nrmse": score.nrmse,
            }
            for score in found.scores
        ],
        "minima": [{"values": minimum.values, "cost": minimum.cost} for minimum in found.calibration.minima],
    }


def _derived(one: Derived) -> dict[str, Any]:
    return {"value": one.value, "interval": [one.lower, one.upper], "unit": one.unit}

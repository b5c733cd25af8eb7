"""Poles, transfer functions, responses and identifiability in `identification.json`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from rigsight.frequency import FrequencyResponse
from rigsight.frequency.signal_pair import ratio_unit
from rigsight.identify.identifiability import Identifiability
from rigsight.identify.linear_view import LinearView


def finite(value: float | None) -> float | None:
    """Return None for infinite values and NaN, which JSON cannot represent."""
    return float(value) if value is not None and math.isfinite(value) else None


def identifiability_json(found: Identifiability) -> dict[str, Any]:
    """Return what the records determine."""
    return {
        "sentence": found.sentence,
        "determined": list(found.determined),
        "relative_std": {name: finite(error) for name, error in found.relative_errors.items()},
        "combinations": [
            {
                "combination": c.text,
                "parameters": list(c.members),
                "value": c.value,
                "std": finite(c.std),
                "unit": c.unit,
            }
            for c in found.combinations
        ],
        "not_determined": list(found.statements),
        "free_directions": found.free_directions,
        "would_help": list(found.remedies),
    }


def view_json(view: LinearView, units: Mapping[str, str]) -> dict[str, Any]:
    """Return the rig close to its rest in records with the same constants."""
    linear = view.linearization
    return {
        "constants": view.constants,
        "records": list(view.records),
        "at": {
            "inputs": dict(zip(linear.inputs, map(float, linear.at_inputs), strict=True)),
            "states": dict(zip(linear.states, map(float, linear.at_state), strict=True)),
            "rests": linear.rests,
        },
        "stability": linear.stability,
        "poles": [
            {
                "real": mode.pole.real,
                "imaginary": mode.pole.imag,
                "natural_frequency": mode.natural_frequency,
                "natural_frequency_std": finite(mode.frequency_std),
                "damping_ratio": finite(mode.damping_ratio),
                "damping_ratio_std": finite(mode.damping_std),
            }
            for mode in view.modes
        ],
        "state_space": {
            "A": linear.state_matrix.tolist(),
            "B": linear.input_matrix.tolist(),
            "C": linear.output_matrix.tolist(),
            "D": linear.feedthrough[0].tolist(),
            "D_of_rates": linear.feedthrough[1:].tolist(),
        },
        "paths": [
            _path(view, source, response, units) for source in linear.inputs for response in linear.outputs
        ],
    }


def _path(view: LinearView, source: str, response: str, units: Mapping[str, str]) -> dict[str, Any]:
    transfer = view.linearization.transfer_function(source, response)
    measured = None if view.measured is None else view.measured.found.get((source, response))
    values, std = view.model.get((source, response), (None, None))
    return {
        "source": source,
        "response": response,
        "problem": "" if view.measured is None else view.measured.problems.get((source, response), ""),
        "transfer_function": {
            "unit": ratio_unit(units.get(response, ""), units.get(source, "")),
            "numerator": transfer.numerator.tolist(),
            "denominator": transfer.denominator.tolist(),
            "zeros": [[float(zero.real), float(zero.imag)] for zero in transfer.zeros],
            "poles": [[float(pole.real), float(pole.imag)] for pole in transfer.poles],
        },
        "frequency_response": None if measured is None else response_json(measured),
        "model_response": None
        if measured is None or values is None or std is None
        else {
            "omega": measured.omega.tolist(),
            "real": values.real.tolist(),
            "imaginary": values.imag.tolist(),
            "std": [finite(error) for error in std],
        },
        "misfit": None if measured is None else finite(view.misfit(source, response)),
    }


def response_json(response: FrequencyResponse) -> dict[str, Any]:
    """Return a frequency response as it stands in the file."""
    return {
        "method": response.method,
        "unit": response.unit,
        "omega": response.omega.tolist(),
        "real": response.values.real.tolist(),
        "imaginary": response.values.imag.tolist(),
        "variance": None if response.variance is None else response.variance.tolist(),
        "coherence": None if response.coherence is None else response.coherence.tolist(),
    }

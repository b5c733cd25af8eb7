"""How does a rig with effects of memory stand in `identification.json`?"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from scipy.stats import norm

from rigsight.identify.hysteresis.derived import LEVEL, Derived
from rigsight.identify.identification import HysteresisIdentification
from rigsight.workflow.identification.linear_json import finite


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


def _all_finite(values: Mapping[str, float]) -> dict[str, float | None]:
    return {name: finite(value) for name, value in values.items()}

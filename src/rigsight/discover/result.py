"""Result of a discovery as data: equations, terms with intervals and inclusion probabilities, and the model."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rigsight.discover.joints.joint_force import JointForce
from rigsight.json_data import json_data
from rigsight.records import Record
from rigsight.records.record import Floats

SCHEMA_VERSION = 1


@dataclass(frozen=True)
class Coefficient:
    """A coefficient of the equation with its standard error and unit."""

    value: float
    std: float
    unit: str

    def to_json(self) -> dict[str, Any]:
        """Return the entry of ``discovery.json``; it has no interval if the value is not determined."""
        width = 1.96 * self.std
        interval = (self.value - width, self.value + width) if math.isfinite(width) else None
        return {"value": self.value, "std": self.std, "interval_95": interval, "unit": self.unit}


@dataclass(frozen=True)
class Term:
    """A term of the equation, or one that was offered but not selected."""

    name: str  # name of the effect
    summary: str  # its description in one sentence
    kept: bool  # true if it is part of the equation
    inclusion: float  # share of resampled data sets in which sparse regression selects the term
    coefficients: Mapping[str, Coefficient]  # its parameters; empty if it is not kept
    doubt: str = ""  # reasons to doubt the term; empty if there are none
    where: str = ""  # joint at which it acts; empty for a rig with one joint

    def to_json(self) -> dict[str, Any]:
        """Return the entry of ``discovery.json``."""
        return {
            "name": self.name,
            "summary": self.summary,
            "kept": self.kept,
            "inclusion_probability": self.inclusion,
            "coefficients": {name: c.to_json() for name, c in self.coefficients.items()},
            "doubt": self.doubt,
            **({"where": self.where} if self.where else {}),
        }


@dataclass(frozen=True)
class Alternative:
    """A support that was polished and scored."""

    terms: tuple[str, ...]  # names of the effects
    n_parameters: int  # number of fitted parameters
    held_out: float  # free-run error on the held-out records in units of the noise floor
    # Information criteria of that error with the number of independent samples.
    aic: float
    bic: float


@dataclass(frozen=True, eq=False)
class Run:
    """Measured and simulated output of a record in free run, shape (n_samples,) each, with the output's name and unit."""

    record: str
    role: str
    t: Floats
    measured: Floats
    simulated: Floats
    output: str
    unit: str


@dataclass(frozen=True, eq=False)
class Discovery:
    """The result of a discovery.

    Attributes
    ----------
    title, rig, method
        Title of the campaign, name of the rig, and method (``"full"`` or ``"discrepancy"``).
    form
        ``"weak"`` or ``"pointwise"``; ``"linearized responses"`` for a rig of several joints.
    equations, latex
        The equations as plain text and as LaTeX, one per state.
    rig_parameters
        The rig's own parameters.
    terms
        Terms of the equation first, then those that were offered.
    alternatives
        All supports that were polished, best first.
    force_equation
        Inclusion probability of each term in the equation of the hysteretic force; empty if there is no such force.
    held_out
        Names of the records by which supports were selected.
    held_out_error
        Free-run error on these records in units of the noise floor.
    held_out_nrmse, noise_floor
        The same error, and the noise floor, relative to the standard deviation of the measured output (dimensionless).
    independent
        Number of independent samples of that error (dimensionless, not an integer).
    runs
        Free runs of the model, for plots.
    output, unit
        Name and unit of the first output.
    model
        Content of ``model.json``.
    warnings
        Warnings before the equations are used, one sentence each.
    joints
        Missing force per joint, with the joint of the equation first; empty for a rig with one joint.
    by_record
        Result for each record alone, or the reason why there is none; empty unless requested.
    given
        Parameter values of the given simulation, to compare with.
    records
        The records of the campaign.
    """

    title: str
    rig: str
    method: str
    form: str
    equations: tuple[str, ...]
    latex: tuple[str, ...]
    rig_parameters: Mapping[str, Coefficient]
    terms: tuple[Term, ...]
    alternatives: tuple[Alternative, ...]
    force_equation: Mapping[str, float]
    held_out: tuple[str, ...]
    held_out_error: float
    held_out_nrmse: float
    noise_floor: float
    independent: float
    runs: tuple[Run, ...]
    output: str
    unit: str
    model: Mapping[str, Any]
    warnings: tuple[str, ...]
    joints: tuple[JointForce, ...] = ()
    by_record: tuple[tuple[str, Discovery | str], ...] = ()
    given: Mapping[str, float] = field(default_factory=dict)
    records: tuple[Record, ...] = ()

    @property
    def kept(self) -> tuple[Term, ...]:
        """The terms of the equation."""
        return tuple(term for term in self.terms if term.kept)

    def to_json(self) -> dict[str, Any]:
        """Return the content of ``discovery.json``."""
        content = {
            "schema_version": SCHEMA_VERSION,
            "title": self.title,
            "rig": self.rig,
            "method": self.method,
            "form": self.form,
            "equations": self.equations,
            "latex": self.latex,
            "rig_parameters": {
                name: {**c.to_json(), "given": self.given.get(name)}
                for name, c in self.rig_parameters.items()
            },
            "terms": [term.to_json() for term in self.terms],
            "alternatives": self.alternatives,
            "force_equation": self.force_equation,
            "held_out": {
                "records": self.held_out,
                "error_in_noise_floors": self.held_out_error,
                "nrmse": self.held_out_nrmse,
                "noise_floor": self.noise_floor,
                "independent_samples": self.independent,
            },
            "warnings": self.warnings,
            "records": [
                {"record": r.name, "role": r.role, "kind": r.kind, "amplitude": r.amplitude}
                for r in self.records
            ],
            **({"joints": [joint.to_json() for joint in self.joints]} if self.joints else {}),
            "by_record": {
                name: {"error": found} if isinstance(found, str) else found.to_json()
                for name, found in self.by_record
            },
        }
        return json_data(content)

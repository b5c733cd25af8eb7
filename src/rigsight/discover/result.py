"""Result of a discovery as data: equations, terms with intervals and inclusion probabilities, and the model."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rigsight.effects import Effect, kind_of
from rigsight.json_data import json_data
from rigsight.records import Record
from rigsight.records.record import Floats

SCHEMA_VERSION = 1
RULED_OUT = 3.0
"""Factor over the smallest sensor residual (RMS) of all joints above which a force at a joint alone is not the cause."""


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
class ForceTrace:
    """The missing force of a joint along one record, shape (n_samples,) each."""

    record: str
    t: Floats  # time [s]
    displacement: Floats  # of the joint from its rest, as its velocity
    velocity: Floats
    force: Floats  # resists the joint
    standard_error: Floats
    law: Floats  # the force according to the law


@dataclass(frozen=True, eq=False)
class JointTerm:
    """A term of the law of a missing force."""

    effect: Effect  # at its joint
    coefficients: Mapping[str, Coefficient]  # its parameters by their own names
    inclusion: float | None  # as of `Term`; None if the term did not compete

    @property
    def text(self) -> str:
        """The term in words, with its parameter values."""
        kind = kind_of(self.effect.name).replace("_", " ")
        numbers = ", ".join(f"{name} = {c.value:.3g} {c.unit}" for name, c in self.coefficients.items())
        if self.effect.torque is None:
            return f"that of {kind} ({numbers})"
        shape = str(self.effect.torque).replace("**", "^").replace("*", " ")
        return f"{shape} ({kind}: {numbers})"

    def to_json(self) -> dict[str, Any]:
        """Return the entry of a file."""
        return {
            "name": kind_of(self.effect.name),
            "where": self.effect.at,
            "coefficients": {
                name: {"value": c.value, "std": c.std if math.isfinite(c.std) else None, "unit": c.unit}
                for name, c in self.coefficients.items()
            },
            "inclusion_probability": self.inclusion,
        }


@dataclass(frozen=True, eq=False)
class JointForce:
    """The force missing at one joint.

    At a joint with terms of the equation that beside its other terms, at any other joint the force if all that is missing acted
    there alone.
    """

    joint: str  # its name
    x_unit: str  # of its motion
    unit: str  # of the force
    traces: tuple[ForceTrace, ...]  # force and motion, per record
    # Share of the weighted square of the free-run errors without any term that the force explains; all sensors together.
    share: float
    # Remaining sensor residual, RMS in units of the noise floors; far above 1, a force at this joint alone is not the cause.
    error_over_noise: float
    standard_error: float  # RMS of that of the force
    terms: tuple[JointTerm, ...]  # its law: the terms of the equation that act there
    share_of_force: float  # of the force's mean square that they explain
    # Of the best equation with terms at this joint alone, as the BIC of an alternative; None if there is none.
    criterion: float | None

    @property
    def sentence(self) -> str:
        """The finding in words."""
        if not self.terms:
            remainder = f"{self.error_over_noise:.3g} times the noise floor"
            return f"No term acts at {self.joint}: a force there alone would leave {remainder}."
        reported = " and ".join(term.text for term in self.terms)
        return (
            f"The force missing at {self.joint} is best described by {reported}, which explains {self.share_of_force:.0%} (x and "
            f"v of the joint)."
        )

    def to_json(self) -> dict[str, Any]:
        """Return the entry of a file, without the traces."""
        return {
            "where": self.joint,
            "share": self.share,
            "error_in_noise_floors": self.error_over_noise,
            "standard_error": {"value": self.standard_error, "unit": self.unit},
            "criterion": self.criterion,
            "terms": [term.to_json() for term in self.terms],
            "share_of_force": self.share_of_force,
            "sentence": self.sentence,
        }


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

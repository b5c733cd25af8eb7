"""Result of a discovery as data: equations, terms with intervals and inclusion probabilities, and the model."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rigsight.effects import Effect
from rigsight.inverse import MissingForce
from rigsight.json_data import json_data
from rigsight.records import Record
from rigsight.records.record import Floats

SCHEMA_VERSION = 2
SHAPE_FILE, LAWS_FILE = "shape.py", "discovered.py"
"""Effects of one's own that are written beside ``discovery.json``: an offered shape, and the powers of the equation."""


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
    inclusion: (
        float | None
    )  # share of resampled records in which sparse regression selects it; None if it did not compete
    coefficients: Mapping[str, Coefficient]  # its parameters; empty if it is not kept
    doubt: str = ""  # reasons to doubt the term; empty if there are none
    where: str = ""  # joint at which it acts; empty for a rig with one joint
    family: str = ""  # as of a diagnosis; empty for a power of the motion
    # Held-out error, in noise floors, of the equation without the term if it is kept, else with it; NaN if that was not tried.
    otherwise: float = math.nan

    def to_json(self) -> dict[str, Any]:
        """Return the entry of ``discovery.json``."""
        return {
            "name": self.name,
            "summary": self.summary,
            "kept": self.kept,
            "inclusion_probability": self.inclusion,
            "coefficients": {name: c.to_json() for name, c in self.coefficients.items()},
            "doubt": self.doubt,
            "family": self.family or None,
            "error_without_it" if self.kept else "error_with_it": self.otherwise
            if math.isfinite(self.otherwise)
            else None,
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


@dataclass(frozen=True)
class HeldOut:
    """The free-run error on one held-out record, all outputs together."""

    record: str
    error_over_noise: float  # in units of the noise floors
    nrmse: float  # relative to the standard deviation of the measured outputs

    def to_json(self) -> dict[str, Any]:
        """Return an entry of ``held_out.by_record``."""
        return {
            "record": self.record,
            "error_in_noise_floors": self.error_over_noise,
            "nrmse": self.nrmse,
        }


@dataclass(frozen=True, eq=False)
class JointForce:
    """The force missing at one joint along the measured motion, beside the terms that the equation has elsewhere."""

    missing: MissingForce
    law: Floats  # what the terms of the equation at this joint give, at the samples of the force
    terms: tuple[str, ...]  # their names

    @property
    def joint(self) -> str:
        """Name of the joint."""
        return self.missing.where

    @property
    def share_of_force(self) -> float:
        """Share of the force's mean square that the law explains."""
        whole = float(np.sum(self.missing.force**2))
        left = float(np.sum((self.missing.force - self.law) ** 2))
        return max(0.0, 1.0 - left / whole) if self.terms and whole > 0.0 else 0.0

    @property
    def sentence(self) -> str:
        """The finding in words."""
        size = f"{self.missing.rms:.3g} {self.missing.unit}"
        if not self.terms:
            return f"No term acts at {self.joint}. What the equation leaves there: {size}, RMS."
        law = " and ".join(name.replace("_", " ") for name in self.terms)
        return f"{self.share_of_force:.0%} of the square of what is missing at {self.joint} ({size}, RMS) is {law}."

    def to_json(self) -> dict[str, Any]:
        """Return the entry of a file."""
        return {
            **self.missing.to_json(),
            "terms": self.terms,
            "share_of_force": self.share_of_force,
            "sentence": self.sentence,
        }


@dataclass(frozen=True, eq=False)
class OfferedShape:
    """A law of one argument that explains clearly more of the missing force than the equation: an effect for `--effects`."""

    effect: Effect  # a sum of sigmoids, without a place
    equation: str  # its force as Python text
    argument: str  # displacement or velocity
    in_place_of: tuple[str, ...]  # laws of the same argument that the equation has at this joint
    n_knots: int
    share: float  # of the square of the missing force along the held-out motion that it explains
    # Held-out error of the equation in noise floors, before and with it.
    error_before: float
    error_over_noise: float
    force: JointForce  # the missing force at its joint beside the fit with it

    @property
    def sentence(self) -> str:
        """The offer in words."""
        others = ", ".join(name.replace("_", " ") for name in self.in_place_of)
        better = self.error_over_noise < self.error_before
        return (
            f"A function of the {self.argument} alone at {self.force.joint} explains {100.0 * self.share:.4g} % of the square of "
            f"what is missing there on the held-out records ({self.n_knots} knot{'s' if self.n_knots > 1 else ''}). With it"
            f"{f' in place of {others}' if others else ''} free runs leave {self.error_over_noise:.3g} noise floors, without it "
            f"{self.error_before:.3g}{'' if better else ': they do not prefer it'}. {SHAPE_FILE} declares it: {_use(SHAPE_FILE)}"
        )

    def to_json(self) -> dict[str, Any]:
        """Return the entry of ``discovery.json``."""
        return {
            "file": SHAPE_FILE,
            "effect": self.effect.name,
            "equation": self.equation,
            "where": self.force.joint,
            "argument": self.argument,
            "in_place_of": self.in_place_of,
            "n_knots": self.n_knots,
            "share_of_force": self.share,
            "error_in_noise_floors": {"before": self.error_before, "with_it": self.error_over_noise},
            "sentence": self.sentence,
        }


@dataclass(frozen=True, eq=False)
class Discovery:
    """The result of a discovery.

    Attributes
    ----------
    title, rig
        Title of the campaign and name of the rig.
    equations, latex
        The equations as plain text and as LaTeX, one per state.
    rig_parameters
        The rig's own parameters.
    terms
        Terms of the equation first, then those that were offered.
    alternatives
        All supports that were polished, best first.
    held_out
        Error on each record by which supports were selected.
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
        Missing force per joint, those with terms first; empty where the sensors do not show the motion.
    offered
        Shape of what the equation lacks; None if nothing clear is missing, or it is no function of one argument.
    own_laws
        Powers of the equation, which name no cause, as effects for a diagnosis.
    by_record
        Result for each record alone, or the reason why there is none; empty unless requested.
    given
        Parameter values of the given simulation, to compare with.
    records
        The records of the campaign.
    """

    title: str
    rig: str
    equations: tuple[str, ...]
    latex: tuple[str, ...]
    rig_parameters: Mapping[str, Coefficient]
    terms: tuple[Term, ...]
    alternatives: tuple[Alternative, ...]
    held_out: tuple[HeldOut, ...]
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
    offered: OfferedShape | None = None
    own_laws: tuple[Effect, ...] = ()
    by_record: tuple[tuple[str, Discovery | str], ...] = ()
    given: Mapping[str, float] = field(default_factory=dict)
    records: tuple[Record, ...] = ()

    @property
    def laws_sentence(self) -> str:
        """What can be done with the powers of the equation, in words; empty if there are none."""
        if not self.own_laws:
            return ""
        return (
            f"{LAWS_FILE} declares the powers of the equation as candidates of a diagnosis: {_use(LAWS_FILE)}"
        )

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
            "equations": self.equations,
            "latex": self.latex,
            "rig_parameters": {
                name: {**c.to_json(), "given": self.given.get(name)}
                for name, c in self.rig_parameters.items()
            },
            "terms": [term.to_json() for term in self.terms],
            "alternatives": self.alternatives,
            "held_out": {
                "records": [own.record for own in self.held_out],
                "by_record": [own.to_json() for own in self.held_out],
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
            "joints": [joint.to_json() for joint in self.joints],
            "offered_shape": None if self.offered is None else self.offered.to_json(),
            "own_laws": {
                "file": LAWS_FILE,
                "effects": {law.name: str(law.torque) for law in self.own_laws},
                "sentence": self.laws_sentence,
            }
            if self.own_laws
            else None,
            "by_record": {
                name: {"error": found} if isinstance(found, str) else found.to_json()
                for name, found in self.by_record
            },
        }
        return json_data(content)


def _use(file: str) -> str:
    return f"'rigsight diagnose CAMPAIGN --effects {file}', and likewise 'rigsight discover'."

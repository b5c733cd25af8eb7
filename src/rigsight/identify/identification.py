"""Result of the identification of a campaign: each record alone, all of them together, and warnings."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from rigsight.frequency import FrequencyResponse
from rigsight.identify.hysteresis.calibration import Calibration
from rigsight.identify.identifiability import Identifiability
from rigsight.identify.information import ReachedBound
from rigsight.identify.joint import JointFit
from rigsight.identify.linear_view import LinearView
from rigsight.identify.transfer.conicity import ConicityEstimate
from rigsight.identify.transfer.physical_parameters import PhysicalEstimates
from rigsight.identify.transfer.transfer_form import TransferFit
from rigsight.records.record import Record


@dataclass(frozen=True, eq=False)
class PathIdentification:
    """One signal path of one record."""

    # The signals.
    source: str
    response: str
    measured: FrequencyResponse | None = None  # frequency response; None for a step, or if there is none
    coherence: FrequencyResponse | None = None  # h1 with its coherence; None if it was not estimated
    fit: TransferFit | None = None  # PT2 or PT1; None if it failed
    physical: PhysicalEstimates | None = None  # physical parameters of the fit; None if it failed
    problem: str = ""  # reason why there is no fit, in words; empty if there is one


@dataclass(frozen=True, eq=False)
class RecordIdentification:
    """Results of one estimation record alone."""

    record: Record
    amplitude: float  # amplitude of its input, as given or measured; for a free motion that of its output
    paths: tuple[PathIdentification, ...]  # the path to the motion first, then the paths from the motion
    offsets: PhysicalEstimates | None = None  # rest positions, of `own`; None if there are none
    conicity: ConicityEstimate | None = None  # delta_0 with its statement; None if c_y is not known
    # Angular frequency at which the measured magnitude is largest [rad/s]; None if it has no peak.
    resonance: float | None = None
    warnings: tuple[str, ...] = ()  # warnings for the user, a sentence each
    # Parameters of a fit of this record alone, in the time domain; None if it failed.
    own: PhysicalEstimates | None = None
    moved: str = ""  # the output to which the amplitude of a free motion refers

    @property
    def is_identified(self) -> bool:
        """True if it gave parameters: from its motion for a rig with one motion, from a fit in the time domain for others."""
        return self.own is not None or (bool(self.paths) and not self.motion.problem)

    @property
    def source(self) -> str:
        """The signal to which its amplitude refers: an input, or the output of a free motion."""
        return self.paths[0].source if self.paths else self.moved

    @property
    def motion(self) -> PathIdentification:
        """The path from the input to the motion."""
        return self.paths[0]

    @property
    def estimates(self) -> dict[str, tuple[float, float]]:
        """Value and standard error of every physical parameter found, by name."""
        found: dict[str, tuple[float, float]] = {}
        for part in (self.own, *(path.physical for path in self.paths)):
            if part is not None:
                errors = part.standard_errors
                found.update({name: (part.values[name], errors[name]) for name in part.names})
        return found


@dataclass(frozen=True)
class RecordScore:
    """Free-run error of the joint model on one record."""

    # Name and role of the record.
    record: str
    role: str
    amplitude: float  # amplitude of its input
    # RMS of measured minus simulated over the RMS of the measured about its mean, by output.
    nrmse: dict[str, float]
    own_nrmse: dict[str, float]  # the same for the fit of this record alone; empty for a validation record


@dataclass(frozen=True, eq=False)
class JointIdentification:
    """One parameter set for all estimation records."""

    fit: JointFit  # the joint fit, with a fit of each record alone
    names: tuple[str, ...]  # the fitted parameters
    # Parameters of what follows the motion that the fit held at the mean of the single records' estimates: if no set fits all
    # records, a wrong yaw angle would bias them. None if they were fitted with the others, or not at all.
    pooled: PhysicalEstimates | None
    statement: str  # whether one set fits all records, and which records differ, in words
    conicity: ConicityEstimate | None  # delta_0 with its statement; None if c_y is not known
    scores: tuple[RecordScore, ...]  # score of every record


@dataclass(frozen=True)
class EffectScore:
    """Free-run error on one record without and with effects."""

    # Name and role of the record.
    record: str
    role: str
    without: dict[str, float]  # NRMSE of the joint fit of the rig alone, by output
    nrmse: dict[str, float]  # the same with the effects


@dataclass(frozen=True, eq=False)
class HysteresisIdentification:
    """The rig with hysteresis effects, calibrated to the records of the joint fit."""

    effects: tuple[str, ...]  # names of the effects, along the signal path
    calibration: Calibration  # parameters of rig and effects, and quantities derived from them
    # Values of parameters of effects that were not fitted, or that the fit left at their special values.
    held: dict[str, float]
    units: dict[str, str]  # unit of every parameter
    meanings: dict[str, str]  # meaning of each parameter
    statement: str  # reduction of the error by the effects, in words
    scores: tuple[EffectScore, ...]  # score of every record


@dataclass(frozen=True, eq=False)
class Identification:
    """The result of ``rigsight identify``.

    Attributes
    ----------
    title
        Title of the campaign.
    rig
        Name of the rig.
    method
        Method by which frequency responses were estimated.
    units
        Unit by parameter and signal.
    records
        Estimation records in the order of the campaign.
    amplitude_statement
        Whether the parameters change with the amplitude, in one sentence.
    changing
        Names of those that do.
    joint
        One set for all records.
    model
        Content of ``model.json``.
    warnings
        All warnings, each with the name of its record.
    reached
        Parameters of the joint fit that stand at a bound which the records ask them to pass.
    views
        The linearized rig, for each set of constants of the records; empty if the fit failed.
    identifiability
        Parameters that the records determine together; None if the fit failed.
    meanings
        Meaning of each parameter, by name.
    hysteresis
        The rig with hysteresis effects; None if not requested. If there is one, it is the `model`.
    given
        Parameter values of the given simulation, to compare with.
    """

    title: str
    rig: str
    method: str
    units: dict[str, str]
    records: tuple[RecordIdentification, ...]
    amplitude_statement: str
    changing: tuple[str, ...]
    joint: JointIdentification
    model: dict[str, Any]
    warnings: tuple[str, ...]
    reached: tuple[ReachedBound, ...] = ()
    views: tuple[LinearView, ...] = ()
    identifiability: Identifiability | None = None
    meanings: dict[str, str] = field(default_factory=dict)
    hysteresis: HysteresisIdentification | None = None
    given: dict[str, float] = field(default_factory=dict)

"""Result of the identification of a campaign: each record alone, all of them together, and warnings."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from rigsight.frequency import FrequencyResponse
from rigsight.identify.hysteresis.calibration import Calibration
from rigsight.identify.identifiability import Identifiability
from rigsight.identify.joint import JointFit
from rigsight.identify.linear_view import LinearView
from rigsight.identify.transfer.conicity import ConicityEstimate
from rigsight.identify.transfer.running_gear_parameters import PhysicalEstimates
from rigsight.identify.transfer.transfer_fit import TransferFit
from rigsight.records.record import Record


@dataclass(frozen=True, eq=False)
class PathIdentification:
    """One signal path of one record.

    Attributes
    ----------
    source, response
        The signals.
    measured
        Frequency response; None for a step, or where there is none.
    coherence
        H1 with its coherence; None where it was not estimated.
    fit
        PT2 or PT1; None where it failed.
    physical
        Physical parameters of the fit; None where it failed.
    problem
        Why there is no fit, in words; empty where there is one.
    """

    source: str
    response: str
    measured: FrequencyResponse | None = None
    coherence: FrequencyResponse | None = None
    fit: TransferFit | None = None
    physical: PhysicalEstimates | None = None
    problem: str = ""


@dataclass(frozen=True, eq=False)
class RecordIdentification:
    """Results of one estimation record alone.

    Attributes
    ----------
    record
        The record.
    amplitude
        Amplitude of its input; as given, else measured. Of a free motion that of its output.
    paths
        The motion first, then what it drives.
    offsets
        Rest positions by (2.26) and (2.27); None where there are none.
    conicity
        delta_0 with its statement; None where c_y is not known.
    resonance
        Angular frequency at which the measured magnitude is largest [rad/s]; None where it has no peak.
    warnings
        What the user must know, a sentence each.
    own
        Parameters of a fit of this record alone, over time; None where they follow from `paths`, or where it failed.
    moved
        The output that its amplitude is of, where nothing drives it.
    """

    record: Record
    amplitude: float
    paths: tuple[PathIdentification, ...]
    offsets: PhysicalEstimates | None = None
    conicity: ConicityEstimate | None = None
    resonance: float | None = None
    warnings: tuple[str, ...] = ()
    own: PhysicalEstimates | None = None
    moved: str = ""

    @property
    def is_identified(self) -> bool:
        """True if it gave parameters: of a rig with one motion its motion, of others a fit over time."""
        return self.own is not None or (bool(self.paths) and not self.motion.problem)

    @property
    def source(self) -> str:
        """The signal that its amplitude is of: an input, or the output that moves freely."""
        return self.paths[0].source if self.paths else self.moved

    @property
    def motion(self) -> PathIdentification:
        """The path from the input to the motion."""
        return self.paths[0]

    @property
    def estimates(self) -> dict[str, tuple[float, float]]:
        """Value and standard error of every physical parameter found, by name."""
        found: dict[str, tuple[float, float]] = {}
        for part in (*(path.physical for path in self.paths), self.offsets, self.own):
            if part is not None:
                errors = part.standard_errors
                found.update({name: (part.values[name], errors[name]) for name in part.names})
        return found


@dataclass(frozen=True)
class RecordScore:
    """How well the joint model follows one record in free run.

    Attributes
    ----------
    record, role
        Name and role of the record.
    amplitude
        Amplitude of its input.
    nrmse
        RMS of measured minus simulated over the RMS of the measured about its mean, by output.
    own_nrmse
        The same for the fit of this record alone; empty for a validation record.
    """

    record: str
    role: str
    amplitude: float
    nrmse: dict[str, float]
    own_nrmse: dict[str, float]


@dataclass(frozen=True, eq=False)
class JointIdentification:
    """One parameter set for all estimation records.

    Attributes
    ----------
    fit
        The joint fit, beside a fit of each record alone.
    names
        The parameters that were fitted.
    pooled
        Lateral parameters that the fit kept at the mean of the records' own: where no set serves all, a wrong yaw angle would
        spoil them. None where they were fitted with the others, or not at all.
    statement
        Does one set serve all, and which record pulls? In words.
    conicity
        delta_0 with its statement; None where c_y is not known.
    scores
        Of every record.
    left_out
        Estimation records that the fit did not use.
    """

    fit: JointFit
    names: tuple[str, ...]
    pooled: PhysicalEstimates | None
    statement: str
    conicity: ConicityEstimate | None
    scores: tuple[RecordScore, ...]
    left_out: tuple[str, ...]


@dataclass(frozen=True)
class EffectScore:
    """How well one record is followed in free run without and with effects.

    Attributes
    ----------
    record, role
        Name and role of the record.
    without
        NRMSE of the joint fit of the rig alone, by output.
    nrmse
        The same with the effects.
    """

    record: str
    role: str
    without: dict[str, float]
    nrmse: dict[str, float]


@dataclass(frozen=True, eq=False)
class HysteresisIdentification:
    """The rig with effects of memory, calibrated to the records that the joint fit used.

    Attributes
    ----------
    effects
        Names of the effects, along the signal path.
    calibration
        Parameters of rig and effects, and what follows from them.
    held
        Values of parameters of effects that were not fitted, or that the fit left at their special value.
    units
        Unit of every parameter.
    meanings
        What each parameter is.
    statement
        How much closer the records are followed with the effects, in words.
    scores
        Of every record.
    """

    effects: tuple[str, ...]
    calibration: Calibration
    held: dict[str, float]
    units: dict[str, str]
    meanings: dict[str, str]
    statement: str
    scores: tuple[EffectScore, ...]


@dataclass(frozen=True, eq=False)
class Identification:
    """The result of ``rigsight identify``.

    Attributes
    ----------
    title
        Of the campaign.
    rig
        Name of the rig.
    method
        How frequency responses were estimated.
    units
        Unit by parameter and signal.
    records
        Estimation records in the order of the campaign.
    amplitude_statement
        Do the parameters change with the amplitude? One sentence.
    changing
        Names of those that do.
    joint
        One set for all records.
    model
        Content of ``model.json``.
    warnings
        Every warning, with the record it is about.
    views
        The rig close to its rest, for each set of constants that records have; empty for the built-in rigs of one motion, whose
        transfer functions are fitted record by record.
    identifiability
        Which parameters the records determine together; None for these built-in rigs.
    meanings
        What each parameter is, by name; empty for these built-in rigs.
    hysteresis
        The rig with effects of memory; None where none was asked for. `model` is this one then.
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
    views: tuple[LinearView, ...] = ()
    identifiability: Identifiability | None = None
    meanings: dict[str, str] = field(default_factory=dict)
    hysteresis: HysteresisIdentification | None = None

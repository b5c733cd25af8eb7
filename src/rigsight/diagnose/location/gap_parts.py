"""What is a part of the gap? Shares of the squared residual by record, amplitude, time, band, state and signal path, as data."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, kw_only=True)
class GapPart:
    """Errors of the simulations in one output and one part of the records."""

    output: str
    # NRMSE; the reference is given for each kind of part. `after` is NaN where it cannot be formed.
    before: float
    reidentified: float
    after: float
    noise_floor: float
    share: float  # share of this part in the squared residual of the re-identified equations in this output
    # Share of the whole squared residual that is noise in this part; the rest of `share` is gap.
    noise_share: float
    # Unit of each key by which the gap is split, where it has one.
    units: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class RecordPart(GapPart):
    """One record, relative to its own measured RMS about the mean.

    Fitted records (`scored` is False) are listed too; their shares are relative to the fitted records. `interval` holds 95 %
    limits by stage, see `trace`. `measured_rms` and `rms`, that of the residual of the diagnosed simulation, are in the unit
    of the output; `freedom` is the number of degrees of freedom of the mean square of that residual.
    """

    record: str
    role: str
    kind: str
    amplitude: float | None
    scored: bool
    n_samples: int
    duration: float
    measured_rms: float
    rms: float
    freedom: float
    interval: Mapping[str, tuple[float, float]]


@dataclass(frozen=True, kw_only=True)
class AmplitudePart(GapPart):
    """All records of one input amplitude and role, relative to their own measured RMS about the mean."""

    amplitude: float
    role: str
    scored: bool
    records: tuple[str, ...]
    measured_rms: float


@dataclass(frozen=True, kw_only=True)
class BandPart(GapPart):
    """One band of frequency of all scored records, relative to their measured RMS: squares add up to that of the gap.

    `excited` is False for the rest above what the input and the rig's answer reach.
    """

    omega_low: float
    omega_high: float
    excited: bool


@dataclass(frozen=True, kw_only=True)
class StatePart(GapPart):
    """One cell of the plane of displacement and velocity, relative to the measured RMS of all scored records."""

    # Limits of the cell.
    x_low: float
    x_high: float
    v_low: float
    v_high: float
    n_samples: int  # samples in it
    # Force (torque) missing in the re-identified equations there: mean, RMS, and its standard deviation due
    # to sensor noise. NaN where it does not exceed the noise anywhere, and for an output on which no force
    # acts directly.
    force_mean: float
    force_rms: float
    force_noise: float
    # The joint with this motion, at which the whole force would act; empty on a rig with one motion.
    joint: str = ""


@dataclass(frozen=True, kw_only=True)
class TimePart(GapPart):
    """One stretch of a scored record, relative to the measured RMS of all scored records.

    `omega` is the center frequency of the input power in this stretch (NaN where it is constant); `mean` is the mean residual of
    the re-identified equations on the same scale, which shows a drift.
    """

    record: str
    t_start: float
    t_end: float
    omega: float
    mean: float


@dataclass(frozen=True, kw_only=True)
class PathPart(GapPart):
    """One section of the signal path driven by its measured input, relative to the measured RMS of its output."""

    path: str  # as in ``"psi -> y"``
    source: str  # the signal that drives it, as measured
    # Time by which the source must be earlier for the best fit [s]; NaN where that was not tested.
    shift: float = math.nan
    shift_std: float = math.nan
    # Error of the re-identified section with its source shifted by that; NaN where that was not tested.
    shifted: float = math.nan


@dataclass(frozen=True)
class Localization:
    """The gap split by record, amplitude, band, state, time and signal path; `sentence` summarizes the signal path.

    ``noise_shape`` tells for each output how its noise floor is spread over bands: as ``"measured"``, or as ``"white"`` noise.
    """

    by_record: tuple[RecordPart, ...] = ()
    by_amplitude: tuple[AmplitudePart, ...] = ()
    by_band: tuple[BandPart, ...] = ()
    by_state: tuple[StatePart, ...] = ()
    by_time: tuple[TimePart, ...] = ()
    by_path: tuple[PathPart, ...] = ()
    sentence: str = ""
    noise_shape: Mapping[str, str] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """Return the fields of ``diagnosis.json`` that begin with ``gap_by_``, and the sentence."""
        return {
            "gap_by_record": self.by_record,
            "gap_by_band": self.by_band,
            "gap_by_amplitude": self.by_amplitude,
            "gap_by_state": self.by_state,
            "gap_by_time": self.by_time,
            "gap_by_path": self.by_path,
            "path_evidence": self.sentence,
            "noise_floor_shape": self.noise_shape,
        }

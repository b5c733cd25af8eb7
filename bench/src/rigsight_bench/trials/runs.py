"""What is one record to be measured? The waveforms of its inputs and how they are sampled."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigsight.records import Hold, Kind, Record, Role
from rigsight_bench.trials.waveforms import Waveform, samples

Floats = NDArray[np.float64]

DT = 5e-3
"""Sample time of records, unless it is drawn [s]."""


@dataclass(frozen=True)
class Run:
    """One record to be measured.

    Attributes
    ----------
    name, role, kind, hold
        As of a record; role None for one that no diagnosis sees.
    waveforms
        Of each input.
    n_samples
        Number of samples.
    dt
        Sample time [s].
    amplitude
        Of the record; None for the largest sample of the first input.
    """

    name: str
    role: Role | None
    kind: Kind
    hold: Hold
    waveforms: Mapping[str, Waveform]
    n_samples: int
    dt: float = DT
    amplitude: float | None = None

    def inputs(self, finer: int = 1) -> dict[str, Floats]:
        """Return the samples of each input, each of shape (finer * n_samples,).

        Parameters
        ----------
        finer
            How much more often than in the record.
        """
        t = self.dt / finer * np.arange(finer * self.n_samples, dtype=np.float64)
        return {name: samples(waveform, t) for name, waveform in self.waveforms.items()}

    def record(self, outputs: Mapping[str, Floats] | None = None, finer: int = 1) -> Record:
        """Return the record of the inputs' samples and these outputs.

        Parameters
        ----------
        outputs
            Samples of sensors, each of shape (finer * n_samples,).
        finer
            How much more often than in the record.
        """
        inputs = self.inputs(finer)
        largest = float(np.max(np.abs(next(iter(inputs.values()), np.zeros(1)))))
        return Record(
            name=self.name,
            dt=self.dt / finer,
            signals={**inputs, **(outputs or {})},
            units={},
            role=self.role or "validation",
            kind=self.kind,
            amplitude=float(f"{largest:.4g}") if self.amplitude is None else self.amplitude,
            hold=self.hold,
        )

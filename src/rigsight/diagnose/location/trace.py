"""Measured and simulated outputs of one record at each stage of a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from rigsight.diagnose.fitting.fit_context import FitContext, FittedModel
from rigsight.identify.fit.windows import readings
from rigsight.records.record import Floats, Record
from rigsight.rigs import Rig

Stage = Literal["before", "reidentified", "after"]
STAGES: tuple[Stage, ...] = ("before", "reidentified", "after")


@dataclass(frozen=True)
class Trace:
    """Measured and simulated outputs of one record."""

    # As in the campaign.
    record: str
    role: str
    kind: str
    amplitude: float | None
    t: Floats  # shape (n_samples,) [s]
    # Signal name -> shape (n_samples,).
    inputs: Mapping[str, Floats]
    measured: Mapping[str, Floats]
    before: Mapping[str, Floats]
    reidentified: Mapping[str, Floats]
    after: Mapping[str, Floats]

    @property
    def dt(self) -> float:
        """Sample time [s]."""
        return float(self.t[-1] - self.t[0]) / max(1, self.t.size - 1)

    def residual(self, stage: Stage, output: str) -> Floats:
        """Return measured minus simulated of a stage, shape (n_samples,)."""
        simulated = {"before": self.before, "reidentified": self.reidentified, "after": self.after}[stage]
        return np.asarray(self.measured[output] - simulated[output], dtype=np.float64)


def traces_of(
    context: FitContext, before: FittedModel, reidentified: FittedModel, after: FittedModel
) -> tuple[Trace, ...]:
    """Return measured and simulated outputs of all records, those that score first, windows joined again."""
    scored = _joined(context.rig, context.scoring, before.residuals, reidentified.residuals, after.residuals)
    if context.scoring == context.estimation:
        return scored
    fitted = _joined(
        context.rig, context.estimation, before.fit.residuals, reidentified.fit.residuals, after.fit.residuals
    )
    return (*scored, *fitted)


def _joined(
    rig: Rig,
    records: Sequence[Record],
    before: Sequence[Floats],
    reidentified: Sequence[Floats],
    after: Sequence[Floats],
) -> tuple[Trace, ...]:
    names = [signal.name for signal in rig.outputs]
    groups: dict[str, list[int]] = {}
    for index, record in enumerate(records):
        groups.setdefault(record.origin, []).append(index)
    traces = []
    for name, indices in groups.items():
        parts = [records[i] for i in indices]
        first = parts[0]
        measured = {n: readings(parts, n)[name] for n in names if n in first}

        def simulated(
            residuals: Sequence[Floats],
            indices: Sequence[int] = indices,
            measured: Mapping[str, Floats] = measured,
        ) -> dict[str, Floats]:
            joined = np.concatenate([residuals[i] for i in indices])
            return {n: measured[n] - joined[:, names.index(n)] for n in measured}

        traces.append(
            Trace(
                record=name,
                role=first.role,
                kind=first.kind,
                amplitude=first.amplitude,
                t=np.concatenate([p.t for p in parts]),
                inputs={s.name: np.concatenate([p[s.name] for p in parts]) for s in rig.inputs},
                measured=measured,
                before=simulated(before),
                reidentified=simulated(reidentified),
                after=simulated(after),
            )
        )
    return tuple(traces)

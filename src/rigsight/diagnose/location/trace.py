"""Measured and simulated outputs of each record at each stage of a diagnosis, and how far the gap shrinks from stage to stage.

The intervals are those of a block bootstrap over the scored records: how much the figures vary between stretches of the same
experiments. They do not cover other amplitudes or waveforms.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.noise.block_means import blocks_of
from rigsight.diagnose.policy import MAPS
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


Interval = tuple[float, float]


def budget_intervals(
    traces: Sequence[Trace], output: str, noise_floor: float, rng: np.random.Generator
) -> dict[str, Interval]:
    """Return 95 % intervals of the gap budget of an output over the records that hold it, see `gap_intervals`."""
    holding = [trace for trace in traces if output in trace.measured]
    residuals = {str(stage): [trace.residual(stage, output) for trace in holding] for stage in STAGES}
    return gap_intervals(residuals, [trace.measured[output] for trace in holding], noise_floor, rng)


def gap_intervals(
    residuals: Mapping[str, Sequence[Floats]],
    measured: Sequence[Floats],
    noise_floor: float,
    rng: np.random.Generator,
) -> dict[str, Interval]:
    """Return 95 % intervals of the NRMSE of each stage, and of the share of the gap that is closed."""
    # All stages are resampled together, so that a stretch with large motion affects all of them equally.
    stages = list(residuals)
    center = float(np.mean(np.concatenate(measured)))
    squares = [
        np.column_stack([(m - center) ** 2, *(residuals[stage][i] ** 2 for stage in stages)])
        for i, m in enumerate(measured)
    ]
    blocks = blocks_of(squares)
    means = blocks.resampled(blocks.draws(rng))
    with np.errstate(divide="ignore", invalid="ignore"):
        drawn = {stage: np.sqrt(means[:, 1 + i] / means[:, 0]) for i, stage in enumerate(stages)}
        if "before" in drawn and "after" in drawn:
            drawn["closed"] = (drawn["before"] - drawn["after"]) / (drawn["before"] - noise_floor)
    return {stage: _limits(values) for stage, values in drawn.items()}


def _limits(values: Floats) -> Interval:
    if not np.all(np.isfinite(values)):
        return math.nan, math.nan
    low, high = np.quantile(values, MAPS.limits)
    return float(low), float(high)


def effect_shares(
    effects: Sequence[str], remainder: Mapping[frozenset[str], Mapping[str, float]]
) -> dict[str, dict[str, float]]:
    """Return the share of the closed gap that each of several effects explains, by effect and output."""
    # The share of an effect is its reduction of the error, averaged over the orders in which the effects can be added: the shares
    # add up to one, and two interchangeable effects share what both explain.
    # L. S. Shapley, "A value for n-person games", Contributions to the Theory of Games II (Princeton 1953).
    subsets = [frozenset(c) for n in range(len(effects) + 1) for c in itertools.combinations(effects, n)]
    if len(effects) < 2 or any(subset not in remainder for subset in subsets):
        return {}
    orders = list(itertools.permutations(effects))
    shares: dict[str, dict[str, float]] = {effect: {} for effect in effects}
    for output in remainder[frozenset(effects)]:
        closed = remainder[frozenset()][output] - remainder[frozenset(effects)][output]
        for effect in effects:
            steps = []
            for order in orders:
                earlier = frozenset(order[: order.index(effect)])
                steps.append(remainder[earlier][output] - remainder[earlier | {effect}][output])
            shares[effect][output] = float(np.mean(steps)) / closed if closed > 0.0 else math.nan
    return shares

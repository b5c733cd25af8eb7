"""Offsets that differ from record to record, and the parameters of a rig that are equivalent to such offsets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import f as f_distribution

from rigsight.identify.fit.covariance import SMOOTHED
from rigsight.identify.fit.fit_data import FitResult
from rigsight.identify.fit.grey_box import GreyBoxFit
from rigsight.records.record import Floats, Record
from rigsight.simulate import Structure
from rigsight.units import behind

_CHANCE = 1e-3
"""Probability by chance below which means count as different; with ten outputs this is wrong in one campaign in a hundred."""
_WORTH_TELLING = 0.1
"""Share of the residual's power above which differing means are reported as a main error of a model."""
_LEAST_TOLD = 1e-6
_NOTHING = 1e-6
"""Share of the information on a parameter that counts as rounding error: information contains squares of derivatives, which are
accurate to a thousandth."""
OFFSETS_MEND = (
    'If the sensor was zeroed between records, write offsets = "per_record" at the top of campaign.toml.'
)


@dataclass(frozen=True)
class DifferingMeans:
    """Mean residuals of a model that differ from record to record."""

    output: str  # its name
    means: dict[str, float]  # record -> mean of measured minus simulated
    share: float  # of the residual's power that the means explain
    probability: float  # of such differences by chance if the offset is the same everywhere

    def sentence(self, unit: str) -> str:
        """Return the finding in words."""
        lowest, highest = (choose(self.means, key=self.means.__getitem__) for choose in (min, max))
        chance = f"{self.probability:.1g}" if self.probability > _LEAST_TOLD else f"below {_LEAST_TOLD:g}"
        low, high = (f"{self.means[end]:.3g}{behind(unit)} in '{end}'" for end in (lowest, highest))
        return (
            f"The mean residual of {self.output} differs between records, from {low} to {high}: {self.share:.0%} of the whole "
            f"residual, and more than by chance (probability {chance}), as if the offset of the sensor, or a constant force, "
            "differed from record to record."
        )


def differing_means(
    names: Sequence[str], records: Sequence[Record], residuals: Sequence[Floats], outputs: Sequence[str]
) -> list[DifferingMeans]:
    """Return the outputs whose mean residuals differ between records more than by chance.

    The variance of a mean comes from the lowest lines of the residual's own spectrum, so that slow disturbances are included.
    Records with the same of the names are stretches of one record; the residuals have the shape (n_samples, n_outputs).
    """
    found = []
    for column, output in enumerate(outputs):
        own: dict[str, list[Floats]] = {}
        for name, record, residual in zip(names, records, residuals, strict=False):
            if output in record and output not in record.free_offsets:
                own.setdefault(name, []).append(residual[:, column])
        joined = {name: np.concatenate(parts) for name, parts in own.items()}
        if len(joined) > 1:
            differing = _differing(output, joined)
            if differing.probability < _CHANCE and differing.share >= _WORTH_TELLING:
                found.append(differing)
    return found


def _differing(output: str, residuals: Mapping[str, Floats]) -> DifferingMeans:
    means = {name: float(np.mean(remainder)) for name, remainder in residuals.items()}
    values = np.array(list(means.values()))
    variances = np.array([_variance_of_mean(remainder) for remainder in residuals.values()])
    weights = 1.0 / np.maximum(variances, 1e-300)
    middle = float(weights @ values / np.sum(weights))
    degrees = len(means) - 1
    statistic = float(weights @ (values - middle) ** 2) / degrees
    sizes = np.array([remainder.size for remainder in residuals.values()])
    squares = sum(float(remainder @ remainder) for remainder in residuals.values())
    return DifferingMeans(
        output=output,
        means=means,
        share=min(float(sizes @ (values - middle) ** 2) / max(squares, 1e-300), 1.0),
        probability=float(f_distribution.sf(statistic, degrees, 2 * SMOOTHED)),
    )


def _variance_of_mean(remainder: Floats) -> float:
    """Return the variance of the mean of a colored residual: its power per line near zero frequency, over its length."""
    lines = np.abs(np.fft.rfft(remainder - np.mean(remainder))[1 : SMOOTHED + 1]) ** 2
    return float(np.mean(lines)) / remainder.size**2


def without_offsets(records: Sequence[Record], fit: FitResult) -> list[Record]:
    """Return the fitted records minus the offsets that the fit found in each of them."""
    return [
        record.with_signals(
            **{name: record[name] - own for name, own in fit.offsets(index).items() if name in record}
        )
        for index, record in enumerate(records)
    ]


def swallowed_by_offsets(
    structure: Structure,
    records: Sequence[Record],
    scales: Mapping[str, float],
    noise: Mapping[str, float],
    values: Mapping[str, float],
    free: Sequence[str],
) -> tuple[str, ...]:
    """Return the free parameters that sensor offsets make undetermined: a rest position, or the zero of a sensor."""
    if not any(record.free_offsets for record in records):
        return ()
    without = [replace(record, free_offsets=()) for record in records]
    said, before = (
        np.diag(GreyBoxFit(structure, own, scales, noise).information(values, free))
        for own in (records, without)
    )
    return tuple(
        name
        for name, now, then in zip(free, said, before, strict=True)
        if now <= _NOTHING * then and then > 0.0
    )

"""Are the records sampled much finer than anything moves? Then fewer samples say the same, and every fit takes less time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rigsight.campaign import Campaign
from rigsight.diagnose.data_quality.checks import sensor_faults
from rigsight.diagnose.noise.detection import noise_floors
from rigsight.diagnose.policy import SEARCH
from rigsight.records.record import Floats, Record


def at_useful_rate(campaign: Campaign) -> Campaign:
    """Return the campaign with means of n samples, with a note; unchanged where it is not oversampled or has few samples.

    A reading becomes the mean of the samples around it, a held input the mean of those until the next one: noise falls as if
    every sample were used, and nothing above the new rate folds down. Unchanged too where means would hide what the samples
    show: a fault of a sensor, or repeated periods and rest from which the noise is known.
    """
    n = _samples_to_mean(campaign)
    if n < 2 or any(sensor_faults(campaign.rig, record) for record in campaign.records):
        return campaign
    inputs = {signal.name for signal in campaign.rig.inputs}
    records = tuple(_coarser(record, n, inputs) for record in campaign.records)
    if _known_from(campaign, campaign.records) != _known_from(campaign, records):
        return campaign
    note = (
        f"Nearly all motion lies below {_band_of(campaign) / campaign.records[0].dt:.2g} Hz, the records are sampled at "
        f"{1.0 / campaign.records[0].dt:.4g} Hz: means of {n} samples are compared."
    )
    return replace(campaign, records=records, notes=(*campaign.notes, note))


def _known_from(campaign: Campaign, records: Sequence[Record]) -> list[tuple[str, int]]:
    """Return the method by which the noise of each output is known, and from how many stretches."""
    return [(floor.method, len(floor.stretches)) for floor in noise_floors(campaign.rig, records)]


def _samples_to_mean(campaign: Campaign) -> int:
    if len({record.dt for record in campaign.records}) > 1 or campaign.rig.mechanism.bodies is not None:
        return 1
    fine = 1.0 / (SEARCH.samples_per_period * _band_of(campaign))
    many = sum(record.n_samples for record in campaign.estimation) / SEARCH.useful_samples
    # An odd number has a sample in its middle.
    return max(1, 2 * int((min(fine, np.ceil(many)) - 1.0) / 2.0) + 1)


def _band_of(campaign: Campaign) -> float:
    """Return the highest frequency of a motion in the records to fit, in cycles per sample."""
    records = campaign.estimation
    names = [s.name for s in campaign.rig.outputs if all(s.name in record for record in records)]
    least = 1.0 / max(record.n_samples for record in records)
    return max([least, *(_end_of_band([record[name] for record in records]) for name in names)])


def _end_of_band(signals: Sequence[Floats]) -> float:
    """Return the frequency below which nearly all power of signals lies, in cycles per sample."""
    longest = max(signal.size for signal in signals)
    power = np.zeros(longest + 1)
    for signal in signals:
        tapered = (signal - np.mean(signal)) * np.hanning(signal.size)
        power += np.abs(np.fft.rfft(tapered, 2 * longest)) ** 2
    below = np.cumsum(power)
    if not below[-1] > 0.0:
        return 0.0
    return float(np.searchsorted(below, SEARCH.power_in_band * below[-1])) / (2 * longest)


def _coarser(record: Record, n: int, inputs: set[str]) -> Record:
    half, kept = n // 2, record.n_samples // n

    def around(signal: Floats) -> Floats:
        return np.asarray(np.mean(signal[: kept * n].reshape(kept, n), axis=1))

    def from_there_on(signal: Floats) -> Floats:
        following = np.append(signal[half:], np.full(n, signal[-1]))
        return around(following)

    is_held = record.hold == "zoh"
    signals = {
        name: (from_there_on if is_held and name in inputs else around)(record[name])
        for name in record.signals
    }
    return replace(record, dt=n * record.dt, t0=record.t0 + half * record.dt, signals=signals)

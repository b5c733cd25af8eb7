"""Models of a drifting rig are compared with records as observers: each model is weakly coupled to the measured motion.

A rig without a spring integrates every force error twice, so that a free run soon shows only the drift. An observer is pulled
towards the measured motion. A missing effect still shows within about the reciprocal of the observer bandwidth, while slower
drift is removed. Internal states of effects are not corrected.

References
----------
D. G. Luenberger, IEEE Trans. Automatic Control 16 (1971) 596, for observers. L. Ljung, *System Identification* (Prentice Hall
1999), sections 4.3 and 7.4, for predictors of disturbed systems and for fits of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from rigsight.campaign import Campaign
from rigsight.records.record import Record
from rigsight.rigs import Rig
from rigsight.simulate import Structure, compose, structure_of_fit


@dataclass(frozen=True)
class Observer:
    """Sensors that a model tracks while it is compared with records, and the bandwidth."""

    sensors: tuple[str, ...]  # names of sensors that read only the motion
    bandwidth: float  # angular frequency up to which the motion is tracked [rad/s]

    def following(self, records: Sequence[Record]) -> tuple[Record, ...]:
        """Return records that models follow while they are fitted to them."""
        return tuple(
            replace(record, observed={name: self.bandwidth for name in self.sensors if name in record})
            for record in records
        )


def observed_sensors(records: Sequence[Record]) -> frozenset[str]:
    """Return the sensors that models follow while they are fitted to records."""
    return frozenset(sensor for record in records for sensor in record.observed)


def followed_sensors(campaign: Campaign) -> tuple[str, ...]:
    """Return the sensors that models of a campaign can track: those that read only the motion."""
    shown = {name for record in campaign.records for name in record.signals}
    return tuple(name for name in sensors_of_motion(campaign.rig) if name in shown)


def structures_to_fit(campaign: Campaign, structures: Iterable[Structure]) -> list[Structure]:
    """Return structures as they are simulated in fits to the records of a campaign: with free offsets and with an observer."""
    any_bandwidth = Observer(followed_sensors(campaign) if campaign.drifts else (), 0.0)
    records = any_bandwidth.following(campaign.records)
    return [structure_of_fit(structure, records) for structure in structures]


def sensors_of_motion(rig: Rig) -> tuple[str, ...]:
    """Return the sensors of a rig that read only its motion: coordinates and their rates."""
    structure = compose(rig)
    motion = structure.tree.motion
    moving = {*motion.coordinates, *motion.velocities}
    return tuple(
        sensor.name
        for sensor, reading in zip(rig.mechanism.sensors, structure.outputs, strict=True)
        if reading.free_symbols & moving and reading.free_symbols <= {*moving, *structure.parameter_symbols}
    )

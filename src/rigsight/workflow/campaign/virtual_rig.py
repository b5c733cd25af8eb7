"""Simulated measurements on the built-in virtual rig, with disturbance and sensor noise.

The rig is the published set `iwan_tables`, the model behind the tables of the thesis.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from rigsight.effects import effect_named
from rigsight.records import Hold, Kind, Record, Role
from rigsight.rigs import RUNNING_GEAR, evaluated
from rigsight.rigs.published import PublishedSet, published_sets
from rigsight.simulate import Structure, compose, simulate

VIRTUAL_RIG_SET = "iwan_tables"
DT = 5e-3
"""Sample time of the thesis's rig [s]."""


def _default_noise() -> Mapping[str, float]:
    return {"psi": 2e-5, "y": 2e-5}


@dataclass(frozen=True)
class VirtualRig:
    """A running gear with known true parameters."""

    # Parameter set that is simulated.
    truth: PublishedSet = field(default_factory=lambda: published_sets()[VIRTUAL_RIG_SET])
    # Standard deviation of the white sensor noise, by output [rad], [m].
    noise: Mapping[str, float] = field(default_factory=_default_noise)
    disturbance: float = 1e-3  # standard deviation of the torque disturbance [N m]
    # Angular frequency below which the disturbance is white [rad/s]; above, it falls by 20 dB per decade.
    disturbance_corner: float = 5.0
    dt: float = DT  # sample time [s]

    @property
    def structure(self) -> Structure:
        """The equations that are simulated."""
        return compose(RUNNING_GEAR, [effect_named(name) for name in self.truth.effects])

    def time(self, duration: float) -> NDArray[np.float64]:
        """Return the sample times of a record of `duration` [s], shape (n_samples,)."""
        return self.dt * np.arange(round(duration / self.dt), dtype=np.float64)

    def measure(
        self,
        name: str,
        u: NDArray[np.float64],
        rng: np.random.Generator,
        *,
        kind: Kind = "operation",
        role: Role = "estimation",
        amplitude: float | None = None,
        hold: Hold = "foh",
    ) -> Record:
        """Drive the rig with a current and return the measured record."""
        torque = self._torque_disturbance(u.size, rng)
        values = self.truth.values()
        per_ampere = evaluated(self.structure.rig.motion.drive_gain, values)
        driven = Record(
            name=name, dt=self.dt, signals={"u": u + torque / per_ampere}, units={"u": "A"}, role=role, kind=kind,
            amplitude=amplitude, hold=hold,
        )  # fmt: skip
        clean = simulate(self.structure, values, driven)
        seen = {output: clean[output] + rng.normal(scale=s, size=u.size) for output, s in self.noise.items()}
        return clean.with_signals(u=u, **seen)

    def _torque_disturbance(self, n_samples: int, rng: np.random.Generator) -> NDArray[np.float64]:
        pole = float(np.exp(-self.disturbance_corner * self.dt))
        settled = int(np.ceil(5.0 / (self.disturbance_corner * self.dt)))
        white = rng.normal(scale=self.disturbance * np.sqrt(1.0 - pole**2), size=n_samples + settled)
        return np.asarray(lfilter([1.0], [1.0, -pole], white)[settled:])

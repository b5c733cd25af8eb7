"""A second-order system whose frequency response is known in closed form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
import scipy.signal

from rigsight.excitation import linear_sweep
from rigsight.records import Record

DT = 5e-3


@dataclass(frozen=True)
class SecondOrder:
    """``G(s) = omega_0^2 / (s^2 + 2 D omega_0 s + omega_0^2)``, driven by a sweep or by noise."""

    omega_0: float = 12.03
    D: float = 0.3

    def response(self, omega: np.ndarray) -> np.ndarray:
        return self.omega_0**2 / (self.omega_0**2 - omega**2 + 2j * self.D * self.omega_0 * omega)

    def record(
        self,
        *,
        duration: float = 100.0,
        hold: str = "foh",
        noise: float = 0.0,
        rng: np.random.Generator | None = None,
        random: bool = False,
        delay: int = 0,
        rest: float = 0.0,
        name: str = "sweep",
    ) -> Record:
        t = DT * np.arange(round(duration / DT))
        still = round(rest / DT)
        moving = slice(still, t.size - still)
        u = np.zeros(t.size)
        u[moving] = rng.normal(size=t[moving].size) if random else linear_sweep(t[moving], 1.0, 0.6, 60.0)
        system = scipy.signal.lti([self.omega_0**2], [1.0, 2.0 * self.D * self.omega_0, self.omega_0**2])
        psi = scipy.signal.lsim(system, u, t, interp=hold == "foh")[1]
        psi = np.concatenate([np.zeros(delay), psi[: psi.size - delay]])
        if noise:
            psi = psi + noise * rng.normal(size=t.size)
        return Record(
            name, DT, {"u": u, "psi": psi}, {"u": "A", "psi": "rad"}, hold=hold, kind="sweep", amplitude=1.0
        )


@pytest.fixture
def second_order() -> Callable[..., SecondOrder]:
    return SecondOrder

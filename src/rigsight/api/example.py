"""A small example campaign with known truth, without files."""

from __future__ import annotations

import numpy as np

from rigsight.campaign import Campaign
from rigsight.excitation import linear_sweep
from rigsight.records import Record, Role
from rigsight.simulate import simulate
from rigsight.workflow.campaign.in_memory import make_campaign, make_model

_GIVEN = {"m": 2.0, "d": 5.0, "k": 800.0}
_K_3 = 5e6
"""Cubic stiffness that is missing in the given simulation [N/m^3]."""
_NOISE = 2e-5
"""Standard deviation of the sensor noise [m]."""
_DT = 5e-3
_BAND = (3.0, 60.0)
"""First and last angular frequency of the sweeps [rad/s]."""
_N_SAMPLES = 2000
_REST = 200
"""Samples of rest before the sweep, which show only noise."""


def example_campaign(seed: int = 0) -> Campaign:
    """Return two sweeps of a simulated stage, an axis with a hardening spring, and a simulation without the hardening.

    The stage obeys ``m x'' + d x' + k x + k_3 x^3 = u`` with m = 2 kg, d = 5 N s/m, k = 800 N/m and k_3 = 5e6 N/m^3; its sensor
    has noise of 0.02 mm. The given simulation has the same parameter values and no k_3. One sweep of 4 N is for estimation, one
    of 3 N for validation; each lasts 10 s.

    Parameters
    ----------
    seed
        Seed of the sensor noise.

    Examples
    --------
    >>> import rigsight as rs
    >>> campaign = rs.example_campaign()
    >>> [(record.name, record.role, record.n_samples) for record in campaign.records]
    [('fit', 'estimation', 2000), ('score', 'validation', 2000)]
    """
    rng = np.random.default_rng(seed)
    return make_campaign(
        "axis",
        [_sweep("fit", 4.0, "estimation", rng), _sweep("score", 3.0, "validation", rng)],
        parameters=_GIVEN,
        title="Example stage",
    )


def _sweep(name: str, amplitude: float, role: Role, rng: np.random.Generator) -> Record:
    truth = make_model("axis", {**_GIVEN, "k_3": _K_3}, ["cubic_stiffness"])
    t = _DT * np.arange(_N_SAMPLES, dtype=np.float64)
    u = np.concatenate([np.zeros(_REST), linear_sweep(t[_REST:], amplitude, *_BAND)])
    driven = Record(name, _DT, {"u": u}, {"u": "N"}, role=role, kind="sweep", amplitude=amplitude)
    clean = simulate(truth.structure, truth.values, driven)
    return clean.with_signals(x=clean["x"] + rng.normal(scale=_NOISE, size=_N_SAMPLES))

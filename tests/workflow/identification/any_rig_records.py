"""Records of simulated rigs of any shape, and what is identified from them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from numpy.typing import NDArray

from rigsight.identify.identification import Identification
from rigsight.records.record import Record, Role
from rigsight.rigs import Rig
from rigsight.simulate import compose, simulate
from rigsight.workflow.campaign.in_memory import make_campaign
from rigsight.workflow.identification import rig as identified_rig
from rigsight.workflow.identify import checked_options, identify_campaign

Floats = NDArray[np.float64]
DT, N = 0.01, 2000
T = DT * np.arange(N)
STILL = np.zeros(N)
NOISE = 1e-3
ARM = {
    "l_1": 0.3, "g": 9.81, "I_1": 0.05, "I_2": 0.02, "m_2": 0.6, "s_1": 0.12, "s_2": 0.08, "d_1": 0.05, "d_2": 0.02
}  # fmt: skip
TRAIN = {"k_t": 0.05, "J_m": 1e-4, "J_l": 5e-4, "k_s": 2.0, "d_s": 1e-3, "d_m": 1e-3, "d_l": 1e-3, "k_l": 0.5}
SERVO = {"m": 1.0, "l": 0.15, "k_p": 2.0, "J": 0.02, "k_v": 3.0, "d": 0.2, "angle_off": 0.05}


def multisine(rng: np.random.Generator, size: float, high: float) -> Floats:
    omega = 2.0 * np.pi * np.arange(N // 2 + 1) / (N * DT)
    lines = np.where((omega > 0.5) & (omega < high), np.exp(2j * np.pi * rng.random(omega.size)), 0.0)
    signal = np.fft.irfft(lines, N)
    return np.asarray(size * signal / np.std(signal))


def recorded(
    name: str,
    rig: Rig,
    values: Mapping[str, float],
    inputs: Mapping[str, Floats],
    rng: np.random.Generator,
    role: Role = "estimation",
    constants: Mapping[str, float] | None = None,
    start: Floats | None = None,
) -> Record:
    units = {signal.name: signal.unit for signal in (*rig.inputs, *rig.outputs)}
    # A rig without inputs still needs samples of time.
    signals = dict(inputs) or {rig.outputs[0].name: STILL}
    given = Record(name, DT, signals, units, kind="multisine", role=role, constants=dict(constants or {}))
    clean = simulate(compose(rig), {**values, **given.constants}, given, start, accuracy=1e-8)
    noisy = {
        s.name: clean[s.name] + NOISE * np.std(clean[s.name]) * rng.standard_normal(N) for s in rig.outputs
    }
    return clean.with_signals(**noisy)


def identified(
    rig: Rig,
    records: list[Record],
    constants: Mapping[str, float],
    truth: Mapping[str, float],
    monkeypatch: pytest.MonkeyPatch,
) -> Identification:
    """Identify from start values a fifth beside the truth: how such are found is not the question here."""
    start = {p.name: 1.2 * truth[p.name] for p in rig.parameters}
    monkeypatch.setattr(identified_rig, "linear_start", lambda *_: start)
    campaign = make_campaign(rig, records, constants=constants)
    return identify_campaign(campaign, checked_options("local_rational", None))

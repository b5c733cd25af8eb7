"""Offsets of a driven record: the sweep is motion and no noise, and the intervals hold the truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from rigsight.errors import InputError
from rigsight.excitation import log_sweep
from rigsight.identify import TransferFit, TransferForm
from rigsight.records import Record
from rigsight.rigs import RUNNING_GEAR
from rigsight.simulate import compose, simulate

from .studies import of_study

driven_offsets = of_study("thesis", "driven_offsets").driven_offsets

VALUES = {
    "v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27, "J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "l_0": 0.25, "c_y": 0.98,
    "psi_off": -1.3e-3, "y_off": 4e-4,
}  # fmt: skip
YAW = {"gain": 0.01, "omega_b": float(np.sqrt(81.0 / 0.56)), "zeta": float(1.0 / np.sqrt(81.0 * 0.56))}
LATERAL = {"gain": 0.5, "omega_b": 1.96}
ERROR = 1e-3
"""Relative standard errors of the fits."""
DT = 5e-3


def fitted(
    source: str, response: str, values: dict[str, float], rng: np.random.Generator | None
) -> TransferFit:
    """Return a fit that errs by its standard errors."""
    errors = ERROR * np.array(list(values.values()))
    drawn = (
        values if rng is None else dict(zip(values, rng.normal(list(values.values()), errors), strict=True))
    )
    return TransferFit(
        TransferForm("pt2" if "zeta" in values else "pt1"), tuple(values), drawn,
        dict(zip(values, errors, strict=True)), np.diag(errors**2), np.zeros(1), 1.0, True, "", source, response, "", "test",
    )  # fmt: skip


def swept(rng: np.random.Generator, disturbance: float = 5e-3, noise: float = 2e-5) -> Record:
    """A sweep that begins so slowly that its current has a mean, with a colored disturbance that is not recorded."""
    t = DT * np.arange(12_000)
    u = log_sweep(t, 1.0, 0.1, 80.0)
    pole = np.exp(-5.0 * DT)
    unseen = disturbance * np.sqrt(1.0 - pole**2) * lfilter([1.0], [1.0, -pole], rng.standard_normal(t.size))
    record = Record(
        "sweep", DT, {"u": u + unseen}, {"u": "A", "psi": "rad", "y": "m"}, kind="sweep", hold="foh"
    )
    clean = simulate(compose(RUNNING_GEAR), VALUES, record)
    seen = {name: clean[name] + rng.normal(0.0, noise, t.size) for name in ("psi", "y")}
    return record.with_signals(u=u, **seen)


def test_offsets_of_sweeps_err_as_they_say() -> None:
    pulls, naive = [], []
    for seed in range(20):
        rng = np.random.default_rng([3, seed])
        record = swept(rng)
        found = driven_offsets(record, fitted("u", "psi", YAW, rng), fitted("psi", "y", LATERAL, rng))
        errors = found.standard_errors
        pulls.append([(found.values[name] - VALUES[name]) / errors[name] for name in ("psi_off", "y_off")])
        naive.append(np.std(record["psi"]) / errors["psi_off"])
    # 20 pulls each of about unit variance: three standard deviations of their rms.
    assert np.sqrt(np.mean(np.square(pulls), axis=0)) == pytest.approx(1.0, abs=3.0 / np.sqrt(40.0))
    # The sweep itself is hundreds of times as large as what is not known of the offset.
    assert min(naive) > 100.0


def test_motion_from_before_the_record_is_no_offset() -> None:
    record = swept(np.random.default_rng(1), 0.0, 1e-9)
    late = replace(record, signals={name: samples[2350:] for name, samples in record.signals.items()})
    found = driven_offsets(late, fitted("u", "psi", YAW, None), fitted("psi", "y", LATERAL, None))
    assert found.values["psi_off"] == pytest.approx(VALUES["psi_off"], abs=1e-7)
    assert found.values["y_off"] == pytest.approx(VALUES["y_off"], abs=1e-7)


def test_without_y_the_offset_of_the_motion_stands_alone() -> None:
    record = swept(np.random.default_rng(2))
    alone = driven_offsets(record, fitted("u", "psi", YAW, None), name="x_off")
    assert alone.names == ("x_off",)
    both = driven_offsets(record, fitted("u", "psi", YAW, None), fitted("psi", "y", LATERAL, None))
    assert alone.values["x_off"] == pytest.approx(both.values["psi_off"])
    assert alone.standard_errors["x_off"] == pytest.approx(both.standard_errors["psi_off"], rel=1e-6)


def test_motion_that_the_fits_do_not_explain_widens_the_interval() -> None:
    record = swept(np.random.default_rng(4))
    right, wrong = (
        driven_offsets(record, fitted("u", "psi", values, None)) for values in (YAW, {**YAW, "omega_b": 40.0})
    )
    assert wrong.standard_errors["psi_off"] > 5.0 * right.standard_errors["psi_off"]


def test_a_handful_of_samples_is_refused() -> None:
    record = swept(np.random.default_rng(5))
    short = replace(record, signals={name: samples[:10] for name, samples in record.signals.items()})
    with pytest.raises(InputError, match="10 samples are too few to find an offset"):
        driven_offsets(short, fitted("u", "psi", YAW, None))

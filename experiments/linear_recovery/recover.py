"""Check that the parameters of a linear running gear are recovered within 1 %, and that 95 % intervals have their coverage.

Draws linear running gears around the thesis's sets, drives each with one logarithmic sweep of 100 s, adds sensor noise and a
coloured torque disturbance that the record does not show, and identifies them in two ways:

- ``response``: local rational frequency response, PT2 and PT1 by maximum likelihood, then (2.21) and (2.24);
- ``time``: output-error fit of the equations of motion to the samples of psi and y.

The truth is simulated with scipy's exact discretisation at a fifth of the sample time, not with the simulator that is fitted.

Run with ``python experiments/linear_recovery/recover.py [draws] [seed] [disturbance]``.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.signal import lfilter
from scipy.stats import norm

from rigsight.excitation import log_sweep
from rigsight.frequency import local_rational_response
from rigsight.identify import (
    GreyBoxFit,
    characteristic_scales,
    fit_frequency_response,
    linear_start,
    physical_parameters,
)
from rigsight.identify.transfer.conicity import creep_factor
from rigsight.records import Record
from rigsight.rigs import RUNNING_GEAR
from rigsight.simulate import compose

Array = NDArray[np.float64]

CONSTANTS = {"v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27}
NAMES = ("J_z", "k_c", "k_d", "l_0", "c_y")
GEAR = compose(RUNNING_GEAR)

DT = 0.005
"""Sample time of the rig [s]."""
FINER = 5
"""Steps of the truth per sample."""
REST_BEFORE, SWEEP, REST_AFTER = 5.0, 100.0, 10.0
"""Duration of each stretch [s]."""
AMPLITUDE = 1.0
"""Of the current [A]."""
SWEPT = (0.3, 80.0)
"""Angular frequency at the begin and the end of the sweep [rad/s]: a decade below and above the breaks expected."""
YAW_BAND, LATERAL_BAND = (0.6, 60.0), (0.6, 20.0)
"""Where the responses are read [rad/s]: within the sweep, and where psi and y stand out of the sensor noise."""

SENSOR_NOISE = {"psi": 2e-5, "y": 2e-5}
"""Standard deviation of white noise [rad], [m]."""
DISTURBANCE = 0.01
"""RMS of the torque disturbance over the RMS of the drive's torque during the sweep, where no other is given."""
DISTURBANCE_CORNER = 5.0
"""Corner of the first-order low-pass that colours the disturbance [rad/s]."""


@dataclass(frozen=True)
class Estimate:
    """Values and the 95 % interval of each of `NAMES`, shape (n_parameters,)."""

    value: Array
    lower: Array
    upper: Array


def drawn(rng: np.random.Generator) -> dict[str, float]:
    """Draw a running gear: ranges that hold the three sets of Table 4.1."""
    J_z = float(np.exp(rng.uniform(np.log(0.25), np.log(0.9))))
    k_c = float(np.exp(rng.uniform(np.log(50.0), np.log(200.0))))
    damping_ratio = float(np.exp(rng.uniform(np.log(0.03), np.log(0.6))))
    return {
        "J_z": J_z,
        "k_c": k_c,
        "k_d": 2.0 * damping_ratio * float(np.sqrt(J_z * k_c)),
        "l_0": float(rng.uniform(0.22, 0.30)),
        "c_y": creep_factor(float(rng.uniform(0.01, 0.10)), CONSTANTS["r_0"], CONSTANTS["b"]),
        "psi_off": float(rng.uniform(-2e-3, 2e-3)),
        "y_off": float(rng.uniform(-1e-3, 1e-3)),
    }


def measured(truth: dict[str, float], rng: np.random.Generator, level: float) -> Record:
    """Simulate the record of one sweep; the disturbance has acted for long before it begins."""
    still, swept, after = (round(d / DT) for d in (REST_BEFORE, SWEEP, REST_AFTER))
    u = np.zeros(still + swept + after)
    u[still : still + swept] = log_sweep(DT * np.arange(swept), AMPLITUDE, *SWEPT)
    # The current is held on straight lines between its samples, so a finer grid of them is the same current.
    fine = np.interp(np.arange((u.size - 1) * FINER + 1) / FINER, np.arange(u.size), u)
    before = round(30.0 / DT) * FINER
    pole = float(np.exp(-DISTURBANCE_CORNER * DT / FINER))
    white = rng.normal(0.0, np.sqrt(1.0 - pole**2), 2 * before + fine.size)
    disturbance = level * AMPLITUDE / np.sqrt(2.0) * lfilter([1.0], [1.0, -pole], white)[before:]
    disturbance[before:] += fine
    psi, y = _answer(truth, disturbance, DT / FINER)
    signals = {"u": u, "psi": psi[before::FINER], "y": y[before::FINER]}
    for name, size in SENSOR_NOISE.items():
        signals[name] = signals[name] + rng.normal(0.0, size, u.size)
    return Record(
        "sweep",
        DT,
        signals,
        {"u": "A", "psi": "rad", "y": "m"},
        kind="sweep",
        amplitude=AMPLITUDE,
        hold="foh",
    )


def _answer(truth: dict[str, float], u: Array, dt: float) -> tuple[Array, Array]:
    """Return psi and y from rest, exactly for an input on straight lines; offsets are added behind, as the rig is linear."""
    gain = CONSTANTS["b"] * CONSTANTS["k_tau"] / (CONSTANTS["r_0"] * truth["J_z"])
    slope = CONSTANTS["v"] * truth["c_y"]
    a = np.array(
        [
            [0.0, 1.0, 0.0],
            [-truth["k_c"] / truth["J_z"], -truth["k_d"] / truth["J_z"], 0.0],
            [slope, 0.0, -slope / (2.0 * truth["l_0"])],
        ]
    )
    augmented = np.zeros((5, 5))
    augmented[:3, :3], augmented[1, 3], augmented[3, 4] = a, gain, 1.0
    moved = expm(augmented * dt)
    phi, constant, ramp = moved[:3, :3], moved[:3, 3], moved[:3, 4]
    # In the basis of the eigenvectors every state is a first-order recursion of its own.
    poles, vectors = np.linalg.eig(phi)
    now, later = np.linalg.solve(vectors, np.column_stack([constant - ramp / dt, ramp / dt])).T
    modes = [
        lfilter([c1, c0], [1.0, -p], u.astype(complex)) for c0, c1, p in zip(now, later, poles, strict=True)
    ]
    states = np.real(vectors @ np.array(modes))
    rest_y = truth["y_off"] + 2.0 * truth["l_0"] * truth["psi_off"]
    return states[0] + truth["psi_off"], states[2] + rest_y


def by_response(record: Record) -> Estimate:
    """Identify by the frequency responses."""
    yaw = local_rational_response(record, "u", "psi", hold=record.hold, band=YAW_BAND)
    lateral = local_rational_response(record, "psi", "y", band=LATERAL_BAND)
    parts = [
        physical_parameters(RUNNING_GEAR, fit_frequency_response(yaw, "pt2"), CONSTANTS),
        physical_parameters(RUNNING_GEAR, fit_frequency_response(lateral, "pt1"), CONSTANTS),
    ]
    found = [next(part for part in parts if name in part.names) for name in NAMES]
    limits = np.array([part.interval(name) for part, name in zip(found, NAMES, strict=True)])
    values = np.array([part.values[name] for part, name in zip(found, NAMES, strict=True)])
    return Estimate(values, limits[:, 0], limits[:, 1])


def by_time(record: Record) -> Estimate:
    """Identify by the samples."""
    begin = {**CONSTANTS, **linear_start(RUNNING_GEAR, [record], CONSTANTS, {})}
    scales = characteristic_scales(RUNNING_GEAR, [record], begin)
    free = [p.name for p in RUNNING_GEAR.parameters if p.fitted]
    fit = GreyBoxFit(GEAR, [record], scales, SENSOR_NOISE).fit(begin, free)
    values = np.array([fit.values[name] for name in NAMES])
    width = float(norm.ppf(0.975)) * np.array([fit.standard_errors[name] for name in NAMES])
    return Estimate(values, values - width, values + width)


WAYS = {"response": by_response, "time": by_time}


def trial(seed: np.random.SeedSequence, level: float) -> tuple[Array, dict[str, Estimate]]:
    """Return the truth of one draw and what each way makes of it."""
    rng = np.random.default_rng(seed)
    truth = drawn(rng)
    record = measured(truth, rng, level)
    return np.array([truth[name] for name in NAMES]), {way: find(record) for way, find in WAYS.items()}


def wilson(successes: int, n: int) -> tuple[float, float]:
    """Return the 95 % interval of a share."""
    z, share = 1.96, successes / n
    middle = (share + z**2 / (2 * n)) / (1 + z**2 / n)
    width = z / (1 + z**2 / n) * np.sqrt(share * (1 - share) / n + z**2 / (4 * n**2))
    return middle - width, middle + width


def report(results: list[tuple[Array, dict[str, Estimate]]]) -> None:
    """Print one line per way and parameter."""
    truths = np.array([truth for truth, _ in results])
    columns = (
        "way",
        "parameter",
        "median error",
        "95 % of errors below",
        "within 1 %",
        "95 % interval holds the truth (Wilson)",
    )
    print("|", " | ".join(columns), "| median half-width |")
    print("|---|---|---|---|---|---|---|")
    for way in WAYS:
        value, lower, upper = (
            np.array([getattr(found[way], part) for _, found in results])
            for part in ("value", "lower", "upper")
        )
        errors = np.abs(value / truths - 1.0)
        held = (lower <= truths) & (truths <= upper)
        for i, name in enumerate(NAMES):
            low, high = wilson(int(held[:, i].sum()), len(results))
            print(
                f"| {way} | {name} | {np.median(errors[:, i]):.2%} | {np.percentile(errors[:, i], 95):.2%} | "
                f"{np.mean(errors[:, i] < 0.01):.1%} | {held[:, i].mean():.1%} ({low:.1%} to {high:.1%}) | "
                f"{np.median((upper - lower)[:, i] / truths[:, i]) / 2:.2%} |"
            )


def main() -> None:
    draws = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    level = float(sys.argv[3]) if len(sys.argv) > 3 else DISTURBANCE
    begin = time.perf_counter()
    seeds = np.random.SeedSequence(seed).spawn(draws)
    results = Parallel(n_jobs=2)(delayed(trial)(own, level) for own in seeds)
    report(results)
    print(
        f"\n{draws} draws, seed {seed}, disturbance {level:.0%} of the drive, {time.perf_counter() - begin:.0f} s"
    )


if __name__ == "__main__":
    main()

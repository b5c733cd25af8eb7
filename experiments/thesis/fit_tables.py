"""Search for a single model with the frequency responses of Table 5.2 and the resonances of Figure 5.6.

The rig's only public measurements are one linear fit (a PT2) per sweep amplitude, each with other parameters. Here ONE
running gear with effects of the catalogue, and with parameters that do not depend on amplitude, is fitted to all of them.

Each set is swept at every amplitude at the rate of the thesis (ln(640/1e-3)/150 s per e-fold). The response is the ratio of
output and input spectra, averaged over neighboring lines; the error is the rms of its magnitude [dB] against the PT2 over
64 logarithmically spaced frequencies from 1 to 70 rad/s. Peaks beyond 8 % cost extra, half as much above 1 A, where no fit is
published.

    fit_tables.py check                          residuals of the published set `iwan_tables`
    fit_tables.py search SECONDS SEED EFFECT...  a new search, by default with the effects of that set
    fit_tables.py rivals SECONDS                 one search for each of several combinations of effects

A search stops by the clock: another machine gets a little further or less far with the same seed.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import differential_evolution

from rigsight.effects import effect_named
from rigsight.excitation import log_sweep
from rigsight.identify.hysteresis import SpectralRatio
from rigsight.records import Record
from rigsight.rigs import RUNNING_GEAR, evaluated
from rigsight.rigs.published import PublishedSet, published_sets
from rigsight.simulate import Structure, compose, parameter_vector, record_input, simulate_sets

Array = NDArray[np.float64]

DT = 0.005
"""Sample time of the rig [s]."""
GROWTH = float(np.log(640.0 / 1e-3)) / 150.0
"""Rate of the sweep of the thesis [e-folds per second]."""
BAND = (0.5, 110.0)
"""Angular frequency at the beginning and the end of the simulated sweep [rad/s]."""
OMEGA = np.geomspace(1.0, 70.0, 64)
FITTED = {
    published.amplitude: published
    for published in published_sets().values()
    if published.amplitude is not None
}
"""Amplitude [A] -> the linear set of Table 5.2."""
FIGURE_5_6 = {1.25: 12.0, 1.50: 14.0}
"""Amplitude [A] -> resonance [rad/s], where no fit is published."""

SPACE = {
    "J_z": (0.3, 0.7),
    "k_d": (0.01, 3.0),
    "k_c": (500.0, 5000.0),
    "a": (4e-3, 0.2),
    "x_s": (1e-3, 2e-2),
    "q": (-0.9, 1.0),
    "beta": (200.0, 2e4),
    "gamma": (-2e4, 2e4),
    "k_3": (3e2, 5e4),
    "T_a": (1e-3, 8e-2),
    "c_2": (0.1, 100.0),
    "T_c": (1e-3, 0.1),
    "g": (1e-6, 1e-3),
    "u_0": (1e-3, 0.1),
    "s": (5e-3, 5e-2),
    "k_s": (1e1, 1e4),
}
"""Parameter -> range searched; on a logarithmic scale where it is positive."""
RIVALS = (
    ("bouc_wen_hysteresis",),
    ("bouc_wen_hysteresis", "cubic_stiffness", "actuator_lag"),
    ("iwan_hysteresis",),
    ("iwan_hysteresis", "cubic_stiffness"),
    ("iwan_hysteresis", "actuator_lag"),
    ("iwan_hysteresis", "cubic_stiffness", "actuator_lag"),
    ("iwan_hysteresis", "cubic_stiffness", "quadratic_damping"),
    ("iwan_hysteresis", "actuator_lag", "end_stop"),
    ("iwan_hysteresis", "cubic_stiffness", "actuator_lag", "quadratic_damping"),
    ("iwan_hysteresis", "cubic_stiffness", "actuator_lag", "coulomb_friction"),
    ("iwan_hysteresis", "cubic_stiffness", "actuator_lag", "input_dead_zone"),
    ("iwan_hysteresis", "cubic_stiffness", "actuator_lag", "free_play"),
    ("iwan_hysteresis", "cubic_stiffness", "actuator_lag", "end_stop"),
)
"""Combinations of effects; the last five have one more than the published set."""


def table_magnitude(published: PublishedSet) -> Array:
    """Return the magnitude of a published PT2 [rad/A] at `OMEGA`."""
    J_z, k_c, k_d = (published.parameters[name] for name in ("J_z", "k_c", "k_d"))
    drive = evaluated(RUNNING_GEAR.motion.drive_gain, published.constants)
    return np.asarray(np.abs(drive / (k_c - J_z * OMEGA**2 + 1j * k_d * OMEGA)))


def target_peak(amplitude: float) -> float:
    """Return the frequency [rad/s] at which the published magnitude is largest."""
    if amplitude in FIGURE_5_6:
        return FIGURE_5_6[amplitude]
    J_z, k_c, k_d = (FITTED[amplitude].parameters[name] for name in ("J_z", "k_c", "k_d"))
    return float(np.sqrt(k_c / J_z - 0.5 * (k_d / J_z) ** 2))


def peaks(magnitude: Array) -> Array:
    """Return the frequency of each column's maximum, by a parabola through three points of the logarithm."""
    i = np.clip(np.argmax(magnitude, axis=0), 1, OMEGA.size - 2)
    left, top, right = (np.log(magnitude[i + d, np.arange(i.size)]) for d in (-1, 0, 1))
    curvature = left - 2.0 * top + right
    shift = np.where(curvature < 0.0, 0.5 * (left - right) / np.where(curvature < 0.0, curvature, 1.0), 0.0)
    return np.asarray(OMEGA[i] * (OMEGA[1] / OMEGA[0]) ** np.clip(shift, -1.0, 1.0))


@dataclass(frozen=True)
class Evaluation:
    """Error [dB rms] and peak [rad/s] of each set, by amplitude."""

    errors: Mapping[float, Array]
    peaks: Mapping[float, Array]

    @property
    def total(self) -> Array:
        return np.asarray(np.sqrt(np.mean([error**2 for error in self.errors.values()], axis=0)))

    @property
    def cost(self) -> Array:
        cost = self.total**2
        for amplitude, found in self.peaks.items():
            beyond = np.maximum(np.abs(np.log(found / target_peak(amplitude))) / 0.1 - 0.8, 0.0)
            cost = cost + (1.5 if amplitude in FITTED else 0.75) * beyond**2
        return cost


class Sweeps:
    """The sweeps at all amplitudes, and what parameter sets of a structure make of them."""

    def __init__(self, structure: Structure, growth: float = GROWTH, width: float = 0.035) -> None:
        t = np.arange(round(np.log(BAND[1] / BAND[0]) / growth / DT) + 1) * DT
        self.structure = structure
        unit = Record("sweep", DT, {"u": log_sweep(t, 1.0, *BAND)}, {"u": "A"})
        self.rows = SpectralRatio("u", "psi", OMEGA, width).rows(unit)
        self.inputs = {
            amplitude: record_input(structure, unit.with_signals(u=amplitude * unit["u"]))
            for amplitude in sorted((*FITTED, *FIGURE_5_6))
        }
        self.n_samples = t.size

    def evaluate(self, p: Array, substeps: int = 3) -> Evaluation:
        """Evaluate parameter sets of shape (n_parameters, n_sets) about the rest position."""
        errors, tops = {}, {}
        rest = np.zeros((len(self.structure.states), p.shape[1]))
        for amplitude, held in self.inputs.items():
            psi = simulate_sets(self.structure, held, p, rest, self.n_samples, substeps)[:, 0]
            # A set that diverges gets a response of nearly nothing, and with it a large error.
            real, imaginary = np.split(self.rows @ np.nan_to_num(psi, posinf=0.0, neginf=0.0), 2)
            magnitude = np.maximum(np.hypot(real, imaginary) / amplitude, 1e-12)
            tops[amplitude] = peaks(magnitude)
            if amplitude in FITTED:
                ratio = 20.0 * np.log10(magnitude / table_magnitude(FITTED[amplitude])[:, None])
                errors[amplitude] = np.sqrt(np.mean(ratio**2, axis=0))
        return Evaluation(errors, tops)


def vectors(structure: Structure, values: Mapping[str, float]) -> Array:
    """Return one parameter set as `Sweeps.evaluate` takes it; the rest position plays no part in a response."""
    return parameter_vector(structure, {**values, "psi_off": 0.0, "y_off": 0.0})[:, None]


def structure_with(effects: Sequence[str]) -> Structure:
    """Return the running gear with effects; the exponent of Bouc-Wen is 1, which saves a power."""
    fixed = {"n": 1.0, "A": 1.0} if "bouc_wen_hysteresis" in effects else {}
    return compose(RUNNING_GEAR, [effect_named(name) for name in effects], fixed)


def search(sweeps: Sweeps, seconds: float, seed: int, n_sets: int = 48) -> dict[str, float]:
    """Return the best set that a differential evolution finds in the time given, all sets of a generation side by side."""
    structure = sweeps.structure
    known = published_sets()["nominal"].values()
    free = [name for name in structure.names if name in SPACE]
    bounds = [SPACE[name] if SPACE[name][0] <= 0.0 else tuple(np.log(SPACE[name])) for name in free]
    fixed = vectors(structure, {**known, **{name: SPACE[name][1] for name in free}})

    def decode(places: Array) -> Array:
        p = np.repeat(fixed, places.shape[1], axis=1)
        for name, place in zip(free, places, strict=True):
            p[structure.names.index(name)] = place if SPACE[name][0] <= 0.0 else np.exp(place)
        return p

    end = time.monotonic() + seconds

    def out_of_time(*_: object, **__: object) -> bool:
        return time.monotonic() > end

    found = differential_evolution(
        lambda places: sweeps.evaluate(decode(places)).cost,
        bounds,
        strategy="currenttobest1bin",
        popsize=-(-n_sets // len(free)),
        init="sobol",
        mutation=(0.4, 0.9),
        recombination=0.9,
        maxiter=10**6,
        tol=1e-3,
        polish=False,
        updating="deferred",
        vectorized=True,
        callback=out_of_time,
        rng=np.random.default_rng(seed),
    )
    return dict(zip(structure.names, map(float, decode(found.x[:, None])[:, 0]), strict=True))


def show(title: str, found: Evaluation) -> None:
    """Print errors and peaks of the first set."""
    print(f"{title}: {found.total[0]:.2f} dB rms over the four fits")
    for amplitude, tops in found.peaks.items():
        error = f"{found.errors[amplitude][0]:.2f} dB" if amplitude in found.errors else "   -   "
        aim = target_peak(amplitude)
        print(
            f"  {amplitude:.2f} A  {error}  peak {tops[0]:5.1f}, published {aim:5.1f} ({tops[0] / aim - 1:+.0%})"
        )


def show_all(structure: Structure, values: Mapping[str, float]) -> None:
    """Print the residuals of a set and how they depend on steps, sweep rate and averaging."""
    p = vectors(structure, values)
    show("As searched", Sweeps(structure).evaluate(p))
    show("Four times as many steps", Sweeps(structure).evaluate(p, substeps=12))
    show("Sweep four times slower", Sweeps(structure, GROWTH / 4.0).evaluate(p))
    show("Half the averaging", Sweeps(structure, width=0.0175).evaluate(p))


def show_rivals(seconds: float) -> None:
    """Print what the best set of each combination of effects leaves."""
    for effects in RIVALS:
        sweeps = Sweeps(structure_with(effects))
        best = min(
            (
                sweeps.evaluate(vectors(sweeps.structure, search(sweeps, 0.5 * seconds, seed)))
                for seed in (1, 2)
            ),
            key=lambda evaluation: float(evaluation.cost[0]),
        )
        worst = max(abs(tops[0] / target_peak(amplitude) - 1.0) for amplitude, tops in best.peaks.items())
        print(f"{best.total[0]:.2f} dB, worst peak {worst:3.0%}  {', '.join(effects)}", flush=True)


def main(arguments: list[str]) -> None:
    published = published_sets()["iwan_tables"]
    match arguments:
        case ["search", seconds, seed, *effects]:
            structure = structure_with(effects or tuple(published.effects))
            found = search(Sweeps(structure), float(seconds), int(seed))
            print(", ".join(f"{name} = {found[name]:.5g}" for name in structure.names if name in SPACE))
            show_all(structure, found)
        case ["rivals", seconds]:
            show_rivals(float(seconds))
        case ["check"]:
            show_all(structure_with(tuple(published.effects)), published.values())
        case _:
            raise SystemExit(__doc__)


if __name__ == "__main__":
    main(sys.argv[1:])

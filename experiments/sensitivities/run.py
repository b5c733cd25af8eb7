"""Accuracy and cost of derivatives that are integrated along with the motion, and their benefit in fits.

run.py                     all tables, in results.md beside this file (3 minutes)
run.py --repeats 20        times as the least of this many
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from rigsight.effects import CATALOGUE, effect_named
from rigsight.excitation import log_sweep
from rigsight.identify.fit import fit_problem
from rigsight.identify.fit.coordinates import FINE_STEP, STEP, Coordinates
from rigsight.identify.fit.grey_box import GreyBoxFit
from rigsight.libraries import library_cache
from rigsight.libraries.library_cache import c_compilers, library
from rigsight.records import Record
from rigsight.records.record import Hold
from rigsight.rigs import RUNNING_GEAR
from rigsight.simulate import FittedRecord, compose, record_input
from rigsight.simulate.compiled import kernel
from rigsight.simulate.compiled.kernel import Kernel
from rigsight.simulate.compiled.kernel_source import KernelEquations, kernel_source
from rigsight.simulate.side_by_side import choose_substeps
from rigsight.units import characteristic_value
from rigsight.workflow.own import effect_checks

N_SAMPLES, DT = 1500, 5e-3
CENTRAL = (1e-3, 3e-4, 1e-4, 3e-5, 1e-5)
"""Steps of central differences of the accurate integrator; those two that agree best tell the truth, and how well."""
DIRECTIONS = (8, 14)
STARTS = 10
CASES: dict[str, tuple[tuple[str, ...], dict[str, float], Hold]] = {
    "linear": ((), {}, "band_limited"),
    "cubic": (("cubic_stiffness",), {}, "band_limited"),
    "flexible mode": (("flexible_mode",), {}, "band_limited"),
    "input delay, held": (("input_delay",), {}, "zoh"),
    "Bouc-Wen, n = 1": (("bouc_wen_hysteresis",), {"n": 1.0}, "band_limited"),
    "Bouc-Wen": (("bouc_wen_hysteresis",), {}, "band_limited"),
    "pendulum (sin)": (("gravity_pendulum",), {}, "band_limited"),
    "creep saturation (tanh)": (("creep_saturation",), {}, "band_limited"),
    "Coulomb, held": (("coulomb_friction",), {}, "zoh"),
    "Coulomb": (("coulomb_friction",), {}, "band_limited"),
    "Coulomb, delay, held": (("coulomb_friction", "input_delay"), {}, "zoh"),
    "Stribeck": (("stribeck_friction",), {}, "band_limited"),
}
VALUES = {
    "v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27, "J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "l_0": 0.25, "c_y": 0.98,
    "psi_off": 1e-3, "y_off": 0.0, "k_3": 5e3, "T_c": 0.05, "T_d": 0.013, "a": 0.3, "A": 1.0, "beta": 300.0,
    "gamma": -180.0, "n": 1.5, "k_g": 10.0, "s": 5e-3, "T_s": 0.07, "w_s": 0.2, "m_a": 0.05, "w_a": 25.0, "zeta_a": 0.05,
}  # fmt: skip
SCALES = {"x": 0.02, "force": 1.0, "drive": 1.0, "input": 0.5, "time": 0.08, "length": 0.02}


@contextmanager
def carried(chosen: bool | None) -> Iterator[None]:
    """Let all kernels carry tangents or none; None for the rule of the engine."""
    rule = KernelEquations.carries_tangents
    if chosen is not None:
        KernelEquations.carries_tangents = property(lambda _: chosen)  # type: ignore[assignment]
    kernel._by_identity.clear()
    try:
        yield
    finally:
        KernelEquations.carries_tangents = rule  # type: ignore[method-assign]
        kernel._by_identity.clear()


class Case:
    """A sweep of the running gear, its kernels of both kinds, and the coordinates of a fit with their derivatives."""

    def __init__(self, name: str) -> None:
        effects, fixed, hold = CASES[name]
        self.structure = structure = compose(RUNNING_GEAR, map(effect_named, effects), fixed)
        t = DT * np.arange(N_SAMPLES)
        record = Record("sweep", DT, {"u": log_sweep(t, 0.5, 1.0, 60.0)}, {"u": "A"}, hold=hold)
        self.held = record_input(structure, record)
        values = {p.name: VALUES[p.name] for p in structure.parameters}
        free = ["J_z", "k_c", "k_d", "c_y", "psi_off", "y_off"]
        free += [
            p.name
            for p in structure.parameters[len(RUNNING_GEAR.constants) + len(RUNNING_GEAR.parameters) :]
            if p.fitted
        ]
        self.coordinates = Coordinates.of(structure, free, values, SCALES)
        self.sizes = np.array([characteristic_value(d, SCALES) for d in structure.state_dimensions])
        self.theta = np.append(self.coordinates.from_values(values), np.full(self.sizes.size, 0.01))
        self.n_free = len(free)
        self.kernels: dict[bool, Kernel] = {}
        for kind in (False, True):
            with carried(kind):
                self.kernels[kind] = kernel.kernel_of(structure)
        p, x0 = self.place(self.theta)
        chosen = choose_substeps(structure, self.held, p, x0, N_SAMPLES, 1e-4)
        self.substeps = chosen.per_piece(self.held.n_pieces)

    def place(self, theta: Any) -> tuple[Any, Any]:
        return self.coordinates.to_parameters(theta[: self.n_free]), theta[self.n_free :] * self.sizes

    def directions(self) -> tuple[Any, Any]:
        slopes, n = self.coordinates.derivatives(self.theta[: self.n_free]), self.sizes.size
        dp = np.hstack([slopes, np.zeros((slopes.shape[0], n))])
        return dp, np.hstack([np.zeros((n, self.n_free)), np.diag(self.sizes)])

    def truth(self) -> Any:
        def out(theta: Any) -> Any:
            p, x0 = self.place(theta)
            return self.kernels[True].simulate_one(self.held, p, x0, 3e-12, N_SAMPLES)[1]

        best = []
        for direction in np.eye(self.theta.size):
            tried = [
                (out(self.theta + h * direction) - out(self.theta - h * direction)) / (2.0 * h)
                for h in CENTRAL
            ]
            apart = [np.linalg.norm(b - a) for a, b in pairwise(tried)]
            best.append(tried[int(np.argmin(apart)) + 1])
        return np.moveaxis(np.array(best), 0, 2)

    def tangents(self) -> Any:
        p, x0 = self.place(self.theta)
        return self.kernels[True].simulate_tangents(
            self.held, p, *self.directions()[:1], x0, self.directions()[1], self.substeps, N_SAMPLES
        )[:, :, 1:]

    def differences(self, step: float) -> Any:
        p, x0 = np.array(
            [
                self.place(t)
                for t in self.theta + step * np.vstack([np.zeros(self.theta.size), np.eye(self.theta.size)])
            ],
            dtype=object,
        ).T
        out = self.kernels[False].simulate_lanes(
            self.held, np.column_stack(p), np.column_stack(x0), self.substeps, N_SAMPLES
        )
        return (out[:, :, 1:] - out[:, :, :1]) / step

    def cost(self, n: int, repeats: int) -> tuple[float, float]:
        """Return CPU nanoseconds per sample and direction of differences and of tangents."""
        (p, x0), (dp, dx0) = self.place(self.theta), self.directions()
        chosen = np.arange(n) % self.theta.size
        dp, dx0 = np.ascontiguousarray(dp[:, chosen]), np.ascontiguousarray(dx0[:, chosen])
        sets, states = (
            np.column_stack([p, p[:, None] + STEP * dp]),
            np.column_stack([x0, x0[:, None] + STEP * dx0]),
        )
        record = [FittedRecord(self.held, self.substeps, np.zeros((N_SAMPLES, 2)), np.ones(2))]
        return least(
            repeats,
            lambda: self.kernels[False].normal_equations(record, sets, states[None]),
            lambda: self.kernels[True].tangent_equations(record, p, dp, x0[None], dx0),
            1e9 / (N_SAMPLES * n),
        )

    def compiled(self, repeats: int) -> tuple[float, float]:
        """Return CPU seconds of generating and compiling the kernel with differences and with tangents."""

        def make(kind: bool) -> Callable[[], None]:
            def run() -> None:
                with carried(kind):
                    text = kernel_source(self.structure)
                library(c_compilers()[0], {"kernel.c": text}, library_cache.kernel_options())

            return run

        return least(repeats, make(False), make(True), 1.0)


def cpu() -> float:
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def least(
    repeats: int, one: Callable[[], Any], other: Callable[[], Any], factor: float
) -> tuple[float, float]:
    """Return the least CPU time of each, taken by turns."""
    times: list[tuple[float, float]] = []
    for _ in range(repeats):
        begin = cpu()
        one()
        middle = cpu()
        other()
        times.append((middle - begin, cpu() - middle))
    return factor * min(t for t, _ in times), factor * min(t for _, t in times)


def worst(found: Any, truth: Any) -> float:
    """Return the largest relative error of a derivative."""
    return float(np.max(np.linalg.norm(found - truth, axis=(0, 1)) / np.linalg.norm(truth, axis=(0, 1))))


def kernel_line(name: str, repeats: int) -> str:
    case = Case(name)
    truth = case.truth()
    errors = [
        worst(found, truth)
        for found in (case.differences(STEP), case.differences(FINE_STEP), case.tangents())
    ]
    costs = [case.cost(n, repeats) for n in DIRECTIONS]
    built = case.compiled(3)
    rule = KernelEquations(case.structure).carries_tangents
    return " | ".join(
        [
            f"| {name}", *(f"{error:.0e}" for error in errors),
            *(f"{a:.0f} | {b:.0f} | {b / a:.2f}" for a, b in costs),
            f"{built[1] / built[0] - 1.0:+.0%}", ("tangents" if rule else "differences") + " |",
        ]
    )  # fmt: skip


def fits(effect: Any) -> tuple[GreyBoxFit, dict[str, float], tuple[str, ...]]:
    """Return the last fit that the check of an effect makes, with its start."""
    made: list[Any] = []
    plain = GreyBoxFit.fit

    def kept(self: GreyBoxFit, start: Any, free: Any) -> Any:
        made.append((self, start, free))
        return plain(self, start, free)

    GreyBoxFit.fit = kept  # type: ignore[method-assign, assignment]
    try:
        effect_checks.is_found_again(effect)
    finally:
        GreyBoxFit.fit = plain  # type: ignore[method-assign]
    return made[-1]


WAYS: tuple[tuple[bool | None, float], ...] = ((False, STEP), (False, FINE_STEP), (None, FINE_STEP))


def fit_line(effect: Any) -> tuple[str, list[tuple[int, float]]]:
    fit, start, free = fits(effect)
    ended: list[list[Any]] = [[] for _ in WAYS]
    times = [0.0] * len(WAYS)
    rng = np.random.default_rng(5)
    # A first one compiles; what it takes is not counted.
    for i in range(STARTS + 1):
        near = {k: v * (1.0 + 0.02 * rng.normal()) if k in free else v for k, v in start.items()}
        for way, (kind, step) in enumerate(WAYS):
            fit_problem.FINE_STEP = step
            with carried(kind):
                begin = time.process_time()
                result = fit.fit(near, free)
                if i:
                    times[way] += time.process_time() - begin
                    ended[way].append(result)
    fit_problem.FINE_STEP = FINE_STEP
    best = min(r.cost for results in ended for r in results)
    cells = []
    for results in ended:
        good = [r for r in results if r.cost < best + 1.0]
        moved = (
            np.array([[r.values[n] / good[0].standard_errors[n] for n in free] for r in good])
            if good
            else np.zeros((1, 1))
        )
        cells.append(
            f"{sum(r.n_evaluations for r in results)} | {len(good)} | {np.max(np.std(moved, axis=0)):.0e}"
        )
    return f"| {effect.name} | " + " | ".join(cells) + " |", [
        (sum(r.n_evaluations for r in results), t) for results, t in zip(ended, times, strict=True)
    ]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeats", type=int, default=9, help="repetitions of each timing")
    asked = parser.parse_args()
    lines = [
        "# Derivatives: errors, costs, fits", "",
        f"Largest relative error of a derivative; CPU nanoseconds per sample and direction, least of {asked.repeats}; time to "
        "generate and compile a kernel.", "",
        "| case | error, step 1e-4 | step 1e-6 | tangents | 8: differences | tangents | ratio "
        "| 14: differences | tangents | ratio | compilation | chosen |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]  # fmt: skip
    for name in CASES:
        lines.append(kernel_line(name, asked.repeats))
        print(lines[-1], flush=True)
    head = " | ".join(
        f"{way}: evaluations | at the best end | spread" for way in ("step 1e-4", "step 1e-6", "chosen")
    )
    lines += [
        "", f"Fits of each effect's own simulation from {STARTS} starts, 2 % apart: evaluations of all, how many ended at "
        "the least cost (within a variance of the noise), and how far these ends lie apart, in standard errors.", "",
        f"| effect | {head} |", "|---" * 10 + "|",
    ]  # fmt: skip
    totals = np.zeros((len(WAYS), 2))
    for effect in CATALOGUE:
        line, sums = fit_line(effect)
        totals += sums
        lines.append(line)
        print(line, flush=True)
    told = ", ".join(f"{n:.0f} evaluations in {t:.1f} s" for n, t in totals)
    lines += ["", f"In all, in the same order: {told} of CPU time."]
    Path(__file__).with_name("results.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(lines[-1])


if __name__ == "__main__":
    main()

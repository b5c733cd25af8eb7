"""The equations that plain pysindy finds on the records of `rigsight discover`, and the errors of their simulation.

pysindy gets numbers near one, the kinematic row for nothing (x' = v), its own derivatives (finite differences of two orders,
Savitzky-Golay of several widths, spectral), a polynomial library and a custom one that holds all static terms of our rigs, and
of a scan of STLSQ thresholds the one that is best on the very records it is scored on. Initial states are fitted for both.

Run with ``python experiments/discovery/side_by_side.py CAMPAIGN...``.
"""

from __future__ import annotations

import math
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import resample

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    import pysindy as ps

from rigsight.metrics import nrmse
from rigsight.records import Record
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.diagnose import run_diagnose
from rigsight.workflow.discover import run_discover

warnings.filterwarnings("ignore", module="pysindy")
THRESHOLDS = np.geomspace(1e-4, 0.5, 12)
EDGE = 50
"""Samples that are left out at both ends of a record, where derivatives are poor."""
SUBSTEPS = 2
RUNAWAY = 1e3
CUSTOM = ("1", "x", "v", "u", "x**2", "x**3", "abs(v)*v", "copysign(1,v)", "abs(v)*x", "v*abs(x)", "x**2*v")
"""Of scaled displacement, velocity and input; |v| x and v |x| are Bouc-Wen's terms as far as they go without its state."""


@dataclass(frozen=True)
class Sizes:
    """Units in which everything is near one: displacement, input, time; and the mean displacement."""

    x: float
    u: float
    time: float
    rest: float


def derivatives() -> dict[str, Callable[[], ps.BaseDifferentiation]]:
    found: dict[str, Callable[[], ps.BaseDifferentiation]] = {
        "finite differences, order 2": lambda: ps.FiniteDifference(order=2),
        "finite differences, order 6": lambda: ps.FiniteDifference(order=6),
        "spectral": lambda: ps.SpectralDerivative(),
    }
    for width in (7, 15, 31):
        found[f"Savitzky-Golay, {width}"] = lambda width=width: ps.SmoothedFiniteDifference(
            order=6, smoother_kws={"window_length": width, "polyorder": 5, "axis": 0}
        )
    return found


def scaled(record: Record, output: str, sizes: Sizes) -> tuple[np.ndarray, np.ndarray, float]:
    return (record[output] - sizes.rest) / sizes.x, record["u"] / sizes.u, record.dt / sizes.time


def fitted(
    records: list[Record],
    output: str,
    sizes: Sizes,
    make: Callable[[], ps.BaseDifferentiation],
    library: str,
    threshold: float,
) -> dict[str, float]:
    """Return the terms of the scaled acceleration."""
    points, rates, inputs = [], [], []
    for record in records:
        x, u, dt = scaled(record, output, sizes)
        t = dt * np.arange(x.size)
        first, second = make(), make()
        v = np.asarray(first(x[:, None], t))
        a = np.asarray(second(v, t))
        smooth = np.asarray(getattr(first, "smoothed_x_", x[:, None])).reshape(x.size, 1)
        inside = slice(EDGE, -EDGE)
        points.append(np.column_stack([smooth, v])[inside])
        rates.append(np.column_stack([v, a])[inside])
        inputs.append(u[inside, None])
    features = ps.PolynomialLibrary(degree=3) if library == "polynomial" else _custom()
    model = ps.SINDy(optimizer=ps.STLSQ(threshold=threshold), feature_library=features)
    model.fit(points, dt, x_dot=rates, u=inputs, feature_names=["x", "v", "u"])
    names = [name.replace("^", "**").replace(" ", "*") for name in model.get_feature_names()]
    return {
        name: float(weight)
        for name, weight in zip(names, model.coefficients()[1], strict=True)
        if weight != 0.0
    }


def _custom() -> ps.CustomLibrary:
    # Functions of three arguments in three variables, each order taken once: one column per function.
    known = {"abs": np.abs, "copysign": np.copysign}
    functions = [eval(f"lambda x, v, u: {name} + 0.0 * x", known) for name in CUSTOM]
    return ps.CustomLibrary(functions, [lambda *_, name=name: name for name in CUSTOM], interaction_only=True)


def free_run(
    terms: dict[str, float], u: np.ndarray, dt: float, band_limited: bool, start: np.ndarray
) -> np.ndarray:
    """Return the scaled displacement, shape (n_samples,); infinite where it runs away."""
    source = " + ".join(f"{weight!r}*{name}" for name, weight in terms.items()) or "0.0"
    acceleration = eval(f"lambda x, v, u: {source}", {"abs": abs, "copysign": math.copysign})
    step = dt / SUBSTEPS
    finer = 2 * SUBSTEPS
    if band_limited:
        inputs = resample(np.concatenate([u, u[::-1]]), 2 * finer * u.size)[: finer * u.size].tolist()
    else:
        inputs = np.interp(np.arange(finer * u.size) / finer, np.arange(u.size), u).tolist()
    inputs.append(inputs[-1])
    x, v = map(float, start)
    out = np.full(u.size, np.inf)
    for i in range(u.size):
        out[i] = x
        for j in range(SUBSTEPS):
            u_0, u_1, u_2 = inputs[finer * i + 2 * j : finer * i + 2 * j + 3]
            a_1 = acceleration(x, v, u_0)
            v_2 = v + 0.5 * step * a_1
            a_2 = acceleration(x + 0.5 * step * v, v_2, u_1)
            v_3 = v + 0.5 * step * a_2
            a_3 = acceleration(x + 0.5 * step * v_2, v_3, u_1)
            v_4 = v + step * a_3
            a_4 = acceleration(x + step * v_3, v_4, u_2)
            x, v = (
                x + step * (v + 2 * v_2 + 2 * v_3 + v_4) / 6,
                v + step * (a_1 + 2 * a_2 + 2 * a_3 + a_4) / 6,
            )
            if not abs(x) + abs(v) < RUNAWAY:
                return out
    return out


def scored(terms: dict[str, float], held_out: Record, output: str, sizes: Sizes, refine: bool) -> float:
    """Return the NRMSE of a free run; with `refine`, from the initial state that fits best."""
    x, u, dt = scaled(held_out, output, sizes)
    band_limited = held_out.hold == "band_limited"
    start = np.array([x[0], (x[1] - x[0]) / dt])

    def error(state: np.ndarray) -> np.ndarray:
        return np.nan_to_num(free_run(terms, u, dt, band_limited, state) - x, nan=RUNAWAY, posinf=RUNAWAY)

    if refine:
        start = least_squares(error, start, max_nfev=6, diff_step=1e-3).x
    return nrmse(error(start), x)


def plain(estimation: list[Record], held_out: Record, output: str, sizes: Sizes) -> None:
    """Print the best of all thresholds and derivatives of each library."""
    for library in ("polynomial", "custom"):
        best, passed = (RUNAWAY, "", ""), 0.0
        for way, make in derivatives().items():
            started = time.process_time()
            found = [(t, fitted(estimation, output, sizes, make, library, t)) for t in THRESHOLDS]
            passed += time.process_time() - started
            different = {tuple(terms.items()): terms for _, terms in found if terms}
            for terms in different.values():
                error = scored(terms, held_out, output, sizes, False)
                text = ", ".join(name.replace("*", "·").replace("··", "^") for name in terms)
                if error < best[0]:
                    best = scored(terms, held_out, output, sizes, True), way, f"{len(terms)}: {text}"
        shown = f"{100.0 * best[0]:.3g} %" if best[0] < RUNAWAY / 10 else "runs away"
        print(
            f"| pysindy, {library}, {best[1]} | {best[2] or 'no term'} | {shown} | {passed:.1f} s |",
            flush=True,
        )


def main(folders: list[str]) -> None:
    for folder in folders:
        campaign = read_campaign(folder)
        rig = campaign.rig
        print(f"\n{campaign.title}\n\n| way | terms | held-out NRMSE | processor time |")
        print("|---|---|---|---|", flush=True)
        started = time.process_time()
        found = run_discover(folder, n_jobs=1)
        passed = time.process_time() - started
        terms = ", ".join(f"{term.name} {term.where}".strip() for term in found.kept) or "no term"
        error = f"{100.0 * found.held_out_nrmse:.3g} % ({found.held_out_error:.3g} floors)"
        print(f"| rigsight discover | rig's own, {terms} | {error} | {passed:.0f} s |", flush=True)
        started = time.process_time()
        diagnosis = run_diagnose(folder, n_jobs=1)
        passed = time.process_time() - started
        named = ", ".join(diagnosis.effects) or diagnosis.verdict
        gap = math.sqrt(np.mean([100.0**2 * own.after**2 for own in diagnosis.gap.values()]))
        print(f"| rigsight diagnose | {named} ({diagnosis.probability:.2f}) | {gap:.3g} % | {passed:.0f} s |")
        print(f"| (noise floor) | | {100.0 * found.noise_floor:.3g} % | |", flush=True)
        if not (rig.has_one_motion and rig.is_driven):
            continue
        source, output = rig.inputs[0].name, rig.outputs[0].name
        named_u = [r if source == "u" else r.with_signals(u=r[source]) for r in campaign.records]
        estimation = [record for record in named_u if record.role == "estimation"]
        held_out = next(record for record in named_u if record.role == "validation")
        measured = np.concatenate([record[output] for record in estimation])
        rates = np.concatenate([np.gradient(record[output], record.dt) for record in estimation])
        inputs = np.concatenate([record["u"] for record in estimation])
        size = float(np.std(measured))
        sizes = Sizes(size, float(np.std(inputs)), size / float(np.std(rates)), float(np.mean(measured)))
        plain(estimation, held_out, output, sizes)


if __name__ == "__main__":
    main(sys.argv[1:])

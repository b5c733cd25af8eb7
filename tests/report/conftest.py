"""A synthetic diagnosis, made without simulating: signals of the right shape, numbers of the right size."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from rigsight.diagnose.advise import Advice
from rigsight.diagnose.data_quality.finding import AmplitudeDependence, DataQuality, Finding
from rigsight.diagnose.location.gap_parts import (
    AmplitudePart,
    BandPart,
    Localization,
    PathPart,
    RecordPart,
    StatePart,
    TimePart,
)
from rigsight.diagnose.location.trace import Trace
from rigsight.diagnose.noise.detection import NoiseFloor
from rigsight.diagnose.result import Candidate, Diagnosis, Estimate, OutputGap
from rigsight.effects import Family, effect_named
from rigsight.inverse import MissingForce, Proposal, ProposedCause
from rigsight.report.render import render_report

NOISE = {"psi": 4e-4, "y": 3e-5, "force": 12.0}
SIZE = {"psi": 0.06, "y": 0.004, "force": 900.0}
UNITS = {"u": "A", "psi": "rad", "y": "m", "x": "m", "force": "N"}


def trace(
    record: str, role: str, outputs: tuple[str, ...], n_samples: int = 2000, amplitude: float | None = 0.5
) -> Trace:
    rng = np.random.default_rng(len(record))
    t = 0.005 * np.arange(n_samples)
    phase = 2 * np.pi * (0.2 * t + 0.5 * 2.8 / t[-1] * t**2)
    bump = 1.0 + 1.5 * np.exp(-(((t - 0.6 * t[-1]) / (0.1 * t[-1])) ** 2))
    measured, before, reidentified, after = {}, {}, {}, {}
    for output in outputs:
        truth = SIZE[output] * bump * np.sin(phase)
        measured[output] = truth + NOISE[output] * rng.standard_normal(n_samples)
        before[output] = 0.8 * SIZE[output] * bump * np.sin(phase - 0.35)
        reidentified[output] = 0.9 * SIZE[output] * bump * np.sin(phase - 0.15)
        after[output] = truth + 0.2 * NOISE[output] * np.sin(3 * t)
    source = "x" if "force" in outputs else "u"
    return Trace(
        record, role, "sweep", amplitude, t, {source: np.sin(phase)}, measured, before, reidentified, after
    )


def of_motion(share: float) -> Proposal:
    """Return quadratic damping as the missing force along a motion."""
    rng, time = np.random.default_rng(0), 0.01 * np.arange(400)
    x, v = 0.01 * np.sin(6.0 * time), 0.06 * np.cos(6.0 * time)
    force = MissingForce(
        "yaw_dynamics",
        "rad",
        "N m",
        1.0,
        0.3,
        ("sweep",) * 400,
        time,
        x,
        v,
        90.0 * v * np.abs(v) + 0.02 * rng.standard_normal(400),
    )
    damping = effect_named("quadratic_damping")
    cause = ProposedCause(damping, Family.DAMPING_LAW, "yaw_dynamics", share, {"c_2": 90.0})
    return Proposal((cause,), (cause,), frozenset({damping.name}), share, 0.01, forces=(force,))


def candidate(
    effects: tuple[str, ...], probability: float, error_over_noise: float, **fields: Any
) -> Candidate:
    floor = {"psi": 0.009, "y": 0.011}
    values: dict[str, Any] = {
        "effects": effects,
        "probability": probability,
        "validation_nrmse": {name: error_over_noise * f for name, f in floor.items()},
        "estimation_nrmse": {name: 0.9 * error_over_noise * f for name, f in floor.items()},
        "error_over_noise": error_over_noise,
        "parameters": {
            "J_z": Estimate(0.5612, 0.0021, "kg m^2"),
            "k_c": Estimate(700.4, 1.7, "N m/rad"),
            "k_d": Estimate(2.04, 0.4, "N m s/rad"),
            "a": Estimate(0.0903, 0.0011, "1"),
            "beta": Estimate(1203.0, 31.0, "1/rad"),
            "gamma": Estimate(497.0, float("inf"), "1/rad"),
            "k_3": Estimate(-3.1e5, 2.0e3, "N m/rad^3"),
        },
        "success": True,
        "message": "converged",
    }
    fields = {**values, **fields}
    return Candidate(**{"where": tuple("yaw_dynamics" for _ in fields["effects"]), **fields})


def figures(output: str, scale: float = 1.0) -> dict[str, Any]:
    return {
        "output": output, "before": 0.4 * scale, "reidentified": 0.13 * scale, "after": 0.01 * scale,
        "noise_floor": 0.009, "share": 0.3, "noise_share": 0.01,
    }  # fmt: skip


def localization() -> Localization:
    """Parts of every kind, with numbers of the right size and what may be unknown unknown."""
    limits = {"before": (0.3, 0.5), "reidentified": (0.1, 0.2), "after": (0.008, 0.012)}
    edges = [0.0, 1.0, 3.0, 10.0, 30.0, 600.0]
    names = ("sweep_A0.75.csv", "sweep_A0.25.csv")
    states = [
        StatePart(
            **figures("psi", 1.0 + 0.2 * j), x_low=0.02 * i, x_high=0.02 * (i + 1), v_low=0.1 * j, v_high=0.1 * (j + 1),
            n_samples=50, force_mean=-1.5 if j >= 0 else 1.2, force_rms=1.6, force_noise=0.1,
            units={"x_low": "rad", "v_low": "rad/s", "force_mean": "N m"},
        )
        for i in range(-2, 2)
        for j in range(-2, 2)
    ]  # fmt: skip
    return Localization(
        by_record=tuple(
            RecordPart(
                **figures("psi"), record=name, role=role, kind="sweep", amplitude=0.5, scored=role == "validation",
                n_samples=2000, duration=20.0, measured_rms=0.03, rms=0.003, freedom=500.0, interval=limits,
            )
            for name, role in zip(names, ("validation", "estimation"), strict=True)
        ),
        by_amplitude=tuple(
            AmplitudePart(
                **figures("psi", 0.5 / a), amplitude=a, role="validation", scored=a > 0.5, records=names, measured_rms=0.03,
                units={"amplitude": "A", "measured_rms": "rad"},
            )
            for a in (0.75, 0.25)
        ),
        by_band=tuple(
            BandPart(**figures("psi", 1.0 / (1 + i)), omega_low=edges[i], omega_high=edges[i + 1], excited=i < 4)
            for i in range(5)
        ),
        by_state=tuple(states),
        by_time=tuple(
            TimePart(
                **figures("psi", 1.0 + i), record=name, t_start=float(i), t_end=float(i + 1), omega=float("nan"), mean=0.0
            )
            for name in names
            for i in range(6)
        ),
        by_path=(
            PathPart(**figures("psi"), path="u -> psi", source="u"),
            PathPart(
                **{**figures("y"), "after": float("nan")}, path="psi -> y", source="psi", shift=-0.004, shift_std=1e-4,
                shifted=0.011,
            ),
        ),
        sentence="The gap lies before psi is measured.",
    )  # fmt: skip


@pytest.fixture(scope="session")
def diagnosis() -> Diagnosis:
    """An effect named with a look-alike, two outputs, a record without y, a fit that failed."""
    return Diagnosis(
        title="rear axle, March",
        rig="running_gear",
        verdict="effect",
        effects=("bouc_wen_hysteresis",),
        where=("yaw_dynamics",),
        ambiguous_with=(("coulomb_friction", "cubic_stiffness"),),
        candidates=(
            candidate(("bouc_wen_hysteresis",), 0.91, 1.04),
            candidate(("coulomb_friction", "cubic_stiffness"), 0.06, 1.06),
            candidate(("stribeck_friction",), 0.01, 3.2),
            candidate(("cubic_stiffness",), 0.0, 8.4, success=False, message="step limit reached"),
            candidate((), 0.0, 14.4),
            candidate(("end_stop",), 0.0, float("inf"), success=False, message="left the range of numbers"),
        ),
        gap={
            "psi": OutputGap(0.42, 0.13, 0.0094, 0.009, {"before": (0.39, 0.45), "closed": (0.95, 0.98)}),
            "y": OutputGap(0.38, 0.15, 0.0113, 0.011),
        },
        noise_floors=(
            NoiseFloor("psi", "rad", NOISE["psi"], "stretches in which the input rests"),
            NoiseFloor("y", "m", NOISE["y"], "top of the spectrum (white noise only)"),
        ),
        traces=(
            trace("sweep_A0.75.csv", "validation", ("psi", "y"), amplitude=0.75),
            trace("step_A0.6.csv", "validation", ("psi",), 700, amplitude=0.6),
            trace("sweep_A0.25.csv", "estimation", ("psi", "y"), amplitude=0.25),
        ),
        units=UNITS,
        model={
            "parameters": {"J_z": 0.5612, "k_c": 700.4, "k_d": 2.04},
            "effect_parameters": {"A": 1.0, "a": 0.0903, "beta": 1203.0, "gamma": 497.0, "n": 1.0},
            "units": {"J_z": "kg m^2"},
        },
        localization=localization(),
        notes=("Record step_A0.6.csv holds no y.", "With the effect the simulation reaches the noise floor."),
    )


@pytest.fixture(scope="session")
def variant(diagnosis: Diagnosis) -> Callable[[str], Diagnosis]:
    """Diagnoses of other kinds, by name."""
    # One record is enough where records are not the matter: figures take the time of these tests.
    one = {"traces": diagnosis.traces[:1]}
    nothing = {**one, "effects": (), "where": (), "ambiguous_with": ()}
    hostile = "<script>alert(\"1\")</script> & $x_1$ 'q'"
    nothing_given: dict[str, Any] = {
        "gap": {
            name: replace(gap, before=gap.reidentified, intervals={}) for name, gap in diagnosis.gap.items()
        },
        "traces": tuple(replace(own, before=own.reidentified) for own in diagnosis.traces),
        "localization": replace(
            diagnosis.localization,
            **{
                name: tuple(
                    replace(part, before=part.reidentified) for part in getattr(diagnosis.localization, name)
                )
                for name in ("by_record", "by_amplitude", "by_band", "by_state", "by_time", "by_path")
            },
        ),
    }
    changes: dict[str, dict[str, Any]] = {
        "effect": {},
        "two effects": {
            **one,
            "effects": ("coulomb_friction", "cubic_stiffness"),
            "ambiguous_with": (),
            "effect_shares": {
                "coulomb_friction": {"psi": 0.8, "y": 0.7},
                "cubic_stiffness": {"psi": 0.2, "y": 0.3},
            },
        },
        "own effect": {
            **one,
            "effects": ("my_gear",),
            "ambiguous_with": (),
            "candidates": (candidate(("my_gear",), 0.9, 1.0),),
        },
        "parameters": {
            **nothing,
            "verdict": "parameters",
            "candidates": (candidate(("cubic_stiffness",), 0.0, 1.01), candidate((), 0.0, 1.02)),
            "gap": {"psi": OutputGap(0.42, 0.0092, 0.0092, 0.009)},
        },
        "none": {**nothing, "verdict": "none", "gap": {"psi": OutputGap(0.0092, 0.0091, 0.0092, 0.009)}},
        "no candidates": {
            **nothing,
            "verdict": "unknown",
            "candidates": (),
            "noise_floors": (),
            "traces": (),
            "notes": (),
            "localization": Localization(),
        },
        "unknown": {
            **nothing,
            "verdict": "unknown",
            "where": ("yaw_dynamics",),
            "missing_force": of_motion(0.98),
        },
        "not finite": {**one, "gap": {"psi": OutputGap(float("nan"), float("inf"), 0.01, 0.009)}},
        "no validation": {
            "scored_on": "estimation",
            "windows": 12.5,
            "traces": (trace("all.csv", "estimation", ("psi", "y")),),
        },
        "element": {
            "rig": "element",
            "where": ("dynamics",),
            "gap": {"force": OutputGap(0.3, 0.25, 0.012, 0.011)},
            "noise_floors": (NoiseFloor("force", "N", 12.0, "repeated periods of the input"),),
            "traces": (trace("bench.csv", "validation", ("force",), amplitude=None),),
        },
        "hostile": {
            "title": hostile,
            "rig": "a<b",
            "effects": ("x<y>",),
            "ambiguous_with": (("$a_1$",),),
            "where": ("p<q",),
            "notes": (hostile,),
            "candidates": (candidate(("x<y>",), 0.9, 1.0, message=hostile, success=False),),
            "traces": (trace(hostile, "validation", ("psi",)),),
            "localization": replace(
                diagnosis.localization,
                by_record=tuple(replace(part, record=hostile) for part in diagnosis.localization.by_record),
                by_time=tuple(replace(part, record=hostile) for part in diagnosis.localization.by_time),
                sentence=hostile,
            ),
        },
        "nothing given": nothing_given,
        "nothing given, no gap": {**nothing, **nothing_given, "verdict": "none"},
        "loops": {
            "rig": "element",
            "where": ("dynamics",),
            "gap": {"force": OutputGap(0.3, 0.25, 0.012, 0.011)},
            "noise_floors": (NoiseFloor("force", "N", 12.0, "repeated periods of the input"),),
            "traces": (
                trace("bench small", "estimation", ("force",), amplitude=0.01),
                trace("bench large", "estimation", ("force",), amplitude=0.02),
                trace("bench large again", "validation", ("force",), 700, amplitude=0.02),
            ),
        },
        "advised": {
            **one,
            "advice": (
                Advice(("coulomb_friction",), "sweep", "u", 1.25, (0.5, 40.0), "psi", 23.4),
                Advice(("stribeck_friction",), "sine", "u", 0.5, (3.0, 3.0), "psi", 0.04),
            ),
            "data_quality": DataQuality(
                (
                    Finding(
                        "clipping",
                        "Channel psi stands still at its ends.",
                        "Widen its range.",
                        True,
                        "all.csv",
                        "psi",
                        0.4,
                    ),
                    Finding(
                        "quantization",
                        "Steps of psi are coarse.",
                        "Use a finer sensor.",
                        False,
                        None,
                        None,
                        None,
                    ),
                ),
                (AmplitudeDependence("yes", "The frequency response u -> psi changes with the amplitude."),),
            ),
        },
        "long": {
            "traces": tuple(
                trace(f"sweep {i}", "validation" if i < 2 else "estimation", ("psi", "y"), 20_000)
                for i in range(5)
            )
        },
    }
    return lambda name: replace(diagnosis, **changes[name])


@pytest.fixture(scope="session")
def page_of(variant: Callable[[str], Diagnosis]) -> Callable[[str], str]:
    """The report of each kind of diagnosis, rendered once."""

    @cache
    def rendered(name: str) -> str:
        return render_report(
            variant(name), "rigsight diagnose data <&>", {"rigsight": "0.1.0", "numpy": "2.4"}, 7
        )

    return rendered

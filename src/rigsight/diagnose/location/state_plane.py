"""In which states does the gap arise? Residuals, and the force missing in the equations, over displacement and velocity.

The force missing in the re-identified equations is ``m e'' + d e' + k e`` of their residual e: the initial transient and the
drive obey the equations and cancel. Effects that the simulation already contains are neglected in this, so that the map then
shows the shape of the missing force but not its exact size. The residual is used up to the frequency at which it exceeds the
noise.

On a rig of several joints the planes are those of each joint, with the force that would act there if everything missing acted at
this joint: what the re-identified equations leave along the measured motion (`rigsight.inverse`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.signal
from numpy.typing import NDArray

from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.location.bands import spectrum
from rigsight.diagnose.location.gap_parts import StatePart
from rigsight.diagnose.location.trace import STAGES, Trace
from rigsight.diagnose.policy import MAPS, VERDICT
from rigsight.errors import SimulationError
from rigsight.inverse import (
    EquationFit,
    ForceAlong,
    RecordMotion,
    forces_along,
    joint_motion,
    noise_of_rows,
    record_motions,
    with_all_inputs,
)
from rigsight.metrics import rms
from rigsight.records.record import Floats, Record
from rigsight.rigs import evaluated
from rigsight.simulate.prescribed_motion import smooth_motion

NOTHING = float("nan")
"""In place of a force that is not known."""


@dataclass(frozen=True, eq=False)
class _Motion:
    """Displacement, velocity and the missing force of one record, shape (n_samples,) each, and the noise of the force."""

    x: Floats
    v: Floats
    force: Floats
    force_noise: float


@dataclass(frozen=True, eq=False)
class Plane:
    """A motion and the missing force there, of all records one after the other."""

    # Displacement, velocity and force, shape (n_samples,).
    x: Floats
    v: Floats
    force: Floats
    force_noise: float  # standard deviation that the sensors' noise gives the force
    forced: tuple[str, ...]  # outputs that the force acts on
    units: Mapping[str, str]  # of each key of a part
    joint: str = ""  # whose motion; empty on a rig with one


def state_parts(
    context: FitContext, reidentified: FittedModel, scored: Sequence[Trace]
) -> tuple[StatePart, ...]:
    """Return the gap of each output over a coarse grid of the measured motion's displacement and velocity."""
    if not scored:
        return ()
    motions = [_motion(context, reidentified.fit.values, trace) for trace in scored]
    # Where no record's residual stands out there is no force to speak of, and of the others the noisiest speaks for all.
    levels = [motion.force_noise for motion in motions if np.isfinite(motion.force_noise)]
    plane = Plane(
        x=np.concatenate([motion.x for motion in motions]),
        v=np.concatenate([motion.v for motion in motions]),
        force=np.concatenate([motion.force for motion in motions]),
        force_noise=max(levels, default=NOTHING),
        forced=(context.rig.outputs[0].name,),
        units=plane_units(context.rig.units),
    )
    return plane_parts(context, plane, scored)


def plane_parts(context: FitContext, plane: Plane, scored: Sequence[Trace]) -> tuple[StatePart, ...]:
    """Return the gap of each output over a coarse grid of a plane."""
    columns, x_edges = _cells(plane.x)
    rows, v_edges = _cells(plane.v)
    cell = columns * MAPS.cells + rows
    parts = []
    for signal in context.rig.outputs:
        holding = np.concatenate([np.full(t.t.size, signal.name in t.measured) for t in scored])
        if not np.any(holding):
            continue
        with_output = [trace for trace in scored if signal.name in trace.measured]
        spread = float(np.std(np.concatenate([t.measured[signal.name] for t in with_output]))) or 1.0
        residuals = {s: np.concatenate([t.residual(s, signal.name) for t in with_output]) for s in STAGES}
        own_cell, own_force = cell[holding], plane.force[holding]
        total = float(np.sum(residuals["reidentified"] ** 2)) or 1.0
        noise = context.noise[signal.name]
        is_forced = signal.name in plane.forced
        for i in np.unique(own_cell):
            inside = own_cell == i
            n_samples = int(np.count_nonzero(inside))
            lacking = own_force[inside] if is_forced else np.array([NOTHING])
            column, row = divmod(int(i), MAPS.cells)
            parts.append(
                StatePart(
                    output=signal.name,
                    **{stage: rms(residual[inside]) / spread for stage, residual in residuals.items()},
                    noise_floor=noise / spread,
                    share=float(np.sum(residuals["reidentified"][inside] ** 2)) / total,
                    noise_share=n_samples * noise**2 / total,
                    x_low=float(x_edges[column]),
                    x_high=float(x_edges[column + 1]),
                    v_low=float(v_edges[row]),
                    v_high=float(v_edges[row + 1]),
                    n_samples=n_samples,
                    force_mean=_finite_mean(lacking),
                    force_rms=float(np.sqrt(_finite_mean(lacking**2))),
                    force_noise=plane.force_noise if is_forced else NOTHING,
                    units=plane.units,
                    joint=plane.joint,
                )
            )
    return tuple(parts)


def _motion(context: FitContext, values: Mapping[str, float], trace: Trace) -> _Motion:
    rig = context.rig
    response = rig.outputs[0].name
    if not rig.is_driven:
        x, v = smooth_motion(next(iter(trace.inputs.values())), trace.dt)
        return _Motion(x, v, trace.residual("reidentified", response), context.noise[response])
    measured = trace.measured[response]
    filtered = _low_pass(measured - np.mean(measured), trace.dt, context.noise[response])
    x = measured if filtered is None else _filtered(filtered, measured)
    residual = trace.residual("reidentified", response)
    own = _low_pass(residual, trace.dt, context.noise[response])
    if own is None:
        force, noise = np.full(residual.size, NOTHING), NOTHING
    else:
        m, d, k = (
            evaluated(e, values) for e in (rig.motion.inertia, rig.motion.damping, rig.motion.stiffness)
        )
        smooth = _filtered(own, residual)
        rate = np.gradient(smooth, trace.dt)
        force = m * np.gradient(rate, trace.dt) + d * rate + k * smooth
        omega, gain = scipy.signal.freqz_sos(own, 512)
        omega = omega / trace.dt
        # Forward and backward filtering squares the gain.
        operator = np.abs(gain) ** 2 * np.abs(k - m * omega**2 + 1j * d * omega)
        noise = context.noise[response] * rms(operator)
    return _Motion(x, np.gradient(x, trace.dt), force, noise)


def _low_pass(samples: Floats, dt: float, noise: float) -> Floats | None:
    """Return a filter that keeps what stands out of the noise, None where nothing does."""
    omega, power = spectrum(samples, dt)
    out = np.flatnonzero(power > MAPS.stands_out * noise**2 / omega.size)
    if out.size == 0:
        return None
    nyquist = np.pi / dt
    cutoff = float(
        np.clip(MAPS.cutoff_margin * omega[out[-1]], 2.0 * omega[1], MAPS.highest_cutoff * nyquist)
    )
    return np.asarray(
        scipy.signal.butter(MAPS.filter_order, cutoff / nyquist, output="sos"), dtype=np.float64
    )


def _filtered(sections: Floats, samples: Floats) -> Floats:
    return np.asarray(scipy.signal.sosfiltfilt(sections, samples), dtype=np.float64)


def _cells(values: Floats) -> tuple[NDArray[np.intp], Floats]:
    """Return the cell of each value and the edges of the cells."""
    low, high = float(np.min(values)), float(np.max(values))
    if high <= low:
        high = low + 1.0
    edges = np.linspace(low, high, MAPS.cells + 1)
    return np.clip(np.searchsorted(edges, values, side="right") - 1, 0, MAPS.cells - 1), edges


def _finite_mean(values: Floats) -> float:
    finite = values[np.isfinite(values)]
    return float(np.mean(finite)) if finite.size else NOTHING


def plane_units(units: Mapping[str, str]) -> dict[str, str]:
    """Return the unit of each key of a part from those of the base quantities where the motion is."""
    x, time, force = units["x"], units["time"], units["force"]
    return {
        **dict.fromkeys(("x_low", "x_high"), x),
        **dict.fromkeys(("v_low", "v_high"), f"{x}/{time}"),
        **dict.fromkeys(("force_mean", "force_rms", "force_noise"), force),
    }


Signals = Mapping[str, Floats]


def joint_parts(
    context: FitContext, reidentified: FittedModel, scored: Sequence[Trace]
) -> tuple[StatePart, ...]:
    """Return the gap of each output over the plane of each joint's motion."""
    # First the joint at which a force agrees best with the sensors. If a large effect is missing, the re-identified parameters
    # are inaccurate and so is this agreement: it only sorts and excludes nothing.
    # None beside effects that are modelled already, as the motion is followed with the rig's own equations, of a rig that nothing
    # but prescribed motions move, and where a sensor's level is not known.
    if not scored or context.modelled or not context.rig.mechanism.free:
        return ()
    if any(record.free_offsets for record in context.scoring):
        return ()
    share = max(1, MAPS.mapped_samples // len(scored))
    stretches = [_stretch(context, trace, share) for trace in scored]
    records = [_record(context, trace) for trace in stretches]
    values = reidentified.fit.values
    try:
        motions = record_motions(
            context.rig, [with_all_inputs(context.rig, record) for record in records], values
        )
        fit = EquationFit(context.rig, motions, (), (), values)
        forces = forces_along(fit, values, noise_of_rows(fit, values, context.noise))
    except (SimulationError, np.linalg.LinAlgError):
        # A diagnosis is still useful without this map.
        return ()
    lacks = reidentified.error_over_noise > VERDICT.at_floor
    return tuple(
        part
        for force in forces
        for part in plane_parts(context, _plane(context, motions, values, force, lacks=lacks), stretches)
    )


def _stretch(context: FitContext, trace: Trace, n_samples: int) -> Trace:
    """Return the stretch of a record, at most so long, in which the gap is largest."""
    if trace.t.size <= n_samples:
        return trace
    remainder = sum(
        (trace.residual("reidentified", name) / context.noise[name]) ** 2 for name in trace.measured
    )
    energy = np.append(0.0, np.cumsum(remainder))
    start = int(np.argmax(energy[n_samples:] - energy[:-n_samples]))
    kept = slice(start, start + n_samples)

    def cut(signals: Signals) -> Signals:
        return {name: samples[kept] for name, samples in signals.items()}

    return replace(
        trace,
        t=trace.t[kept],
        inputs=cut(trace.inputs),
        measured=cut(trace.measured),
        before=cut(trace.before),
        reidentified=cut(trace.reidentified),
        after=cut(trace.after),
    )


def _record(context: FitContext, trace: Trace) -> Record:
    origin = next(r for r in context.scoring if r.origin == trace.record)
    return replace(origin, name=trace.record, window_of="", signals={**trace.inputs, **trace.measured})


def _plane(
    context: FitContext,
    motions: Sequence[RecordMotion],
    values: Mapping[str, float],
    missing: ForceAlong,
    *,
    lacks: bool,
) -> Plane:
    (joint,) = (own for own in context.rig.mechanism.joints if own.name == missing.joint)
    moved = [joint_motion(motion, joint, values) for motion in motions]
    force = -np.concatenate(missing.force)
    return Plane(
        x=np.concatenate([own.x for own in moved]),
        v=np.concatenate([own.v for own in moved]),
        # The resisting force is the missing force with the opposite sign.
        force=force if lacks else np.full(force.size, NOTHING),
        force_noise=missing.std if lacks else NOTHING,
        forced=tuple(signal.name for signal in context.rig.outputs),
        units=plane_units(context.rig.units_at(joint.name)),
        joint=joint.name,
    )

"""Motion of each joint of a rig, and the force that would act there if everything missing acted at this joint.

The motion follows the sensors, with a force of any shape over time at the joint. The parameters of the rig are the re-identified
ones.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rigsight.diagnose.fitting.fit_context import FitContext, FittedModel
from rigsight.diagnose.location.gap_parts import StatePart
from rigsight.diagnose.location.state_plane import NOTHING, Plane, plane_parts, plane_units
from rigsight.diagnose.location.trace import Trace
from rigsight.diagnose.policy import MAPS, VERDICT
from rigsight.discover import JointMotion, joint_motions
from rigsight.errors import SimulationError
from rigsight.metrics import rms
from rigsight.records.record import Record

Signals = Mapping[str, NDArray[np.float64]]


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
    try:
        motions = joint_motions(context.rig, records, reidentified.fit.values, context.noise)
    except (SimulationError, np.linalg.LinAlgError):
        # A diagnosis is still useful without this map.
        return ()
    motions = tuple(motion for motion in motions if np.isfinite(motion.remainder))
    parts: list[StatePart] = []
    for motion in sorted(motions, key=lambda motion: motion.remainder):
        parts += plane_parts(
            context, _plane(context, motion, reidentified.error_over_noise > VERDICT.at_floor), stretches
        )
    return tuple(parts)


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


def _plane(context: FitContext, motion: JointMotion, lacks: bool) -> Plane:
    force = -np.concatenate(motion.force)
    return Plane(
        x=np.concatenate(motion.displacement),
        v=np.concatenate(motion.velocity),
        # The resisting force is the missing force with the opposite sign.
        force=force if lacks else np.full(force.size, NOTHING),
        force_noise=rms(np.concatenate(motion.error)) if lacks else NOTHING,
        forced=tuple(signal.name for signal in context.rig.outputs),
        units=plane_units(context.rig.units_at(motion.joint.name)),
        joint=motion.joint.name,
    )

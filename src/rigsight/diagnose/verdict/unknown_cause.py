"""Which force is missing, and at which joint, if no effect explains the gap?"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigsight.diagnose.fitting.fit_context import FitContext, Scored, liveliest
from rigsight.diagnose.policy import SEARCH, VERDICT
from rigsight.discover import JointForce, MissingForce, missing_force, missing_forces, not_contradicted
from rigsight.errors import InputError, SimulationError
from rigsight.identify import without_offsets
from rigsight.rigs import Rig


def force_of_one_motion(
    context: FitContext, reidentified: Scored, has_stiffness: bool, rng: np.random.Generator
) -> MissingForce | None:
    """Return the shape of the force missing on a rig with one motion; None for any other rig.

    There is none beside effects that are modelled already either: the rig's own terms do not stand alone there. Nor is there
    one from records that are too short for a regression, or whose own constants change inertia, spring or damper.
    """
    if context.modelled or not context.rig.has_one_motion:
        return None
    noise = context.noise[context.rig.outputs[0].name]
    centered = without_offsets(context.estimation, reidentified.fit)
    values = reidentified.fit.values
    try:
        return missing_force(context.rig, centered, values, context.scales, noise, rng, has_stiffness)
    except InputError:
        return None


def forces_at_joints(context: FitContext, reidentified: Scored) -> tuple[JointForce, ...]:
    """Return the force that would have to be missing at each joint, the most likely first; none for a rig with one motion.

    There are none beside effects that are modelled already either.
    """
    if context.modelled or context.rig.has_one_motion:
        return ()
    centered = without_offsets(context.estimation, reidentified.fit)
    try:
        return missing_forces(
            context.rig,
            liveliest(centered, context.rig, SEARCH.traced_samples),
            reidentified.fit.values,
            context.noise,
        )
    except (SimulationError, np.linalg.LinAlgError):
        # A diagnosis is still useful if the missing force cannot be found.
        return ()


def traced_to(rig: Rig, forces: Sequence[JointForce]) -> tuple[str, ...]:
    """Return the places of the only missing force that agrees with all sensors; empty if none or several agree.

    These are a joint, and the drives that act along the same motion.
    """
    agreeing = not_contradicted(forces)
    if len(forces) < 2 or len(agreeing) != 1 or agreeing[0].error_over_noise > VERDICT.comparable:
        return ()
    joint = next(joint for joint in rig.mechanism.joints if joint.name == agreeing[0].joint)
    return (joint.name, *(drive.name for drive in rig.mechanism.drives if drive.along == joint.motion))

"""A compliant gear in a MuJoCo model: a second joint at the place of the first, as the documentation recommends for backlash.

MuJoCo documentation, *Modeling*, section *Backlash*.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from rigsight.robots.drafting.draft import RigDraft

if TYPE_CHECKING:
    import mujoco

_IMPEDANCE = 0.01
"""Of the limit of a joint: with MuJoCo's own, 0.9 to 0.95, what moves would seem ten to twenty times as heavy at the limit."""


def with_gears(spec: mujoco.MjSpec, draft: RigDraft) -> mujoco.MjModel:
    """Return the compiled model with the second joint of each gear, as a spring."""
    joints = {joint.id: joint for joint in spec.joints}
    for place, gear in draft.gears.items():
        add_second_joint(
            spec,
            joints[gear.joint],
            draft.values[f"{place}_stiffness"],
            draft.values[f"{place}_damping"],
            0.0,
        )
    return spec.compile()


def add_second_joint(spec: mujoco.MjSpec, first: Any, stiffness: float, damping: float, play: float) -> str:
    """Add what lies between a rotor and its body to a MuJoCo model, and return the name of the joint.

    Without play it is a spring. With play the spring acts beyond a range, as the limit of the joint, whose stiffness MuJoCo
    counts by the inertia that it moves.
    """
    import mujoco

    name = f"{first.name}_play"
    second = first.parent.add_joint(name=name, type=first.type, axis=list(first.axis), pos=list(first.pos))
    if play <= 0.0:
        second.stiffness[0], second.damping[0] = stiffness, damping
        return name
    in_degrees = bool(spec.compiler.degree) and first.type == mujoco.mjtJoint.mjJNT_HINGE
    half = math.degrees(play) if in_degrees else play
    second.range[:] = (-half, half)
    second.limited = 1
    compiled = spec.compile()
    data = mujoco.MjData(compiled)
    mujoco.mj_forward(compiled, data)
    mass = np.zeros((compiled.nv, compiled.nv))
    mujoco.mj_fullM(compiled, data, mass)
    dof = int(compiled.jnt_dofadr[compiled.joint(name).id])
    moved = 1.0 / float(np.linalg.inv(mass)[dof, dof])
    # An acceleration is (1 - d) times what it is without the limit, less what the limit pulls: a spring for a small impedance d.
    free = 1.0 - _IMPEDANCE
    second.solimp_limit[:2] = (_IMPEDANCE, _IMPEDANCE)
    second.solref_limit[:] = (-stiffness * free / moved, -damping * free / moved)
    return name

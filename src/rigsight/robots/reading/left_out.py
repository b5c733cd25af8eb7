"""Parts of a MuJoCo model that a rig file cannot represent. Each is named, so that nothing is dropped silently."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import mujoco

_LISTED = 3
"""Names that one line lists; the rest is counted."""


def left_out_of(model: mujoco.MjModel, *, as_it_is: bool = False) -> list[str]:
    """Return descriptions of what is not taken over of a model, apart from its actuators and sensors."""
    found = [f"the option that switches off {what}, which the rig has" for what in _switched_off(model)]
    if not as_it_is:
        found += _between_bodies(model)
    if any(model.jnt_springyield):
        found.append("springs that yield")
    if any(model.jnt_actfrclimited):
        names = [
            model.joint(j).name or f"number {j}" for j in range(model.njnt) if model.jnt_actfrclimited[j]
        ]
        found.append(f"range of the actuators' force at joints: {_listed(names)}")
    return found


def _between_bodies(model: mujoco.MjModel) -> list[str]:
    found = []
    touching = _touching(model)
    if touching:
        found.append(f"contacts between bodies: {_listed(touching)}")
    limited = [model.joint(j).name or f"number {j}" for j in range(model.njnt) if model.jnt_limited[j]]
    if limited:
        found.append(
            f"range of joints: {_listed(limited)}; the rig has no end stops there; use the effect end_stop"
        )
    if model.neq:
        found.append(
            f"{model.neq} equality constraint{'' if model.neq == 1 else 's'}: each joint moves by itself"
        )
    if model.ntendon:
        found.append(f"{model.ntendon} tendon{'' if model.ntendon == 1 else 's'}")
    if model.opt.density or model.opt.viscosity:
        found.append("forces of the fluid around the bodies (density, viscosity)")
    if model.nflex or model.nplugin:
        found.append("deformable bodies and plugins")
    return found


def _switched_off(model: mujoco.MjModel) -> list[str]:
    import mujoco

    off = mujoco.mjtDisableBit
    flags = {
        off.mjDSBL_SPRING: "springs of joints",
        off.mjDSBL_DAMPER: "damping of joints",
        off.mjDSBL_FRICTIONLOSS: "dry friction",
        off.mjDSBL_ACTUATION: "actuators",
    }
    return [what for flag, what in flags.items() if model.opt.disableflags & int(flag)]


def _touching(model: mujoco.MjModel) -> list[str]:
    """Return the pairs of bodies whose shapes may touch: not parent and child, not welded together, not excluded."""
    import mujoco

    if model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_CONTACT):
        return []
    excluded = {(int(s) >> 16, int(s) & 0xFFFF) for s in model.exclude_signature}
    bodies: dict[int, list[int]] = {}
    for geom in range(model.ngeom):
        if model.geom_contype[geom] or model.geom_conaffinity[geom]:
            bodies.setdefault(int(model.body_weldid[model.geom_bodyid[geom]]), []).append(geom)
    found = []
    for first, second in combinations(sorted(bodies), 2):
        parents = (
            int(model.body_weldid[model.body_parentid[first]]),
            int(model.body_weldid[model.body_parentid[second]]),
        )
        related = first == parents[1] or second == parents[0]
        # The world collides with its children too, others do not.
        if (related and first != 0) or (first, second) in excluded or (second, first) in excluded:
            continue
        if any(
            model.geom_contype[a] & model.geom_conaffinity[b]
            or model.geom_contype[b] & model.geom_conaffinity[a]
            for a in bodies[first]
            for b in bodies[second]
        ):
            found.append(f"{_body(model, first)} and {_body(model, second)}")
    return found


def _body(model: mujoco.MjModel, index: int) -> str:
    return model.body(index).name or f"body number {index}"


def _listed(names: list[str]) -> str:
    more = len(names) - _LISTED
    return ", ".join(names[:_LISTED]) + (f" and {more} more" if more > 0 else "")

"""Are the constant forces at a joint known, if an effect has a mean force of its own?

Friction that differs between the two directions obeys the same equation as symmetric friction plus a constant force. Such an
effect is therefore fitted with the constant forces of its joint held at the values of the given simulation. It competes only if
symmetric friction would require other values: then it is a single cause instead of a cause and a wrong parameter.
"""

from __future__ import annotations

from collections.abc import Mapping

from rigsight.effects import Effect
from rigsight.rigs import Rig, joint_of


def known_constant_forces(
    rig: Rig, effect: Effect, given: Mapping[str, float], has_stiffness: bool
) -> dict[str, float] | None:
    """Return the values at which the constant forces are held while an effect is fitted."""
    if not effect.holds_constant_force:
        return {}
    joint = joint_of(rig, effect)
    names = rig.constant_forces_at(joint)
    resting = {symbol.name for symbol in joint.rest.free_symbols}
    defaults = {p.name: p.default for p in rig.parameters if p.name not in resting and p.default is not None}
    known = {**defaults, **given}
    needed = [name for name in names if has_stiffness or name not in resting]
    if any(name not in known for name in needed):
        return None
    return {name: known[name] for name in names if name in known}

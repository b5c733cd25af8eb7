"""A motor that turns something: the rig of tests whose energies differ."""

from __future__ import annotations

from rigsight.rigs import Rig
from rigsight.rigs.reading.rig_file import rig_of_text

TEXT = """
name = "motor"
summary = "A motor turns something."
[inputs.u]
unit = "1"
{constants}
[parameters.J]
unit = "kg m^2"
lower = 1e-9
log = true
[parameters.k_v]
unit = "N m"
lower = 0.0
[parameters.d]
unit = "N m s/rad"
lower = 0.0
[coordinates.q]
unit = "rad"
[energy]
kinetic = "{kinetic}"
potential = "{potential}"
[joints.gearbox]
motion = "q"
damping = "d"
[drives.motor]
signal = "u"
force = "k_v*motor"
along = "q"
[sensors.angle]
reads = "q"
unit = "rad"
"""


def motor_rig(kinetic: str, potential: str = "0", constants: str = "") -> Rig:
    """Return the rig with energies of its angle q; constants are tables of a rig file."""
    return rig_of_text(TEXT.format(kinetic=kinetic, potential=potential, constants=constants), "motor.toml")

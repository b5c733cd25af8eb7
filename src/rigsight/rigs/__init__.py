"""Rigs as declarations: signals, parameters, equations, and the places where effects can act."""

from rigsight.rigs.axis import AXIS as AXIS
from rigsight.rigs.element import ELEMENT as ELEMENT
from rigsight.rigs.rig import Motion as Motion
from rigsight.rigs.rig import Rig as Rig
from rigsight.rigs.rig import Signal as Signal
from rigsight.rigs.running_gear import RUNNING_GEAR as RUNNING_GEAR

RIGS: dict[str, Rig] = {rig.name: rig for rig in (RUNNING_GEAR, AXIS, ELEMENT)}

__all__ = ["AXIS", "ELEMENT", "RIGS", "RUNNING_GEAR", "Motion", "Rig", "Signal"]

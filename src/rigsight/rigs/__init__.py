"""Rigs as declarations: signals, parameters, equations, and the places where effects can act."""

from rigsight.rigs.axis import AXIS as AXIS
from rigsight.rigs.element import ELEMENT as ELEMENT
from rigsight.rigs.evaluation import evaluated as evaluated
from rigsight.rigs.evaluation import relative_slopes as relative_slopes
from rigsight.rigs.rig import Lateral as Lateral
from rigsight.rigs.rig import Motion as Motion
from rigsight.rigs.rig import Rig as Rig
from rigsight.rigs.rig import Signal as Signal
from rigsight.rigs.running_gear import ROLLING as ROLLING
from rigsight.rigs.running_gear import RUNNING_GEAR as RUNNING_GEAR

RIGS: dict[str, Rig] = {rig.name: rig for rig in (RUNNING_GEAR, AXIS, ELEMENT)}

__all__ = [
    "AXIS",
    "ELEMENT",
    "RIGS",
    "ROLLING",
    "RUNNING_GEAR",
    "Lateral",
    "Motion",
    "Rig",
    "Signal",
    "evaluated",
    "relative_slopes",
]

"""Rigs as declarations: signals, parameters, equations, and the places where effects can act."""

from rigsight.rigs.built_in import RIGS as RIGS
from rigsight.rigs.built_in import KnownRigs as KnownRigs
from rigsight.rigs.built_in import __getattr__ as __getattr__
from rigsight.rigs.built_in import rig_file_text as rig_file_text
from rigsight.rigs.built_in import rotational as rotational
from rigsight.rigs.controller import Controller as Controller
from rigsight.rigs.evaluation import evaluated as evaluated
from rigsight.rigs.mechanism import has_short_inverse as has_short_inverse
from rigsight.rigs.parts import Coordinate as Coordinate
from rigsight.rigs.parts import Drive as Drive
from rigsight.rigs.parts import Follower as Follower
from rigsight.rigs.parts import Joint as Joint
from rigsight.rigs.parts import Motion as Motion
from rigsight.rigs.parts import Sensor as Sensor
from rigsight.rigs.parts import Signal as Signal
from rigsight.rigs.parts import acceleration as acceleration
from rigsight.rigs.parts import applied_symbol as applied_symbol
from rigsight.rigs.parts import force_symbol as force_symbol
from rigsight.rigs.parts import reading_symbol as reading_symbol
from rigsight.rigs.reading.rig_file import read_rig_file as read_rig_file
from rigsight.rigs.reading.rig_file import rig_of_tables as rig_of_tables
from rigsight.rigs.rig import Rig as Rig
from rigsight.rigs.rig import joint_of as joint_of

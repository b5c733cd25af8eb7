"""Inverse dynamics along the measured motion: which forces the equations lack, before anything is simulated."""

from rigsight.inverse.equation_fit import LAW_ERROR as LAW_ERROR
from rigsight.inverse.equation_fit import EquationFit as EquationFit
from rigsight.inverse.equation_fit import generalized as generalized
from rigsight.inverse.equation_fit import held_numbers as held_numbers
from rigsight.inverse.equation_fit import identifiable as identifiable
from rigsight.inverse.equation_fit import record_motions as record_motions
from rigsight.inverse.equation_fit import size_in as size_in
from rigsight.inverse.equation_fit import undriven_inertias as undriven_inertias
from rigsight.inverse.equation_fit import with_all_inputs as with_all_inputs
from rigsight.inverse.joint_force import JointMotion as JointMotion
from rigsight.inverse.joint_force import effect_force as effect_force
from rigsight.inverse.joint_force import joint_motion as joint_motion
from rigsight.inverse.measured_motion import RecordMotion as RecordMotion
from rigsight.inverse.measured_motion import record_motion as record_motion
from rigsight.inverse.missing_force import MissingForce as MissingForce
from rigsight.inverse.numbers_beside import NumbersBeside as NumbersBeside
from rigsight.inverse.power import NAMED_IN as NAMED_IN
from rigsight.inverse.power import NamedSize as NamedSize
from rigsight.inverse.power import named_sizes as named_sizes
from rigsight.inverse.proposal import Proposal as Proposal
from rigsight.inverse.proposal import ProposedCause as ProposedCause
from rigsight.inverse.proposal import ProposedForm as ProposedForm
from rigsight.inverse.proposal import ProposedStart as ProposedStart
from rigsight.inverse.propose import along_motion as along_motion
from rigsight.inverse.propose import numbers_along_motion as numbers_along_motion
from rigsight.inverse.propose import propose as propose

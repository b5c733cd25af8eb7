"""Governing equations from records by sparse regression; only this package uses pysindy."""

from rigsight.discover.discovery import METHODS as METHODS
from rigsight.discover.discovery import discover as discover
from rigsight.discover.joint_motion import JointMotion as JointMotion
from rigsight.discover.joint_motion import joint_motions as joint_motions
from rigsight.discover.monomials import MONOMIALS as MONOMIALS
from rigsight.discover.monomials import known_terms as known_terms
from rigsight.discover.regression import RegressionData as RegressionData
from rigsight.discover.result import Discovery as Discovery
from rigsight.discover.result import JointForce as JointForce

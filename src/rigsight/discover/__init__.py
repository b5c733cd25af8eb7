"""Governing equations from records by sparse regression; only this package uses pysindy."""

from rigsight.discover.discovery import discover as discover
from rigsight.discover.records import DiscoveryData as DiscoveryData
from rigsight.discover.result import Discovery as Discovery
from rigsight.discover.result import JointForce as JointForce
from rigsight.discover.terms import MONOMIALS as MONOMIALS
from rigsight.discover.terms import known_terms as known_terms

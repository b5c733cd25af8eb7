"""Governing equations from records by sparse regression; pysindy stays in here."""

from rigsight.discover.discovery import METHODS as METHODS
from rigsight.discover.discovery import discover as discover
from rigsight.discover.missing_force import MissingForce as MissingForce
from rigsight.discover.missing_force import missing_force as missing_force
from rigsight.discover.monomials import MONOMIALS as MONOMIALS
from rigsight.discover.monomials import known_terms as known_terms
from rigsight.discover.result import Discovery as Discovery
from rigsight.discover.task import Task as Task

__all__ = [
    "METHODS",
    "MONOMIALS",
    "Discovery",
    "MissingForce",
    "Task",
    "discover",
    "known_terms",
    "missing_force",
]

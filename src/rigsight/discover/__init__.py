"""Governing equations from records by sparse regression; pysindy stays in here."""

from rigsight.discover.discovery import METHODS as METHODS
from rigsight.discover.discovery import Task as Task
from rigsight.discover.discovery import discover as discover
from rigsight.discover.monomials import MONOMIALS as MONOMIALS
from rigsight.discover.monomials import known_terms as known_terms
from rigsight.discover.result import Discovery as Discovery

__all__ = ["METHODS", "MONOMIALS", "Discovery", "Task", "discover", "known_terms"]

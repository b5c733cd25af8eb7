"""A model -> code and text for other tools, all of it printed from the one symbolic declaration."""

from rigsight.export.targets import TARGETS as TARGETS
from rigsight.export.targets import Target as Target
from rigsight.export.targets import export_model as export_model

__all__ = ["TARGETS", "Target", "export_model"]

"""Export of a model as code and text for other tools, printed from the symbolic declaration."""

from rigsight.export.targets import TARGETS as TARGETS
from rigsight.export.targets import Target as Target
from rigsight.export.targets import export_model as export_model

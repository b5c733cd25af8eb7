"""Export of a model as code and text for other tools, printed from the symbolic declaration."""

from rigsight.export.targets import TARGETS as TARGETS

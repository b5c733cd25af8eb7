"""Equations of rigs and effects from textbooks, as plain functions of floats.

Nothing here imports `rigsight.effects`, `rigsight.rigs` or `rigsight.simulate`, so that errors there are not repeated here. A
contract in pyproject.toml enforces this.
"""

"""Equations of rigs and effects from textbooks, as plain functions of floats.

Nothing here imports `rigsight.effects`, `rigsight.rigs` or `rigsight.simulate`: an error there must not be repeated here. A
contract in pyproject.toml holds that.
"""

"""Printing of the equations of a structure in each language: one file per language, and common parts."""

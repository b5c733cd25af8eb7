"""Symbolic equations -> text of a language; one file per language."""

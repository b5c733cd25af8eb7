"""Readers of measurement files of every format, protected against damaged files."""

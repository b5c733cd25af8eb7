"""Identification over several records, and its result files."""

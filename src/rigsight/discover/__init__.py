"""Governing equations from records by sparse regression; only this package uses pysindy."""

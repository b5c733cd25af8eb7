"""Trials with independent plants: equations of motion and effects written by hand instead of composed from declarations."""

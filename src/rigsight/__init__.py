"""Diagnosis of the gap between a test rig and its simulation: where it lies, what causes it, how far it shrinks."""

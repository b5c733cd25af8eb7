"""Equations of a rig with effects: one tree, its derivatives, and the forms in which they are solved."""

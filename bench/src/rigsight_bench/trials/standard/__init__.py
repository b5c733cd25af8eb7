"""Trials on the running gear or an axis, with effects of the catalogue, simulated by an integrator of their own."""

"""Uncertainty of the parameters of a diagnosis: a parametric bootstrap with disturbance forces and sensor noise."""

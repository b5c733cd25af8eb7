"""Noise and disturbance, and the error of a model above them."""

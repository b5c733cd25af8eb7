"""Responses of fitted equations to a push: a small perturbation of a joint's force, a drive or a sensor's reading."""

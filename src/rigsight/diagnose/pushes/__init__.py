"""Responses of the outputs of fitted equations to a small perturbation at a place."""

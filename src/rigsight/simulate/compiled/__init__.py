"""Equations -> machine code: C text, compiler, cache, kernels as functions of arrays."""

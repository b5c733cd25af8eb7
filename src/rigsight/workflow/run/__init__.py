"""Shared by all commands: progress, compiled kernels, and result files that are written completely or not at all."""

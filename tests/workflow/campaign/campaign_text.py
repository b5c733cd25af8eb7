"""The campaign that the tests here change: a running gear, a sweep and a step."""

from __future__ import annotations

HEAD = """
title = "rear axle"
[rig]
model = "running_gear"
[rig.constants]
v = 1.0
r_0 = 0.1
b = 0.3
k_tau = 0.27
[rig.parameters]
J_z = 0.56
"""
RECORDS = """
[[records]]
file = "sweep.csv"
kind = "sweep"
amplitude = 0.25
[[records]]
file = "step.csv"
role = "validation"
kind = "step"
hold = "zoh"
"""
Lines = list[str]

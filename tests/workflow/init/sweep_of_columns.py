"""Columns of a sweep and of what answers it."""

from __future__ import annotations

import numpy as np

T = 0.01 * np.arange(600)
SWEEP = np.sin(2 * np.pi * (1.0 + 2.0 * T) * T)
ANSWER = np.roll(SWEEP, 3) * 0.02

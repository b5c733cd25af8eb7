"""Which logs are fitted and which are held out: whole ones, chosen before any fit."""

from __future__ import annotations

import math

GAINS = (100, 200, 400, 800)
MOTIONS = ("sin_sin", "up_and_down", "lift_and_drop", "sin_time_square")
# Duty per angle and gain of the firmware: steps of the encoder per turn, divisor of the gain, limit of the duty.
DUTY = 4096 / (2 * math.pi) / (256 * 885)
MASS, LENGTH, VOLTS, MOST_CURRENT, DT = 0.49, 0.1, 7.3, 1.75, 0.005
SPLITS = ("motion", "gain")

Log = tuple[int, str]


def divided(split: str) -> tuple[list[Log], list[Log]]:
    """Return the logs to fit and those held out: one motion at every gain, or every motion at one gain as BAM divides."""
    every = [(gain, motion) for gain in GAINS for motion in MOTIONS]
    held = [log for log in every if (log[1] == "sin_time_square" if split == "motion" else log[0] == 400)]
    return [log for log in every if log not in held], held


def file_of(log: Log) -> str:
    gain, motion = log
    return f"kp{gain}_{motion}.csv"

"""What is a recorded signal of a rig?"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Signal:
    """A recorded quantity: its name in equations and files, its unit, and what it is."""

    name: str
    unit: str
    description: str

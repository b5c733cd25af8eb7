"""Kinds of trials, and how strong a hidden effect is."""

from __future__ import annotations

from typing import Literal

Kind = Literal["single", "pair", "triple", "none", "parameters", "outside"]
SEVERAL = "several"
"""Kind of a trial with more effects than a verdict names; the first of its key is the main one, which leaves the largest gap."""
Tier = Literal["faint", "clear", "strong"]
TIERS: dict[Tier, tuple[float, float]] = {"faint": (1.5, 5.0), "clear": (5.0, 20.0), "strong": (20.0, 80.0)}
"""Gap that the re-identified equations leave, in units of the noise floor."""

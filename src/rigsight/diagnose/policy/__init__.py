"""Every number of a diagnosis that is no numerical tolerance, in one frozen object, each with its reason.

The page on verdicts (`docs/verdict_numbers.md`) is generated from it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from rigsight.diagnose.policy.map_numbers import MapNumbers
from rigsight.diagnose.policy.note_numbers import NoteNumbers
from rigsight.diagnose.policy.search_numbers import SearchNumbers
from rigsight.diagnose.policy.trust_numbers import TrustNumbers
from rigsight.diagnose.policy.verdict_numbers import VerdictNumbers

__all__ = ["MAPS", "NOTES", "POLICY", "SEARCH", "TRUST", "VERDICT", "Policy"]


@dataclass(frozen=True)
class Policy:
    """What decides, what is told, how far is searched, how finely the gap is mapped, and what numbers are asked."""

    verdict: VerdictNumbers = field(default_factory=VerdictNumbers)
    notes: NoteNumbers = field(default_factory=NoteNumbers)
    search: SearchNumbers = field(default_factory=SearchNumbers)
    maps: MapNumbers = field(default_factory=MapNumbers)
    trust: TrustNumbers = field(default_factory=TrustNumbers)


POLICY = Policy()
VERDICT, NOTES, SEARCH, MAPS = POLICY.verdict, POLICY.notes, POLICY.search, POLICY.maps
TRUST = POLICY.trust

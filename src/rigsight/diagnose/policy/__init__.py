"""Every threshold and budget of a diagnosis (except numerical tolerances) in one frozen object, each with its reason.

The documentation's page "The numbers of a diagnosis" is made from it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from rigsight.diagnose.policy.report_numbers import BootstrapNumbers, MapNumbers, TrustNumbers
from rigsight.diagnose.policy.search_numbers import HorizonNumbers, SearchNumbers
from rigsight.diagnose.policy.verdict_numbers import FamilyNumbers, NoteNumbers, VerdictNumbers

__all__ = [
    "BOOTSTRAP",
    "FAMILIES",
    "HORIZON",
    "MAPS",
    "NOTES",
    "POLICY",
    "SEARCH",
    "TRUST",
    "VERDICT",
    "Policy",
]


@dataclass(frozen=True)
class Policy:
    """What decides, how families weigh, what is reported, how far is searched and how finely the gap is mapped."""

    verdict: VerdictNumbers = field(default_factory=VerdictNumbers)
    families: FamilyNumbers = field(default_factory=FamilyNumbers)
    notes: NoteNumbers = field(default_factory=NoteNumbers)
    horizon: HorizonNumbers = field(default_factory=HorizonNumbers)
    search: SearchNumbers = field(default_factory=SearchNumbers)
    maps: MapNumbers = field(default_factory=MapNumbers)
    trust: TrustNumbers = field(default_factory=TrustNumbers)
    bootstrap: BootstrapNumbers = field(default_factory=BootstrapNumbers)


POLICY = Policy()
VERDICT, NOTES, SEARCH, MAPS = POLICY.verdict, POLICY.notes, POLICY.search, POLICY.maps
HORIZON, TRUST, BOOTSTRAP = POLICY.horizon, POLICY.trust, POLICY.bootstrap
FAMILIES = POLICY.families

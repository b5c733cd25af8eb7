"""The rig and the named effects of a diagnosis, as declared by its model."""

from __future__ import annotations

from collections.abc import Mapping

from rigsight.diagnose.result import Diagnosis
from rigsight.effects import AT, Effect, kind_of, placed
from rigsight.rigs import Rig, declared_rig


def rig_of(diagnosis: Diagnosis) -> Rig | None:
    """Return the rig; None for a result that only names one that is not built in."""
    return declared_rig(diagnosis.rig, diagnosis.model.get("declaration", {}))


def effect_of(name: str, known: Mapping[str, Effect]) -> Effect | None:
    """Return the effect of this name at its place, None where it is not known."""
    effect = known.get(kind_of(name))
    place = name.partition(AT)[2]
    return placed(effect, place) if effect is not None and place else effect

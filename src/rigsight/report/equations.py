"""Equations of the diagnosed simulation as MathML, grouped by the part to which they belong."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from markupsafe import Markup

from rigsight.diagnose.result import Diagnosis
from rigsight.effects import CATALOGUE, Effect
from rigsight.report.declared import effect_of, rig_of
from rigsight.report.wording import effect_label, sentence_case
from rigsight.rigs import Rig
from rigsight.simulate import compose
from rigsight.simulate.printing.mathml import mathml_equation
from rigsight.simulate.printing.shown import shown_equations


@dataclass(frozen=True)
class EquationGroup:
    """Equations that belong together: whose they are, and each as MathML."""

    title: str
    equations: list[Markup]


def known_effects(own: Iterable[Effect] = ()) -> dict[str, Effect]:
    """Return the effects of the catalogue and a user's own by name."""
    return {effect.name: effect for effect in (*CATALOGUE, *own)}


def equation_groups(diagnosis: Diagnosis, known: Mapping[str, Effect]) -> list[EquationGroup]:
    """Return the equations of the rig, then those of each effect of the diagnosed simulation, in the order of the signal path."""
    rig = rig_of(diagnosis)
    # What the given simulation had already stands in the model beside what was added.
    names = dict.fromkeys([*diagnosis.model.get("effects", ()), *diagnosis.effects])
    effects = [effect_of(name, known) for name in names]
    named = [effect for effect in effects if effect is not None]
    if rig is None or len(named) < len(effects):
        return []
    return equations_of(rig, named)


def equations_of(rig: Rig, effects: Sequence[Effect]) -> list[EquationGroup]:
    """Return the equations of a rig, then those of each effect on it, in the order of the signal path."""
    shown = shown_equations(compose(rig, effects), effect_label)
    return [
        EquationGroup(
            sentence_case(rig.name.replace("_", " ") if owner is None else effect_label(owner)),
            [Markup(mathml_equation(equation, shown.names)) for equation in equations],
        )
        for owner, equations in shown.of_owners.items()
    ]

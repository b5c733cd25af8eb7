"""The given simulation: its rig, effects, constants and parameters, checked for being complete and in range."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence

from rigsight.effects import Effect
from rigsight.errors import InputError, nearest
from rigsight.parameters import Parameter
from rigsight.rigs import Rig
from rigsight.simulate import Structure, compose
from rigsight.workflow.campaign.campaign_file import Location, Where


def rig_named(where: Where, name: str, known: Mapping[str, Rig]) -> Rig:
    """Return the rig that ``rig.model`` names."""
    if name not in known:
        raise InputError(
            f"{where.at('rig', 'model')}: is '{name}'.{nearest(name, known)} Allowed: {', '.join(known)}; for a rig of your own "
            'give its file: file = "my_rig.toml".'
        )
    return known[name]


def checked_simulation(
    where: Where,
    rig: Rig,
    modelled: Sequence[Effect],
    constants: Mapping[str, float],
    parameters: Mapping[str, float],
    of_records: Collection[str] = (),
) -> tuple[dict[str, float], dict[str, float]]:
    """Return constants and parameters of the given simulation, all defaults filled in."""
    _check_tables(where, rig, constants, parameters)
    known = _constants(where, rig, constants, of_records)
    try:
        structure = compose(rig, modelled)
    except InputError as error:
        raise InputError(f"{where.at('rig', 'effects')}: {error}") from None
    return known, _parameters(where, structure, parameters)


def checked_numbers(
    where: Where, key: Location, rig: Rig, allowed: Iterable[Parameter], given: Mapping[str, float]
) -> dict[str, float]:
    """Return given numbers, each one that is allowed and within its range."""
    known = {parameter.name: parameter for parameter in allowed}
    checked = {}
    for name, value in given.items():
        here = where.at(*key, name)
        if name not in known:
            listed = ", ".join(known) or "none"
            raise InputError(f"{here}: unknown to {rig.name}.{nearest(name, known)} Known: {listed}.")
        try:
            checked[name] = known[name].check(value)
        except InputError as error:
            raise InputError(f"{here}: {error}") from None
    return checked


def _check_tables(
    where: Where, rig: Rig, constants: Mapping[str, float], parameters: Mapping[str, float]
) -> None:
    """Refuse a constant among the parameters, and a parameter among the constants, before one of them counts as missing."""
    own_constants = {constant.name for constant in rig.constants}
    own_parameters = {parameter.name for parameter in (*rig.parameters, *rig.alternative_parameters)}
    for table, given, others, kind in (
        ("parameters", parameters, own_constants - own_parameters, "constant"),
        ("constants", constants, own_parameters - own_constants, "parameter"),
    ):
        for name in given:
            if name in others:
                raise InputError(
                    f"{where.at('rig', table, name)}: unknown to {rig.name} under rig.{table}. It is a {kind}: give it under "
                    f"rig.{kind}s."
                )


def _constants(
    where: Where, rig: Rig, given: Mapping[str, float], of_records: Collection[str]
) -> dict[str, float]:
    checked = checked_numbers(where, ("rig", "constants"), rig, rig.constants, given)
    for constant in rig.constants:
        if constant.name in checked or constant.name in of_records:
            continue
        if constant.default is None:
            raise InputError(
                f"{where.at('rig', 'constants', constant.name)}: is missing; {rig.name} needs it "
                f"({constant.description} [{constant.unit}])."
            )
        checked[constant.name] = constant.default
    if rig.has_one_motion:
        gain = rig.motion.drive_gain
        if checked.get(str(gain)) == 0.0:
            raise InputError(
                f"{where.at('rig', 'constants', str(gain))}: is 0, so the input would have no effect. Give a gain other than 0."
            )
    return {constant.name: checked[constant.name] for constant in rig.constants if constant.name in checked}


def _parameters(where: Where, structure: Structure, given: Mapping[str, float]) -> dict[str, float]:
    rig = structure.rig
    constants = {constant.name for constant in rig.constants}
    own = [parameter for parameter in structure.parameters if parameter.name not in constants]
    checked = checked_numbers(where, ("rig", "parameters"), rig, (*own, *rig.alternative_parameters), given)
    for parameter in own:
        if parameter not in rig.parameters and parameter.name not in checked:
            if parameter.default is None:
                raise InputError(
                    f"{where.at('rig', 'parameters', parameter.name)}: is missing; the effects of the given simulation "
                    f"need it ({parameter.description} [{parameter.unit}]). Give its value, or remove the effect."
                )
            checked[parameter.name] = parameter.default
    for effect in structure.effects:
        for pair in effect.ordered:
            larger, smaller = (structure.parameter_name(effect, name) for name in pair)
            if checked[larger] < checked[smaller]:
                raise InputError(
                    f"{where.at('rig', 'parameters', larger)}: must be at least {smaller} = {checked[smaller]:g} in "
                    f"{effect.name}, got {checked[larger]:g}."
                )
    for alternative, determined in ((a.parameter.name, a.gives) for a in rig.alternatives):
        if alternative in checked and determined in checked:
            raise InputError(
                f"{where.at('rig', 'parameters', alternative)}: cannot be given together with {determined}, which follows from "
                "it; give one of the two."
            )
    return checked

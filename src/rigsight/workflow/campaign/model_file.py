"""Read a `model.json` or another JSON file, with messages for errors in files written or edited by hand."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, Field, ValidationError

from rigsight.campaign import Campaign
from rigsight.discover.terms import known_terms
from rigsight.effects import Effect, effect_named, kind_of
from rigsight.errors import InputError, nearest, shown
from rigsight.records import Hold
from rigsight.rigs import Rig
from rigsight.rigs.built_in import declared_rig
from rigsight.rigs.published import published_sets
from rigsight.simulate import Structure, compose, structure_named
from rigsight.simulate.model import SCHEMA_VERSION, Model
from rigsight.workflow.campaign.campaign_file import (
    LARGEST_FILE,
    Number,
    Where,
    checked_numbers,
    first_errors,
    value_message,
)
from rigsight.workflow.own.own_effects import effect_on
from rigsight.workflow.own.own_rigs import known_rigs, text_of

MODEL_FILE = "model.json"
_MEND = f"A model is the {MODEL_FILE} that 'rigsight diagnose' writes."

Part = TypeVar("Part", bound=BaseModel)
_GROUPS = ("constants", "parameters", "effect_parameters")


class ModelTable(BaseModel, extra="forbid", strict=True, frozen=True):
    """The contents of the file."""

    schema_version: Literal[1]
    rig: str
    declaration: dict[str, Any] = {}
    hold: Hold = "foh"
    constants: dict[str, Number] = {}
    parameters: dict[str, Number] = {}
    effects: Annotated[list[str], Field(max_length=50)] = []
    effect_parameters: dict[str, Number] = {}
    units: dict[str, str] = {}


def read_model(model: str | Path, own_effects: Iterable[Effect] = (), own_rigs: Iterable[Rig] = ()) -> Model:
    """Read a model.

    Parameters
    ----------
    model
        A ``model.json`` or the folder that contains one.
    own_effects
        Effects that the model may name beside those of the catalogue and of installed packages.
    own_rigs
        Rigs that a model without a declaration of its own may name beside the built-in ones.

    Raises
    ------
    InputError
        Naming file and key, or line and column, of what cannot be used, and how to correct it.

    Examples
    --------
    >>> import rigsight as rs
    >>> rs.read_model("diagnosis")
    Traceback (most recent call last):
    rigsight.errors.InputError: diagnosis does not exist; name a model.json or the folder that contains one.
    """
    path = _locate(Path(model))
    return _model(path, json_object(path, "model", _MEND), own_effects, own_rigs)


def model_of(content: Mapping[str, Any], own_effects: Iterable[Effect] = ()) -> Model:
    """Return the model in a result."""
    return _model(Path(MODEL_FILE), dict(content), own_effects)


def _model(
    path: Path, content: dict[str, Any], own_effects: Iterable[Effect], own_rigs: Iterable[Rig] = ()
) -> Model:
    try:
        table = ModelTable.model_validate(content)
    except ValidationError as error:
        reported = [_message(path, problem) for problem in map(dict, error.errors(include_url=False))]
        raise first_errors(reported) from None
    structure = _structure(path, table, _rig(path, table, own_rigs), own_effects)
    return Model(structure, _values(path, structure, table), table.hold)


def named_model(model: str | Path, own_effects: Iterable[Effect] = (), own_rigs: Iterable[Rig] = ()) -> Model:
    """Read a model, or take a published set."""
    if Path(model).exists() or str(model).endswith(".json"):
        return read_model(model, own_effects, own_rigs)
    sets = published_sets()
    if str(model) not in sets:
        raise InputError(
            f"'{model}' is neither a {MODEL_FILE}, nor a folder that contains one, nor a published set."
            f"{nearest(str(model), sets)} Published sets: {', '.join(sets)}."
        )
    found = sets[str(model)]
    structure = structure_named(found.rig, [effect_named(name) for name in found.effects])
    return Model(structure, {name: found.values()[name] for name in structure.names}, "foh")


def of_this_rig(name: str, model: Model, campaign: Campaign) -> Model:
    """Return a model that can be compared on the records of a campaign."""
    own, rig = model.structure.rig, campaign.rig
    if own.name == rig.name and own.mechanism != rig.mechanism:
        raise InputError(
            f"Model '{name}' is of a rig '{own.name}' with other equations or units than the rig of {campaign.called}: only "
            "models of the same rig can be compared. Leave it out, or make it again with this rig file."
        )
    if own.name != rig.name:
        raise InputError(
            f"Model '{name}' is of the rig '{model.structure.rig.name}', the records of {campaign.called} are of the rig "
            f"'{campaign.rig.name}': only models of that rig can be compared. Leave it out."
        )
    return model


def _locate(model: Path) -> Path:
    if not model.exists():
        raise InputError(f"{model} does not exist; name a {MODEL_FILE} or the folder that contains one.")
    if not model.is_dir():
        return model
    path = model / MODEL_FILE
    if not path.is_file():
        raise InputError(
            f"Folder {model} contains no {MODEL_FILE}. 'rigsight diagnose' writes one into its --out folder."
        )
    return path


def _message(path: Path, problem: dict[str, Any]) -> str:
    key = ".".join(map(str, problem["loc"]))
    start, kind, got = f"{path.name}: {key}: ", problem["type"], problem["input"]
    if kind == "extra_forbidden":
        known = list(ModelTable.model_fields)
        return f"{start}unknown key.{nearest(key, known)} Allowed: {', '.join(known)}."
    if kind == "missing":
        return f"{start}is missing."
    if key == "schema_version":
        return f"{start}is {shown(got)}, this version reads {SCHEMA_VERSION}. Use the version of rigsight that wrote the model."
    if (reason := value_message(problem)) is not None:
        return f"{start}{reason}"
    message = str(problem["msg"])
    return f"{start}{message[0].lower()}{message[1:]}, got {shown(got)}."


def _rig(path: Path, table: ModelTable, own_rigs: Iterable[Rig]) -> Rig:
    """Return the rig that a model declares or names."""
    if table.declaration:
        rig = declared_rig(table.rig, table.declaration, f"{path.name}: declaration")
        assert rig is not None
        if rig.name != table.rig:
            raise InputError(
                f"{path.name}: rig: is '{table.rig}', but declaration.name '{rig.name}'. Write the same for both."
            )
        return rig
    known = known_rigs(own_rigs)
    if table.rig not in known:
        raise InputError(
            f"{path.name}: rig: is '{table.rig}'.{nearest(table.rig, known)} Allowed: {', '.join(known)}, or a rig of your "
            "own whose tables are given under 'declaration'."
        )
    return known[table.rig]


def _structure(path: Path, table: ModelTable, rig: Rig, own_effects: Iterable[Effect]) -> Structure:
    known = {**known_terms(), **{effect.name: effect for effect in own_effects}}
    for name in table.effects:
        kind = kind_of(name)
        if kind not in known:
            raise InputError(
                f"{path.name}: effects: '{kind}' is unknown.{nearest(kind, known)} If it is an effect of your own, name the file "
                f"that declares it: rigsight simulate MODEL RECORD --effects FILE. Known: {', '.join(known)}."
            )
    effects = [effect_on(rig, name, known, f"{path.name}: effects") for name in table.effects]
    try:
        return compose(rig, effects)
    except InputError as error:
        raise InputError(f"{path.name}: effects: {error}") from None


def _values(path: Path, structure: Structure, table: ModelTable) -> dict[str, float]:
    """Return the value of every parameter; one with a default may be left out of a model written by hand."""
    rig = structure.rig
    known = {p.name: p for p in structure.parameters}
    constants = [p.name for p in rig.constants]
    parameters = [p.name for p in rig.parameters]
    of_effects = [name for name in known if name not in (*constants, *parameters)]
    values = {name: p.default for name, p in known.items() if p.default is not None}
    missing: list[str] = []
    for group, names in zip(_GROUPS, (constants, parameters, of_effects), strict=True):
        own = [known[name] for name in names]
        values |= checked_numbers(
            Where(path.name), (group,), _described(structure), own, getattr(table, group)
        )
        missing += [f"{group}.{name}" for name in names if name not in values]
    if missing:
        raise InputError(
            f"{path.name}: {_described(structure)} needs {', '.join(missing)}; give a value for each."
        )
    _check_units(path, structure, table)
    return {name: values[name] for name in structure.names}


def _described(structure: Structure) -> str:
    effects = " and ".join(structure.effect_names)
    return f"{structure.rig.name} with {effects}" if effects else structure.rig.name


def _check_units(path: Path, structure: Structure, table: ModelTable) -> None:
    """Refuse any unit other than the SI unit of the parameter, because values are not converted."""
    units = {p.name: p.unit for p in structure.parameters}
    for name, unit in table.units.items():
        if name not in units:
            raise InputError(
                f"{path.name}: units.{name}: unknown to {_described(structure)}.{nearest(name, units)}"
            )
        if unit != units[name]:
            raise InputError(
                f"{path.name}: units.{name}: is '{unit}', but values must be in '{units[name]}'. Convert the value."
            )


def part_of_diagnosis(file: Path, table: type[Part], remedy: str, who_needs: str = "") -> Part:
    """Return what a table holds of a `diagnosis.json`."""
    try:
        return table.model_validate(json_object(file, "diagnosis", remedy))
    except ValidationError as error:
        problem = error.errors(include_url=False)[0]
        key, why = ".".join(map(str, problem["loc"])), f"{problem['msg'][0].lower()}{problem['msg'][1:]}"
        raise InputError(f"{file}: {key}: {why}{who_needs}. {remedy}") from None


def json_object(path: Path, what: str, remedy: str) -> dict[str, Any]:
    """Return the object that a file holds."""
    text = text_of(path, f"a {what}", LARGEST_FILE, f", so it is not a {what}", "the file")
    try:
        data = json.loads(text, object_pairs_hook=_without_repeated_keys, parse_constant=_refuse_constant)
    except json.JSONDecodeError as error:
        raise InputError(
            f"{path.name}, line {error.lineno}, column {error.colno}: is not valid JSON: {error.msg}. {remedy}"
        ) from None
    except RecursionError:
        raise InputError(f"{path.name}: is nested too deeply for a {what}. {remedy}") from None
    except ValueError as error:
        raise InputError(f"{path.name}: {error}") from None
    if not isinstance(data, dict):
        raise InputError(
            f"{path.name}: must contain one object in braces, got a {type(data).__name__}. {remedy}"
        )
    return data


def _without_repeated_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content: dict[str, Any] = {}
    for key, value in pairs:
        if key in content:
            raise ValueError(f"the key '{key}' occurs twice in one object; remove one.")
        content[key] = value
    return content


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is not a finite number; give finite numbers.")

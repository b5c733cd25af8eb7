"""Benches of existing campaigns: their keys, and how they are checked so that they are scored like drawn trials.

``--campaigns DIR`` holds a folder with a ``campaign.toml`` for each trial, ``--keys DIR`` a ``NAME.json`` for each of these
folders, and beside it the records that are withheld from the diagnosis::

    {"kind": "single", "effects": ["backlash"],                   # all that a key must hold
     "parameters": {"g": 1.5e-4, "k_c": 145.0},                   # true values [SI]: errors in standard errors
     "noise_floor": {"psi": 2.6e-5},                              # true RMS [SI]; without it, what the diagnosis finds
     "gap": 7.5,                                                  # in noise floors; without it, what the diagnosis finds
     "where": ["yaw_dynamics"], "noise": "low",                   # place of an effect from outside; any label
     "withheld": [{"file": "step.csv", "kind": "step", "hold": "zoh"}]}   # as [[records]] of a campaign; begin at rest
On a rig with several places, `where` holds the joint, drive, sensor or state of each effect, in their order.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from rigsight.effects import CATALOGUE, Effect, Place, effect_named, placed
from rigsight.errors import InputError, nearest
from rigsight.rigs import Rig
from rigsight.simulate import compose
from rigsight.workflow.campaign.campaign_file import (
    MOST_RECORDS,
    FileTable,
    Number,
    RecordTable,
    Where,
    checked_file,
    read_campaign_table,
)
from rigsight.workflow.campaign.model_file import json_object
from rigsight.workflow.campaign.read_campaign import file_inside, listed_rig
from rigsight.workflow.run.results import json_text, write_together
from rigsight_bench.running.files import (
    EXTERNAL,
    RUN_FILE,
    SETTINGS_FILE,
    BenchFolder,
    described,
    read_json,
)
from rigsight_bench.trials.kinds import Kind

_CAMPAIGN = "campaign.toml"
_NOT_STATED = "not stated"
_LEAST = '{"kind": "single", "effects": ["backlash"]}'
_COUNTS: dict[Kind, tuple[int, int, str]] = {
    "single": (1, 1, "exactly one effect of the catalogue"),
    "pair": (2, 2, "exactly two effects of the catalogue"),
    "triple": (3, 3, "exactly three effects of the catalogue"),
    "none": (0, 0, "an empty list"),
    "parameters": (0, 0, "an empty list"),
    "outside": (1, 50, "the name of at least one effect that is not in the catalogue"),
}


class KeyTable(FileTable):
    """The whole key."""

    schema_version: Literal[1] = 1
    kind: Kind
    effects: list[Annotated[str, Field(min_length=1)]]
    where: list[str] | None = None
    noise: Annotated[str, Field(min_length=1)] = _NOT_STATED
    gap: Annotated[float, Field(ge=0.0, allow_inf_nan=False)] | None = None
    parameters: dict[str, Number] = Field(default_factory=dict)
    noise_floor: dict[str, Annotated[float, Field(gt=0.0, allow_inf_nan=False)]] = Field(default_factory=dict)
    withheld: list[RecordTable] = Field(default_factory=list, max_length=MOST_RECORDS)


@dataclass(frozen=True)
class ExternalBench(BenchFolder):
    """A bench whose campaigns and keys lie elsewhere and are only read.

    Attributes
    ----------
    campaigns
        Folder with a folder for each campaign.
    sealed
        Folder with the keys.
    """

    campaigns: Path
    sealed: Path

    def campaign(self, trial: str) -> Path:
        """Return the folder that a diagnosis gets a copy of."""
        return self.campaigns / trial

    @property
    def keys(self) -> Path:
        """The folder that no diagnosis gets."""
        return self.sealed

    def fingerprint(self, trial: str) -> str:
        """Return a hash of the campaign, its key and the withheld records: a change of any of them makes another trial."""
        key = self.key(trial)
        listed = [key.parent / record.file for record in _key_table(key).withheld]
        return _hash([*sorted(p for p in self.campaign(trial).rglob("*") if p.is_file()), key, *listed])

    def diagnosed(self, trial: str) -> bool:
        """Return True if the campaign has been diagnosed as it is now."""
        return (
            super().diagnosed(trial)
            and self.campaign(trial).is_dir()
            and read_json(self.result(trial) / RUN_FILE).get("fingerprint") == self.fingerprint(trial)
        )

    def names(self) -> list[str]:
        """Return the names of all campaigns, after a check of every key, so that errors in keys are reported before any work.

        Raises
        ------
        InputError
            If a folder is missing or contains no campaign, or a key is missing, cannot be used, or lies inside a campaign.
        """
        for folder, option in ((self.campaigns, "--campaigns"), (self.sealed, "--keys")):
            if not folder.is_dir():
                raise InputError(f"{folder} is not a folder. Name a folder with {option}.")
        found = sorted(f.name for f in self.campaigns.iterdir() if (f / _CAMPAIGN).is_file())
        if not found:
            raise InputError(
                f"No folder in {self.campaigns} contains a {_CAMPAIGN}. Put each campaign into its own subfolder there."
            )
        without = [name for name in found if not self.key(name).is_file()]
        if without:
            listed = ", ".join(f"{name}.json" for name in without[:10])
            raise InputError(
                f"Keys of {len(without)} of {len(found)} campaigns are missing in {self.sealed}: {listed}. "
                f"The smallest key is {_LEAST}."
            )
        for name in found:
            if self.sealed.resolve().is_relative_to(self.campaign(name).resolve()):
                raise InputError(
                    f"The keys in {self.sealed} lie inside the campaign '{name}', so its diagnosis could read them. "
                    "Move them out of it."
                )
            self.read_key(name)
        return found

    def read_key(self, trial: str) -> dict[str, Any]:
        """Return the checked key in the form of a drawn one.

        Raises
        ------
        InputError
            Naming the file, the place in it, what was got and what is allowed.
        """
        path = self.key(trial)
        table = _key_table(path)
        rig = self._rig(trial)
        _check_effects(path, table, rig)
        for number, record in enumerate(table.withheld, 1):
            file_inside(path, number, record)
        return {
            "design": EXTERNAL,
            "seed": 0,
            "trial": trial,
            "kind": table.kind,
            "effects": table.effects,
            "schema_version": 1 if rig.has_one_motion else 2,
            "where": _places(table, rig) if table.where is None else table.where,
            "rig": rig.name,
            "declaration": dict(rig.declaration),
            "noise": table.noise,
            "gap": table.gap,
            "values": table.parameters,
            "noise_floor": table.noise_floor,
            "withheld": [record.model_dump() for record in table.withheld],
        }

    def _rig(self, trial: str) -> Rig:
        path = self.campaign(trial) / _CAMPAIGN
        table, where = read_campaign_table(path)
        return listed_rig(path, table.rig, where)

    def settle_here(self) -> None:
        """Record in the folder which campaigns these are, or check that it does not contain a drawn bench.

        Raises
        ------
        InputError
            If the folder holds another bench.
        """
        wanted = {
            "schema_version": 1,
            "design": EXTERNAL,
            "seed": 0,
            "campaigns": str(self.campaigns),
            "keys": str(self.sealed),
        }
        if self.settings.exists() and (found := read_json(self.settings)).get("design") != EXTERNAL:
            raise InputError(
                f"{self.path} already contains a blind bench with {described(found)}. Name another folder with --out."
            )
        write_together(self.settings.parent, {SETTINGS_FILE: json_text(wanted)})


def _key_table(path: Path) -> KeyTable:
    data = json_object(path, "key", f"The smallest key is {_LEAST}.")
    return checked_file(Where(path.name, data), data, KeyTable)


def _check_effects(path: Path, table: KeyTable, rig: Rig) -> None:
    """Refuse a key that contradicts itself: it would be scored, and wrongly."""
    known = {effect.name: effect for effect in CATALOGUE}
    least, most, words = _COUNTS[table.kind]
    got = ", ".join(table.effects) or "an empty list"
    foreign = [name for name in table.effects if name not in known]
    # One effect at two places is two effects.
    named = list(zip(table.effects, table.where or (), strict=False)) or table.effects
    distinct = len(set(table.effects if rig.has_one_motion else named))
    wrong_count = not least <= len(table.effects) <= most or distinct < len(table.effects)
    if wrong_count or (table.kind == "outside" and not foreign):
        raise InputError(f'{path.name}: effects: got {got}; kind "{table.kind}" requires {words}.')
    if table.kind != "outside" and foreign:
        raise InputError(
            f"{path.name}: effects: '{foreign[0]}' is not in the catalogue.{nearest(foreign[0], known)} "
            f'Write kind = "outside" for an effect that is not, or one of: {", ".join(known)}.'
        )
    of_catalogue = [known[name] for name in table.effects if name in known]
    if rig.has_one_motion:
        of_rig = tuple(rig.place_name(effect.place) for effect in CATALOGUE if rig.offers(effect))
        allowed = [of_rig] * len(table.where or ())
    else:
        allowed = _allowed_places(path, table, rig, known)
        if not foreign:
            of_catalogue = [placed(e, at) for e, at in zip(of_catalogue, table.where or (), strict=True)]
    for place, places in zip(table.where or (), allowed, strict=True):
        if place not in places:
            listed = ", ".join(dict.fromkeys(places))
            raise InputError(f"{path.name}: where: is '{place}'.{nearest(place, places)} Allowed: {listed}.")
    for effect in of_catalogue:
        if not rig.offers(effect):
            raise InputError(f"{path.name}: effects: {effect.name} does not apply to the rig {rig.name}.")
    _check_names(path, "parameters", table.parameters, compose(rig, of_catalogue).names, bool(foreign))
    outputs = [signal.name for signal in rig.outputs]
    _check_names(path, "noise_floor", table.noise_floor, outputs, False)


def _allowed_places(
    path: Path, table: KeyTable, rig: Rig, known: Mapping[str, Effect]
) -> list[tuple[str, ...]]:
    """Return the places that each entry of `where` may name, on a rig with several of them."""
    anywhere = tuple(dict.fromkeys(name for kind in Place for name in rig.places(kind)))
    if table.kind == "outside":
        return [anywhere] * len(table.where or ())
    if len(table.where or ()) != len(table.effects):
        raise InputError(
            f"{path.name}: where: got {', '.join(table.where or ()) or 'nothing'}; {rig.name} has several places, so the key "
            f"must give the place of each effect, in the same order: {len(table.effects)} of {', '.join(anywhere)}."
        )
    return [rig.places(known[name].place) for name in table.effects]


def _check_names(
    path: Path, key: str, given: Mapping[str, float], known: Iterable[str], others_too: bool
) -> None:
    names = list(known)
    for name in given:
        if name not in names and not others_too:
            raise InputError(
                f"{path.name}: {key}.{name}: unknown name.{nearest(name, names)} Known: {', '.join(names)}."
            )


def _places(table: KeyTable, rig: Rig) -> list[str] | None:
    """Return the places of the effects; None for an effect outside the catalogue, whose place only the key can give."""
    if table.kind == "outside":
        return None
    return sorted({rig.place_name(effect_named(name).place) for name in table.effects})


def _hash(files: Iterable[Path]) -> str:
    found = hashlib.sha256()
    for file in files:
        found.update(file.name.encode())
        try:
            found.update(file.read_bytes())
        except OSError as error:
            raise InputError(f"{file} cannot be read: {error.strerror}.") from None
    return found.hexdigest()[:16]

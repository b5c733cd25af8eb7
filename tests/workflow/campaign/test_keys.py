"""Every key of a campaign and of a model is used by a command or refused by it, as docs/keys.md says: none is ignored."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from rigsight.campaign import Campaign
from rigsight.compare.comparison import comparison_json
from rigsight.effects import effect_named
from rigsight.errors import RigsightError
from rigsight.workflow.campaign.campaign_file import CampaignTable, ColumnTable, RecordTable, RigTable
from rigsight.workflow.campaign.in_memory import make_model
from rigsight.workflow.campaign.model_file import ModelTable
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.compare import run_compare
from rigsight.workflow.export import run_export
from rigsight.workflow.simulate import run_simulate
from rigsight.workflow.vary import run_vary

from ...tiers import slow_but
from .keys_of_campaigns import CHANGES, COMMANDS, TOLD, TRUTH, written

PAGE = (Path(__file__).parents[3] / "docs/keys.md").read_text(encoding="utf-8")
OF_THE_READER = {"dt", "t0", "signals", "units", "source"}
"""Fields of a record that every command takes from it alike: what differs in nothing else was used when the record was read."""
Found = Campaign | str


def rows(heading: str) -> dict[str, dict[str, str]]:
    """Return the first table below a heading of the page: key -> command -> cell."""
    lines = PAGE.split(f"## {heading}\n")[1].split("\n## ")[0].split("\n")
    table = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("|")]
    names = table[0]
    return {row[0].strip("`"): dict(zip(names[1:], row[1:], strict=True)) for row in table[2:]}


OF_CAMPAIGNS, OF_MODELS = rows("Keys of a campaign"), rows("Keys of model.json")


def test_every_key_of_a_campaign_is_in_the_table() -> None:
    tables = {"": CampaignTable, "rig.": RigTable, "records.": RecordTable, "columns.": ColumnTable}
    keys = [prefix + name for prefix, table in tables.items() for name in table.model_fields]
    keys = [key for key in keys if key not in ("rig", "records")]
    remedy = "add a row to 'Keys of a campaign' in docs/keys.md and a line to CHANGES in keys_of_campaigns.py"
    assert set(OF_CAMPAIGNS) == set(keys), remedy
    assert set(CHANGES) == set(keys), remedy


@pytest.fixture(scope="module", autouse=True)
def _quick() -> Any:
    """Few draws, one offered term: whether a key is used does not depend on them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("rigsight.discover.stability._N_ENSEMBLE", 2)
        patch.setattr(
            "rigsight.discover.discovery.offered_terms", lambda *_: [effect_named("cubic_stiffness")]
        )
        yield


@pytest.fixture(scope="module")
def outcome(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, str, bool], str]:
    """Return what a command says of a campaign, without or with a key: its result as text, or its refusal."""

    @cache
    def campaign(key: str, given: bool) -> Found:
        own, change = CHANGES[key]
        folder = tmp_path_factory.mktemp("campaign") / "c"
        try:
            return read_campaign(written(folder, own, *([change] if given else [])))
        except RigsightError as refused:
            return f"REFUSED {refused}"

    @cache
    def base(command: str) -> str:
        read = read_campaign(written(tmp_path_factory.mktemp("base") / "c"))
        return result(command, read)

    def result(command: str, read: Campaign) -> str:
        try:
            return json.dumps(COMMANDS[command](read), default=str)
        except RigsightError as refused:
            return f"REFUSED {refused}"

    @cache
    def reported(command: str) -> str:
        changes = [CHANGES[key][1] for key in TOLD]
        return result(command, read_campaign(written(tmp_path_factory.mktemp("reported") / "c", *changes)))

    def call(command: str, key: str, given: bool) -> str:
        if key in TOLD:
            return f"tells it: {TOLD[key] in (reported if given else base)(command)}"
        without, found = campaign(key, False), campaign(key, True)
        read = found if given else without
        if isinstance(read, str):
            return read
        if isinstance(without, str) or (
            differing(without, found) and differing(without, found) <= OF_THE_READER
        ):
            return repr(
                [(r.dt, r.n_samples, {n: v.tobytes() for n, v in r.signals.items()}) for r in read.records]
            )
        return result(command, read) if given else base(command)

    return call


def differing(one: Campaign, other: Found) -> set[str]:
    """Return the fields of campaign and records that differ."""
    if isinstance(other, str):
        return {"refused"}
    found = {f.name for f in fields(Campaign) if f.name not in ("records", "path", "notes")}
    found = {name for name in found if getattr(one, name) != getattr(other, name)}
    for mine, theirs in zip(one.records, other.records, strict=True):
        for name in (f.name for f in fields(mine) if f.name != "notes"):
            same = repr(getattr(mine, name)) == repr(getattr(theirs, name))
            if name == "signals":
                same = all(mine[s].tobytes() == theirs[s].tobytes() for s in mine.signals)
            if not same:
                found.add(name)
    return found - {"source"} if "file" not in found else found


@pytest.mark.parametrize("command", slow_but("identify", of=COMMANDS))
@pytest.mark.parametrize("key", CHANGES)
def test_a_key_of_a_campaign_is_used_or_refused(
    key: str, command: str, outcome: Callable[[str, str, bool], str]
) -> None:
    cell = OF_CAMPAIGNS[key][command]
    without, given = outcome(command, key, False), outcome(command, key, True)
    assert cell in ("used", "refused")
    assert given.startswith("REFUSED") == (cell == "refused"), given[:300]
    assert given != without


MODEL = make_model("axis", {**TRUTH, "k_3": 1e5}, ["cubic_stiffness"]).to_json()
OTHER_RIG = {**make_model("axis", TRUTH).structure.rig.declaration, "name": "stage"}
OTHER_RIG["energy"] = {"kinetic": "m*d(x)^2"}
MODEL_CHANGES: dict[str, Mapping[str, Any]] = {
    "schema_version": {"schema_version": 2},
    "rig": {"rig": "running_gear"},
    "declaration": {"rig": "stage", "declaration": OTHER_RIG},
    "hold": {"hold": "zoh"},
    "constants": {"constants": {"gain": 2.0}},
    "parameters": {"parameters": {**MODEL["parameters"], "d": 13.0}},
    "effects": {
        "effects": ["cubic_stiffness", "input_delay"],
        "effect_parameters": {"k_3": 1e5, "T_d": 0.02},
    },
    "effect_parameters": {"effect_parameters": {"k_3": 2e5}},
    "units": {"units": {**MODEL["units"], "k": "N/mm"}},
}


def test_every_key_of_a_model_is_in_the_table() -> None:
    remedy = "add a row to 'Keys of model.json' in docs/keys.md and a line to MODEL_CHANGES here"
    assert set(OF_MODELS) == set(MODEL_CHANGES) == set(ModelTable.model_fields), remedy


@pytest.fixture(scope="module")
def of_model(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, str], str]:
    """Return what a command makes of the model with a changed key: its result as text, or its refusal."""
    folder = tmp_path_factory.mktemp("models")
    campaign = written(folder / "c")
    record = campaign.parent / "fit.csv"

    @cache
    def call(command: str, key: str) -> str:
        file, out = folder / "model.json", folder / "out.py"
        file.write_text(json.dumps({**MODEL, **MODEL_CHANGES.get(key, {})}))
        try:
            if command == "simulate":
                return repr(run_simulate(file, record)["x"].tobytes())
            if command == "export":
                run_export(file, "python", out)
                return out.read_text()
            if command == "compare":
                return json.dumps(comparison_json(run_compare(campaign, [file], n_jobs=1), {}))
            (varied,) = run_vary(file, ["k"], steps=2, amplitude=4.0)
            return repr([v.response and v.response.values.tobytes() for v in varied.variants])
        except RigsightError as refused:
            return f"REFUSED {refused}"

    return call


@pytest.mark.parametrize("command", ["simulate", "export", "vary", "compare"])
@pytest.mark.parametrize("key", MODEL_CHANGES)
def test_a_key_of_a_model_is_used_or_refused(
    key: str, command: str, of_model: Callable[[str, str], str]
) -> None:
    cell = OF_MODELS[key][command]
    given = of_model(command, key)
    assert cell in ("used", "refused")
    assert given.startswith("REFUSED") == (cell == "refused"), given[:300]
    assert given != of_model(command, "as it is")

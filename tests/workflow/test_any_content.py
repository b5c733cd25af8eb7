"""Whatever a campaign, a model, a key or a declared effect holds: it is taken, or one message tells why not."""

from __future__ import annotations

import contextlib
import copy
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rigsight.effects import CATALOGUE, Effect
from rigsight.errors import InputError
from rigsight.workflow.campaign.campaign_file import (
    CampaignTable,
    FileTable,
    RecordTable,
    Where,
    checked_file,
    read_campaign_table,
)
from rigsight.workflow.campaign.model_file import json_object, model_of, named_model, read_model
from rigsight.workflow.campaign.read_campaign import file_inside
from rigsight.workflow.own.effect_declaration import declaration_faults
from rigsight.workflow.own.own_effects import own_effects
from rigsight_bench.running.external import KeyTable
from rigsight_bench.running.files import read_json

drawn = settings(
    derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40
)
scalars = st.sampled_from([
    None, True, 0, -1, 2**63, 10**400, 0.0, 1e308, float("nan"), float("inf"), "", "x", "..",
    "\x00", "\ud800", "a" * 300, "axis", "zoh", "backlash", '"', "\x1b[2J", "a huge number",
]).map(lambda value: 16**9000 if value == "a huge number" else value)  # fmt: skip
values = st.recursive(
    scalars,
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.sampled_from(["name", "u", "", "\ud800"]), inner, max_size=3)
    ),
    max_leaves=6,
)
CAMPAIGN: dict[str, Any] = {
    "title": "bench",
    "rig": {"model": "axis", "effects": ["backlash"], "constants": {"gain": 1.0}, "parameters": {"m": 1.0}},
    "records": [
        {
            "file": "a.csv", "name": "a", "role": "validation", "kind": "step", "amplitude": 1.0, "hold": "zoh", "dt": 0.1,
            "resample": 0.1, "start": 0.0, "end": 9.0, "separator": ",", "decimal": ".", "header": True, "comment": "#",
            "columns": {"t": 1, "u": {"name": "u", "scale": 1.0, "offset": 0.0, "unit": "A", "time": 1, "file": "b.csv"}},
        }
    ],
}  # fmt: skip
KEY: dict[str, Any] = {
    "kind": "single", "effects": ["backlash"], "parameters": {"g": 0.1}, "noise_floor": {"psi": 0.1}, "gap": 1.0,
    "where": ["yaw_dynamics"], "noise": "low", "withheld": [{"file": "a.csv", "kind": "step"}],
}  # fmt: skip


def places(tree: Any, start: tuple[str | int, ...] = ()) -> list[tuple[str | int, ...]]:
    found = [start]
    for key, value in (
        tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    ):
        found += places(value, (*start, key))
    return found


def changed(tree: Any, place: tuple[str | int, ...], value: Any, name: str | None) -> Any:
    """Return a copy with another value at a place, or under another name there."""
    tree = copy.deepcopy(tree)
    if not place:
        return value
    holder = tree
    for key in place[:-1]:
        holder = holder[key]
    if name is not None and isinstance(holder, dict):
        holder[name] = holder.pop(place[-1])
    else:
        holder[place[-1]] = value
    return tree


names = st.none() | st.sampled_from(["", "x", "kindd", "\ud800", "m"])


def refused_in_words(take: Callable[[], object]) -> None:
    try:
        take()
    except InputError as error:
        str(error).encode()


@pytest.mark.parametrize(("tree", "table"), [(CAMPAIGN, CampaignTable), (KEY, KeyTable)])
def test_the_tree_that_is_changed_is_sound(tree: dict[str, Any], table: type[FileTable]) -> None:
    assert isinstance(checked_file(Where("file"), tree, table), table)


@drawn
@given(data=st.data(), value=values, name=names)
@pytest.mark.parametrize(("tree", "table"), [(CAMPAIGN, CampaignTable), (KEY, KeyTable)])
def test_any_change_of_a_table(
    tree: dict[str, Any], table: type[FileTable], data: st.DataObject, value: Any, name: str | None
) -> None:
    given_tree = changed(tree, data.draw(st.sampled_from(places(tree))), value, name)
    if isinstance(given_tree, dict):
        refused_in_words(lambda: checked_file(Where("file"), given_tree, table))


@drawn
@given(data=st.data(), value=values, name=names)
def test_any_change_of_a_model(data: st.DataObject, value: Any, name: str | None) -> None:
    sound = named_model("iwan_tables").to_json()
    tree = changed(sound, data.draw(st.sampled_from(places(sound))), value, name)
    if isinstance(tree, dict):
        refused_in_words(lambda: model_of(tree))


@drawn
@given(data=st.binary(max_size=200))
def test_any_bytes(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "file"
    path.write_bytes(data)
    for take in (read_campaign_table, read_model, lambda file: json_object(file, "key", "")):
        with contextlib.suppress(InputError):
            take(path)


NESTED = {
    "array": "[" * 100_000,
    "table": '{"a":' * 100_000,
    "inline": "a = " + "{a = " * 100_000,
    "brackets": "a = " + "[" * 100_000,
    "number": "a = 1" + "0" * 6000,
    "json number": '{"schema_version": 1' + "0" * 6000 + "}",
    "hex": "title = 0x1" + "0" * 6000 + "\n[rig]\nmodel = 'axis'\n[[records]]\nfile = 'a'",
}


@pytest.mark.parametrize("text", NESTED.values(), ids=NESTED)
def test_what_is_deeper_or_longer_than_can_be_read_is_told(tmp_path: Path, text: str) -> None:
    path = tmp_path / "file.toml"
    path.write_text(text, encoding="utf-8")
    for take in (read_campaign_table, read_model, read_json):
        with pytest.raises(InputError, match=r"file\.toml") as reported:
            take(path)
        assert len(str(reported.value)) < 5000


@pytest.mark.parametrize("file", ["a" * 300 + ".csv", "a/" * 3000, "\ud800.csv", "\x00", "loop/a.csv"])
def test_a_record_that_no_file_can_be_called_is_told(tmp_path: Path, file: str) -> None:
    (tmp_path / "loop").symlink_to("loop")
    with pytest.raises(InputError, match=r"campaign\.toml: record 2: file: "):
        file_inside(tmp_path / "campaign.toml", 2, RecordTable.model_construct(file=file))


def test_a_campaign_or_model_that_is_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    import os

    os.mkfifo(tmp_path / "pipe")
    for take in (read_campaign_table, read_model, lambda path: own_effects([path])):
        with pytest.raises(InputError, match="is a device or a pipe"):
            take(tmp_path / "pipe")


def is_told(effect: Effect) -> tuple[str, ...]:
    faults = declaration_faults(effect)
    assert all(isinstance(fault, str) for fault in faults)
    return faults


@drawn
@given(field=st.sampled_from([field.name for field in fields(Effect)]), value=values)
def test_any_value_in_a_field_of_an_effect(field: str, value: Any) -> None:
    is_told(replace(CATALOGUE[0], **{field: value}))


@drawn
@given(data=st.data(), value=values)
def test_any_value_in_a_member_of_an_effect(data: st.DataObject, value: Any) -> None:
    lists = [
        (e, name)
        for e in CATALOGUE
        for name in ("parameters", "states", "starts", "searched_as")
        if getattr(e, name)
    ]
    effect, name = data.draw(st.sampled_from(lists))
    first, *others = getattr(effect, name)
    field = data.draw(st.sampled_from([field.name for field in fields(first)]))
    is_told(replace(effect, **{name: (replace(first, **{field: value}), *others)}))


def test_a_member_that_is_none_and_a_symbol_that_is_no_word_are_told() -> None:
    effect = CATALOGUE[0]
    assert "starts contains {'k': 1}; give a tuple of Start objects" in " ".join(
        is_told(replace(effect, starts=({"k": 1},)))
    )
    odd = tuple(replace(p, name=f"{p.name}; import os") for p in effect.parameters)
    assert "must consist of letters" in " ".join(is_told(replace(effect, parameters=odd)))


@pytest.mark.parametrize("text", ["(" * 100_000, "-" * 100_000 + "1", "a" + ".a" * 100_000, "x = 1\x00"])
def test_python_that_is_nested_too_deep_is_told(tmp_path: Path, text: str) -> None:
    (tmp_path / "mine.py").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"mine\.py"):
        own_effects([tmp_path / "mine.py"])

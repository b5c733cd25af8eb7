"""Names of files and rigs are data on the pages, whatever characters they hold."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

pytest.importorskip("nicegui", reason="the extra app is not installed")

from nicegui import Client
from nicegui.page import page

import rigsight.app
from rigsight.app.campaign_pages import picture_arguments
from rigsight.app.file_pages import files_page
from rigsight.app.page_parts import downloads
from rigsight.app.steps import Site

EVIL = 'run" innerHTML="<img src=x onerror=window.PWN=2>" z=".csv'


def test_a_name_becomes_no_attribute(tmp_path: Path) -> None:
    (tmp_path / EVIL).write_text("t,u\n0,1\n")
    client = Client(page(""), request=None)
    with client:
        files_page(Site(tmp_path, []))
        downloads([EVIL])
    found = [dict(element.props) for element in client.elements.values()]
    assert not any("z" in attributes for attributes in found)
    labels = {attributes.get("aria-label") for attributes in found}
    assert labels >= {f"Channels of {EVIL}", f"Remove {EVIL}", f"Download {EVIL}"}


def test_a_rig_whose_name_is_an_option_is_not_drawn(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text('name = "--debug"')
    assert picture_arguments(tmp_path, file="rig.toml") is None
    assert picture_arguments(tmp_path, model="--debug") is None
    assert picture_arguments(tmp_path, model="axis") is not None


@pytest.mark.parametrize(
    "file", sorted(Path(rigsight.app.__file__).parent.glob("*.py")), ids=lambda f: f.name
)
def test_only_fixed_text_is_parsed_as_attributes(file: Path) -> None:
    calls = [node for node in ast.walk(ast.parse(file.read_text("utf-8"))) if isinstance(node, ast.Call)]
    parsed = [c for c in calls if isinstance(c.func, ast.Attribute) and c.func.attr in ("props", "style")]
    nodes = (node for call in parsed for argument in call.args for node in ast.walk(argument))
    assert [node.lineno for node in nodes if isinstance(node, ast.JoinedStr)] == []

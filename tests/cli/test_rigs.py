"""``rigsight rigs`` lists what comes with rigsight, prints files to copy and change, and checks a user's own."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rigsight.rigs import RIGS, rig_file_text
from rigsight.rigs.rig_file import rig_of_text
from rigsight.workflow.in_memory import make_model
from rigsight.workflow.not_yet import ONE_MOTION_ONLY
from rigsight.workflow.results import json_text

from ..workflow.any_rig import TRAIN, write_train_campaign


def test_rigs_are_listed(run) -> None:
    code, stdout, _ = run("rigs")
    assert code == 0
    assert [line.split()[0] for line in stdout.splitlines()] == list(RIGS)
    assert [rig["name"] for rig in json.loads(run("rigs", "--json")[1])["rigs"]] == list(RIGS)
    assert {"drive_train", "servo", "cart_pendulum", "two_link_arm", "quarter_car"} < set(RIGS)


def test_the_file_of_a_rig_is_printed_as_it_can_be_read(run) -> None:
    code, stdout, _ = run("rigs", "axis")
    assert code == 0
    assert rig_of_text(stdout).name == "axis"
    assert json.loads(run("rigs", "axis", "--json")[1])["file"] == stdout


def test_a_rig_that_there_is_not_is_one_message(run) -> None:
    code, stdout, stderr = run("rigs", "axes")
    assert (code, stdout) == (2, "")
    assert "Did you mean 'axis'?" in stderr


def test_a_rig_of_ones_own_is_checked_and_listed(run, tmp_path: Path) -> None:
    file = tmp_path / "hoist.toml"
    file.write_text(
        rig_file_text("cart_pendulum").replace('name = "cart_pendulum"', 'name = "hoist"'), "utf-8"
    )
    code, stdout, _ = run("rigs", "--rigs", file)
    assert code == 0
    assert "Your own, checked: hoist" in stdout
    assert run("rigs", "hoist", "--rigs", file)[1] == file.read_text("utf-8")
    listed = json.loads(run("rigs", "--rigs", file, "--json")[1])["rigs"]
    assert {
        "name": "hoist",
        "summary": listed[1]["summary"],
        "inputs": ["u"],
        "outputs": ["cart", "angle"],
    } in listed


@pytest.mark.parametrize("command", sorted(ONE_MOTION_ONLY))
def test_a_command_that_cannot_take_every_rig_yet_says_so(
    command: str, run, tmp_path: Path, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_train_campaign(tmp_path)
    model = tmp_path / "model.json"
    model.write_text(json_text(make_model("drive_train", TRAIN).to_json()), encoding="utf-8")
    before = set(tmp_path.iterdir())
    asked = {
        "compare": [tmp_path, model],
        "export": [model, "--to", "c"],
        "vary": [model, "--parameter", "k_s"],
    }.get(command, [tmp_path])
    code, stdout, stderr = run(command, *asked)
    assert (code, stdout) == (2, "")
    assert f"'rigsight {command}' cannot take the rig" in stderr
    assert stderr.count("\n") == 1
    assert set(tmp_path.iterdir()) == before


@pytest.mark.parametrize(("ending", "start"), [("png", b"\x89PNG"), ("svg", b"<?xml")])
def test_a_rig_is_drawn(run, tmp_path, ending: str, start: bytes) -> None:
    file = tmp_path / f"servo.{ending}"
    assert run("rigs", "servo", "--picture", str(file))[0] == 0
    assert file.read_bytes().startswith(start)


def test_a_rig_of_ones_own_is_drawn(run, tmp_path: Path) -> None:
    own, picture = tmp_path / "mine.toml", tmp_path / "mine.svg"
    own.write_text(rig_file_text("drive_train").replace('"drive_train"', '"mine"'), "utf-8")
    assert run("rigs", "mine", "--rigs", own, "--picture", picture)[0] == 0
    assert "load_bearing" in picture.read_text("utf-8")


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("--picture", "a.png"), "Which rig is to be drawn?"),
        (("servo", "--picture", "a.bmp"), "Allowed: '.png', '.svg'"),
        (("servos", "--picture", "a.png"), "Did you mean 'servo'?"),
    ],
)
def test_what_cannot_be_drawn_is_one_message(run, arguments: tuple[str, ...], told: str) -> None:
    code, stdout, stderr = run("rigs", *arguments)
    assert (code, stdout) == (2, "")
    assert told in " ".join(stderr.split())

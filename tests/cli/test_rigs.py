"""``rigsight rigs`` lists what comes with rigsight, prints files to copy and change, and checks a user's own."""

from __future__ import annotations

import json
from pathlib import Path

from rigsight.rigs import RIGS, rig_file_text
from rigsight.rigs.reading.rig_file import rig_of_text


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

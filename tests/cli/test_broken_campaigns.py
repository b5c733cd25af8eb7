"""Whatever is wrong with a campaign, one message names it and how to mend it, and nothing is written."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

Run = Callable[..., tuple[int, str, str]]


def replaced(file: str, old: str, new: str) -> Callable[[Path], None]:
    """Change a file of the campaign; the text to change must be there."""

    def change(folder: Path) -> None:
        path = folder / file
        text = path.read_text(encoding="utf-8")
        assert old in text
        path.write_text(text.replace(old, new, 1), encoding="utf-8")

    return change


def cell(row: int, column: int, text: str) -> Callable[[Path], None]:
    """Change a cell of fit.csv; row 0 is the header."""

    def change(folder: Path) -> None:
        lines = (folder / "fit.csv").read_text().split("\n")
        cells = lines[row].split(",")
        cells[column] = text
        lines[row] = ",".join(cells)
        (folder / "fit.csv").write_text("\n".join(lines))

    return change


def without_lines(first: int, last: int | None) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        lines = (folder / "fit.csv").read_text().split("\n")
        del lines[first:last]
        (folder / "fit.csv").write_text("\n".join(lines))

    return change


def constant_input(folder: Path) -> None:
    lines = (folder / "fit.csv").read_text().split("\n")
    rows = [line.split(",") for line in lines[1:] if line]
    (folder / "fit.csv").write_text("\n".join([lines[0], *(f"{t},1.0,{x}" for t, _, x in rows)]))


def wild_clock(folder: Path) -> None:
    lines = (folder / "fit.csv").read_text().split("\n")
    rows = [line.split(",") for line in lines[1:] if line]
    moved = [f"{(1.0 + float(t)) ** 9:.9g},{u},{x}" for t, u, x in rows]
    (folder / "fit.csv").write_text("\n".join([lines[0], *moved]))


toml = "campaign.toml"
BROKEN_CAMPAIGNS: dict[str, tuple[Callable[[Path], None], tuple[str, ...]]] = {
    "no toml": (lambda f: (f / toml).unlink(), ("contains no campaign.toml",)),
    "invalid toml": (replaced(toml, "[rig]", "[rig"), (toml, "line 3")),
    "not utf-8": (lambda f: (f / toml).write_bytes(b"title = '\xff'"), (toml, "UTF-8")),
    "unknown key": (replaced(toml, "role", "rolle"), ("rolle", "Did you mean 'role'")),
    "unknown rig": (replaced(toml, '"axis"', '"axle"'), ("rig.model", "Did you mean 'axis'")),
    "unknown parameter": (replaced(toml, "d = 5.0", "damp = 5.0"), ("rig.parameters.damp", "Known")),
    "parameter out of range": (replaced(toml, "m = 2.0", "m = -2.0"), ("rig.parameters.m", "must lie in")),
    "text for a number": (replaced(toml, "m = 2.0", 'm = "2 kg"'), ("rig.parameters.m", "must be a number")),
    "missing constant": (replaced(toml, '"axis"', '"running_gear"'), ("rig.constants.v", "missing")),
    "unknown role": (replaced(toml, '"validation"', '"test"'), ("role", "Allowed")),
    "no estimation record": (replaced(toml, '"estimation"', '"validation"'), ("estimation",)),
    "no records": (
        lambda f: (f / toml).write_text('[rig]\nmodel = "axis"\n'),
        ("records", "[[records]]"),
    ),
    "missing file": (replaced(toml, "fit.csv", "fitt.csv"), ("fitt.csv", "Did you mean 'fit.csv'")),
    "path outside": (replaced(toml, "fit.csv", "../fit.csv"), ("lies outside the campaign's folder",)),
    "missing column": (replaced("fit.csv", "t,u,x", "t,u,pos"), ("fit.csv", "no column 'x'", "Its columns")),
    "not a number": (cell(7, 2, "oops"), ("fit.csv", "line 8", "column 'x'", "oops")),
    "empty cell": (cell(7, 1, ""), ("line 8", "column 'u'", "empty")),
    "NaN": (cell(7, 2, "nan"), ("line 8", "column 'x'", "finite")),
    "infinity": (cell(9, 1, "-inf"), ("line 10", "column 'u'", "finite")),
    "ragged row": (cell(7, 2, "1.0,2.0"), ("line 8", "4 columns")),
    "time runs backwards": (cell(7, 0, "0.001"), ("line 8", "not increasing")),
    "duplicate stamp": (cell(7, 0, "0.025"), ("line 8", "duplicate")),
    "wild clock": (wild_clock, ("not equally spaced", "jitter")),
    "too few samples": (without_lines(20, None), ("at least 50",)),
    "empty record": (lambda f: (f / "fit.csv").write_text(""), ("fit.csv", "empty")),
    "binary record": (lambda f: (f / "fit.csv").write_bytes(b"PK\x03\x04\0\0"), ("not a text file",)),
    "constant input": (constant_input, ("no input changes", "column 'u'")),
}


@pytest.mark.parametrize("case", BROKEN_CAMPAIGNS)
def test_a_broken_campaign_gets_one_helpful_message(
    case: str, axis_campaign: Path, tmp_path: Path, run: Run
) -> None:
    change, expected = BROKEN_CAMPAIGNS[case]
    change(axis_campaign)
    code, stdout, stderr = run("diagnose", axis_campaign, "--out", tmp_path / "out")
    assert code == 2, stderr
    assert stdout == ""
    assert stderr.startswith("rigsight: ")
    assert stderr.count("rigsight: ") == 1
    assert "Traceback" not in stderr
    for part in expected:
        assert part in stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("case", ["unknown rig", "missing file", "NaN", "constant input"])
def test_identify_gives_a_broken_campaign_one_helpful_message(
    case: str, axis_campaign: Path, tmp_path: Path, run: Run
) -> None:
    change, expected = BROKEN_CAMPAIGNS[case]
    change(axis_campaign)
    code, stdout, stderr = run("identify", axis_campaign, "--out", tmp_path / "out")
    assert (code, stdout) == (2, "")
    assert stderr.startswith("rigsight: ")
    assert "Traceback" not in stderr
    for part in expected:
        assert part in stderr
    assert not (tmp_path / "out").exists()


def test_all_mistakes_of_a_campaign_file_are_told_at_once(axis_campaign: Path, run: Run) -> None:
    replaced(toml, "role", "rolle")(axis_campaign)
    replaced(toml, "m = 2.0", 'm = "2"')(axis_campaign)
    _, _, stderr = run("diagnose", axis_campaign, "-o", axis_campaign / "out")
    assert "rolle" in stderr
    assert "rig.parameters.m" in stderr


def test_a_campaign_that_does_not_exist(tmp_path: Path, run: Run) -> None:
    code, _, stderr = run("diagnose", tmp_path / "nowhere", "-o", tmp_path / "out")
    assert code == 2
    assert "does not exist" in stderr

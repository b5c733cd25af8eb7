"""The same records in other formats give the same diagnosis."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ..records.formats.files import Write, write_matlab_packed, write_tdms

Run = Callable[..., tuple[int, str, str]]


def figures(run: Run, folder: Path) -> dict[str, object]:
    out = folder / "out"
    code, _, stderr = run("diagnose", folder, "-o", out, "--effect", "cubic_stiffness", "-j", "1", "-q")
    assert code == 0, stderr
    diagnosis = json.loads((out / "diagnosis.json").read_text())
    return {key: diagnosis[key] for key in ("verdict", "effects", "candidates", "gap", "gap_by_band")}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("suffix", "write"),
    [pytest.param(".mat", write_matlab_packed, marks=pytest.mark.slow), (".tdms", write_tdms)],
)
def test_records_in_another_format_are_diagnosed_alike(
    axis_campaign: Path, run: Run, suffix: str, write: Write
) -> None:
    in_text = figures(run, axis_campaign)
    assert in_text["effects"] == ["cubic_stiffness"]
    toml = axis_campaign / "campaign.toml"
    toml.write_text(toml.read_text().replace(".csv", suffix))
    for path in sorted(axis_campaign.glob("*.csv")):
        table = np.loadtxt(path, delimiter=",", skiprows=1)
        write(path.with_suffix(suffix), {"t": table[:, 0], "u": table[:, 1], "x": table[:, 2]}, {"x": "m"})
        path.unlink()
    assert figures(run, axis_campaign) == in_text


@pytest.mark.slow
def test_a_folder_with_clear_names_is_diagnosed_at_once(axis_campaign: Path, run: Run) -> None:
    (axis_campaign / "campaign.toml").unlink()
    assert run("init", axis_campaign, "--quiet") == (0, "", "")
    assert figures(run, axis_campaign)["effects"] == ["cubic_stiffness"]

"""Does a type checker of a user know what everything is, and does it see a mistake?"""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
USE = """
from typing import assert_type
import pandas as pd
from matplotlib.figure import Figure
import rigsight as rs

campaign = rs.make_campaign("axis", [rs.Record("a", 0.1, {}, {})], parameters={"k": 1.0})
diagnoser = rs.Diagnoser(effects=["cubic_stiffness"]).fit(campaign)
assert_type(campaign, rs.Campaign)
assert_type(diagnoser, rs.Diagnoser)
assert_type(diagnoser.diagnosis_, rs.DiagnosisResult)
assert_type(diagnoser.diagnosis_.plot("candidates"), Figure)
assert_type(diagnoser.diagnosis_.to_dataframe("gap"), pd.DataFrame)
assert_type(diagnoser.predict(campaign.records[0]), rs.Record)
assert_type(rs.LinearIdentifier().fit("folder").identification_, rs.IdentificationResult)
assert_type(rs.EquationDiscoverer().fit("folder").discovery_, rs.DiscoveryResult)
assert_type(rs.compare_models(campaign, {"a": diagnoser.model_}), rs.ComparisonResult)
"""
MISTAKES = {
    "rs.nonsense": "has no attribute",
    'diagnoser.diagnosis_.plot("gaps")': "incompatible type",
    "diagnoser.diagnosi_": "has no attribute",
    'rs.Diagnoser(effects="cubic_stiffness", seed="one")': "incompatible type",
}


@pytest.mark.release
def test_a_type_checker_knows_every_type_and_sees_every_mistake(tmp_path: Path) -> None:
    api = pytest.importorskip("mypy.api", reason="mypy is not installed")
    if find_spec("pandas-stubs") is None:
        pytest.skip("the types of pandas (pandas-stubs) are not installed")
    file = tmp_path / "use.py"
    file.write_text(USE + "\n".join(MISTAKES) + "\n", encoding="utf-8")
    # With what `make check` has kept of the packages: reading them again takes twenty seconds.
    cache = ROOT / ".mypy_cache"
    out, err, _ = api.run(
        ["--strict", "--config-file", str(ROOT / "pyproject.toml"), "--cache-dir", str(cache), str(file)]
    )
    assert err == ""
    first = USE.count("\n") + 1
    found = [line for line in out.splitlines() if ": error: " in line]
    assert len(found) == len(MISTAKES), out
    for number, (line, (mistake, words)) in enumerate(zip(found, MISTAKES.items(), strict=True), first):
        assert f"use.py:{number}: " in line, mistake
        assert words in line, mistake

"""The campaign that the first page for users shows is read as it stands, with the records that its script writes."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

from rigsight.workflow.campaign.read_campaign import read_campaign

DOCS = Path(__file__).parents[2] / "docs"


def test_the_campaign_of_the_page_is_read_with_the_records_of_its_script(tmp_path: Path) -> None:
    spec = importlib.util.spec_from_file_location("make_stage", DOCS / "examples/make_stage.py")
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    script.main(tmp_path)
    page = (DOCS / "first_diagnosis.md").read_text(encoding="utf-8")
    (campaign,) = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    (tmp_path / "campaign.toml").write_text(campaign, encoding="utf-8")
    campaign = read_campaign(tmp_path)
    assert [record.name for record in campaign.estimation] == ["sweep_5N", "sweep_20N"]
    assert [record.name for record in campaign.validation] == ["sweep_10N", "multisine_7N"]
    for record in campaign.records:
        first = (tmp_path / f"{record.name}.csv").read_text(encoding="utf-8").splitlines()[:2]
        assert first[0] in page
        assert record.hold == "zoh"
        assert abs(record.dt - script.DT) < 1e-12
        assert 1e-4 < abs(record["x"]).max() < 1.0, "meters, not millimeters"

"""The report says in words where the standard errors of the numbers come from."""

from __future__ import annotations

from dataclasses import replace

from rigsight.diagnose.result import Diagnosis, StdMethod
from rigsight.report.sections import errors_reported
from rigsight.report.wording import named_candidate


def reported(diagnosis: Diagnosis, method: StdMethod) -> Diagnosis:
    named = named_candidate(diagnosis)
    candidates = tuple(replace(c, std_method=method) if c is named else c for c in diagnosis.candidates)
    return replace(diagnosis, candidates=candidates)


def test_each_method_is_told(diagnosis: Diagnosis) -> None:
    assert "random disturbance forces" in errors_reported(reported(diagnosis, "bootstrap"))
    assert "covariance of the fit" in errors_reported(reported(diagnosis, "formula"))


def test_nothing_is_told_where_no_number_was_fitted(diagnosis: Diagnosis) -> None:
    assert errors_reported(replace(diagnosis, verdict="unknown")) == ""


def test_the_method_stands_in_the_json_of_each_candidate(diagnosis: Diagnosis) -> None:
    content = reported(diagnosis, "bootstrap").to_json()["candidates"]
    assert [c["std_method"] for c in content].count("bootstrap") == 1
    assert {c["std_method"] for c in content} == {"bootstrap", "formula"}

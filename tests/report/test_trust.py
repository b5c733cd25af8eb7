"""Page, terminal, picture and table say the same of the trust in numbers."""

from __future__ import annotations

from dataclasses import replace

import pytest

from rigsight.api.results import DiagnosisResult
from rigsight.diagnose.result import Diagnosis
from rigsight.diagnose.trust.patterns import Pattern, Role, meaning
from rigsight.diagnose.trust.statement import GroupValue, ParameterTrust, Trust, statement
from rigsight.errors import InputError
from rigsight.report.render import render_report
from rigsight.report.sections import trust_line

BY_AMPLITUDE = tuple(GroupValue(f"{a} A", value, 0.05) for a, value in ((0.5, 2.1), (1.0, 1.7), (2.0, 1.4)))
FALLING = ParameterTrust(
    name="d",
    unit="N s/m",
    value=1.6,
    std=0.03,
    of_effect=False,
    groups={"record": BY_AMPLITUDE, "amplitude": BY_AMPLITUDE},
    p_value=1e-9,
    largest=9.0,
    pattern=Pattern.AMPLITUDE,
    direction=-1,
    goes_with=("amplitude",),
    points_to=meaning(Pattern.AMPLITUDE, Role.DAMPING, -1),
)
SAME = replace(
    FALLING,
    name="k",
    p_value=1.0,
    largest=1.4,
    pattern=Pattern.STABLE,
    direction=0,
    goes_with=(),
    points_to=None,
)


def with_trust(diagnosis: Diagnosis, *numbers: ParameterTrust) -> Diagnosis:
    reported = statement(numbers, (), 3, ("record", "amplitude"))
    return replace(diagnosis, trust=Trust(reported, numbers))


def page(diagnosis: Diagnosis) -> str:
    return render_report(diagnosis, command="rigsight diagnose", versions={})


@pytest.mark.slow
def test_a_number_that_differs_is_told_everywhere(diagnosis: Diagnosis) -> None:
    found = with_trust(diagnosis, FALLING, SAME)
    html, line = page(found), trust_line(found)
    for part in (
        "d falls with amplitude, 2.1 N s/m at 0.5 A and 1.4 N s/m at 2.0 A",
        "Next: Record the same input",
    ):
        assert part in html
    assert "The other number, k, is the same in every record" in html
    assert 'id="figure-trust"' in html
    assert line.startswith("Trust: d falls with amplitude. Damping depends on the motion")


@pytest.mark.slow
def test_numbers_that_are_the_same_need_no_experiment(diagnosis: Diagnosis) -> None:
    found = with_trust(diagnosis, SAME)
    assert "k is the same in every record" in trust_line(found)
    assert "next experiment" not in page(found)


@pytest.mark.slow
def test_where_it_was_not_asked_nothing_is_said(diagnosis: Diagnosis) -> None:
    without = replace(diagnosis, trust=None)
    assert trust_line(without) == ""
    assert "Can the numbers be trusted?" not in page(without)


def test_a_notebook_has_picture_and_table(diagnosis: Diagnosis) -> None:
    found = DiagnosisResult.of(with_trust(diagnosis, FALLING, SAME))
    assert found.plot("trust").axes[0].get_title(loc="left") == "d [N s/m] by amplitude"
    table = found.to_dataframe("trust")
    assert len(table) == 12
    assert set(table["pattern"]) == {"with amplitude", "stable"}
    with pytest.raises(InputError, match="No parameter"):
        DiagnosisResult.of(replace(diagnosis, trust=None)).plot("trust")

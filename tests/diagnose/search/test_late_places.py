"""A delay is tried at every place that makes the same readings late, beside other causes, too."""

from __future__ import annotations

import pytest

from rigsight.diagnose.diagnosis import diagnose
from rigsight.effects import CATALOGUE, effect_named
from rigsight.rigs import AXIS

from ...inverse.test_proposal import AXIS_VALUES, campaign


@pytest.mark.slow
@pytest.mark.parametrize(
    ("beside", "size", "family"),
    [("coulomb_friction", {"T_c": 1.5}, "dry_friction"), ("cubic_stiffness", {"k_3": 1e5}, "spring_law")],
)
def test_a_late_command_beside_another_cause_may_be_a_late_sensor(
    beside: str, size: dict[str, float], family: str
) -> None:
    hidden = [effect_named(name) for name in ("input_delay", beside)]
    own = campaign(AXIS, {**AXIS_VALUES, "T_d": 0.015, **size}, hidden, (5.0, 10.0, 20.0))
    found = diagnose(own, CATALOGUE)
    probable = {(str(own.family), own.where): own.probability for own in found.families}
    assert probable[family, "dynamics"] > 0.9
    late = [probable.get(("delay_or_lag", place), 0.0) for place in ("actuator", "sensor")]
    assert min(late) > 0.1
    assert sum(late) == pytest.approx(1.0, abs=0.02)

"""A delay is tried at every place that makes the same readings late, beside other causes, too."""

from __future__ import annotations

import pytest

from rigsight.diagnose.diagnosis import diagnose
from rigsight.effects import CATALOGUE, effect_named
from rigsight.rigs import AXIS

from ...inverse.test_proposal import AXIS_VALUES, campaign

HIDDEN = [effect_named(name) for name in ("input_delay", "coulomb_friction")]


@pytest.mark.slow
def test_a_late_command_beside_friction_may_be_a_late_sensor() -> None:
    own = campaign(AXIS, {**AXIS_VALUES, "T_d": 0.015, "T_c": 1.5}, HIDDEN, (5.0, 10.0, 20.0))
    found = diagnose(own, CATALOGUE)
    probable = {(str(own.family), own.where): own.probability for own in found.families}
    assert probable["dry_friction", "dynamics"] > 0.9
    late = [probable.get(("delay_or_lag", place), 0.0) for place in ("actuator", "sensor")]
    assert min(late) > 0.1
    assert sum(late) == pytest.approx(1.0, abs=0.02)

"""Another form of an effect speaks against a second effect, except where only noise is left."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.search.evidence_for_more import OtherForms
from rigsight.rigs import AXIS


class Explaining(OtherForms):
    """Other forms explain a stated part of a model's mean square error, in units of the noise floor."""

    def __init__(self, part: float, lower_bound: bool = False) -> None:
        super().__init__(cast("FitContext", SimpleNamespace(rig=AXIS)), lower_bound)
        self.part = part

    def gain(self, model: FittedModel) -> float:
        return self.part


@pytest.mark.parametrize(
    ("left", "lower_bound", "stands"), [(1.0, False, True), (2.0, False, False), (1.0, True, False)]
)
def test_a_pair_stands_if_it_leaves_noise_or_explains_more_than_another_form(
    scored, left: float, lower_bound: bool, stands: bool
) -> None:
    single = scored(("coulomb_friction",), np.full(9, 5.0))
    pair = scored(("coulomb_friction", "input_saturation"), np.full(9, left))
    found = Explaining(13.0, lower_bound).with_own_evidence([single], [pair])
    assert found == ([pair] if stands else [])

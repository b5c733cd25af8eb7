"""Every effect of the catalogue: its own simulation returns its parameters."""

from __future__ import annotations

import pytest

from rigsight.effects import CATALOGUE, Effect
from rigsight.workflow.own.effect_checks import is_found_again


@pytest.mark.parametrize("effect", CATALOGUE, ids=lambda effect: effect.name)
def test_its_own_simulation_returns_its_parameters(effect: Effect) -> None:
    assert is_found_again(effect) is None

"""An effect that fails a check is refused: measured on a second damper beside the rig's own."""

from __future__ import annotations

from dataclasses import replace

import sympy as sp

from rigsight.effects import Effect, Energy, GainTrend, Place, Signature
from rigsight.effects.symbols import v
from rigsight.parameters import Parameter
from rigsight.workflow.own import effect_checks

DAMPING = Parameter(
    "c_1", "second damper", "force time x^-1", lower=0.0, null=0.0, starts=(0.3,), search=(0.0, 10.0)
)
SECOND_DAMPER = Effect(
    name="second_damper",
    place=Place.DYNAMICS,
    summary="A damper beside the rig's.",
    parameters=(DAMPING,),
    energy=Energy.DISSIPATIVE,
    signature=Signature(GainTrend.STEADY),
    torque=sp.Symbol("c_1", real=True) * v,
)


def test_a_damper_beside_the_damper_passes_all_checks_but_one():
    """No record tells the two apart; all else is in order."""
    (failed,) = effect_checks.failed_checks(SECOND_DAMPER)
    assert "do not determine c_1" in failed


def test_a_damper_is_not_conservative():
    failed = effect_checks.gives_no_energy(replace(SECOND_DAMPER, energy=Energy.CONSERVATIVE))
    assert failed is not None
    assert "declared conservative, but dissipates" in failed


def test_a_damper_turned_round_gives_energy():
    failed = effect_checks.gives_no_energy(
        replace(SECOND_DAMPER, parameters=(replace(DAMPING, lower=-1.0, starts=(-0.1,), search=(-1.0, 1.0)),))
    )
    assert failed is not None
    assert "but generates" in failed


def test_the_effect_has_to_fade_towards_its_null_value():
    """At 30 N s/m the damper is no smaller than before; only the exact number leaves it out."""
    failed = effect_checks.vanishes_continuously(
        replace(SECOND_DAMPER, parameters=(replace(DAMPING, null=30.0, starts=(4.0,)),))
    )
    assert failed is not None
    assert "not close to that of the rig without the effect" in failed


def test_a_search_range_in_which_the_motion_escapes_is_told():
    failed = effect_checks.finite_where_searched(
        replace(SECOND_DAMPER, parameters=(replace(DAMPING, lower=-1e9, search=(-100.0, 1.0)),))
    )
    assert failed is not None
    assert "inside its search ranges" in failed

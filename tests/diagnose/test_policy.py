"""Every number of a diagnosis stands in its policy with a reason; outside are numerical tolerances alone."""

from __future__ import annotations

import ast
import dataclasses
from pathlib import Path

import pytest

import rigsight.diagnose
from rigsight.diagnose.policy import POLICY
from rigsight.diagnose.policy.number import stated

PACKAGE = Path(rigsight.diagnose.__file__).parent
GROUPS = [getattr(POLICY, own.name) for own in dataclasses.fields(POLICY)]
MOST_DECIDING = 30
TOLERANCES = {
    "_SMOOTHED": "lines of a spectrum that are averaged",
    "_TAPER": "fading of a record",
    "_FEWEST": "lines that a spectrum needs",
    "_BESIDE": "start of a search",
    "_FAINT": "bounds of a search",
    "_STRONG": "bounds of a search",
    "_ORDERS": "orders of a filter",
    "_WHITE": "regularization",
    "_KNOTS": "discretization",
    "_TIMES": "discretization",
    "_PUSH": "finite difference",
    "_SMALL": "finite difference",
    "_STEP": "finite difference",
    "_DEPENDENT": "rank",
    "_UNDETERMINED": "rank",
    "_ROUNDED_COLUMN": "rank",
    "_DETERMINED": "rank",
    "_SINGULAR": "rank",
    "_AT_BOUND": "equality of floats",
    "_EQUAL": "equality of floats",
    "_SMALLEST": "division by zero",
    "_DAMPING_RATIO": "shape of a weight",
    "_TOLERANCE": "of an optimizer",
    "_ROUGH_TOLERANCE": "of an optimizer",
    "_FINE_TOLERANCE": "of an optimizer",
    "_HOPELESS_TOLERANCE": "of an optimizer",
    "_LOOK_TOLERANCE": "of an optimizer",
    "_ACCURACY": "of an integration",
    "_ROUGH_ACCURACY": "of an integration",
    "LOOK_ACCURACY": "of an integration",
    "_TURNS": "draws of a test",
    "_PORTIONS": "memory",
    "_RESAMPLES": "draws of a bootstrap",
    "_MIN_BLOCKS": "draws of a bootstrap",
    "_FREE_MODES": "order of a subspace",
    "_MAX_HANKEL_ROWS": "memory",
    "SCHEMA_VERSION": "no number of a diagnosis",
    "_STEEPEST": "resolution of a bootstrap",
    "_SEED": "of starts",
    "_STREAM": "of random numbers",
    "_AT_ONCE": "memory",
    "_UNIT_DRAWS": "draws of a bootstrap",
    "_SETTING_DRAWS": "draws of a bootstrap",
    "_FIRST": "start of a search",
    "_SIZING_ROUNDS": "of a search",
    "_MOST_GROWN": "bounds of a search",
    "_MOST_CHANGED": "bounds of a search",
    "_SHOWS": "what chance alone would tell",
    "_ROUNDS": "of an optimizer",
    "_NOTHING": "bounds of a search",
    "_AVERAGED": "lines of a spectrum that are averaged",
    "FEWEST": "lines that a spectrum needs",
    "SLOWER": "discretization",
}


@pytest.mark.parametrize("group", GROUPS, ids=lambda group: type(group).__name__)
def test_every_number_has_a_reason(group: object) -> None:
    for own in stated(group):
        assert len(own.reason.split()) >= 4, own.name
        assert own.kind != "measured" or own.set_by, f"{own.name}: which study measured it?"


def test_the_deciding_numbers_can_be_counted() -> None:
    assert len(stated(POLICY.verdict)) <= MOST_DECIDING


def test_the_policy_cannot_be_changed() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        POLICY.verdict.at_floor = 2.0


def test_outside_the_policy_are_tolerances_alone() -> None:
    found = {
        name: path
        for path in PACKAGE.rglob("*.py")
        if path.parent.name != "policy"
        for name in _numbers_of(path)
    }
    assert set(found) == set(TOLERANCES), {name: found.get(name) for name in set(found) ^ set(TOLERANCES)}


def _numbers_of(path: Path) -> list[str]:
    names = []
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        target = node.targets[0] if isinstance(node, ast.Assign) else None
        targets = target.elts if isinstance(target, ast.Tuple) else [target]
        is_number = isinstance(node, ast.Assign) and any(
            isinstance(part, ast.Constant) and isinstance(part.value, int | float)
            for part in ast.walk(node.value)
        )
        names += [t.id for t in targets if is_number and isinstance(t, ast.Name) and t.id.isupper()]
    return names

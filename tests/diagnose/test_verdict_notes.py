"""Each rule tells its sentence where its condition holds, and nothing elsewhere."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rigsight.diagnose import verdict_notes as notes
from rigsight.diagnose.policy import VERDICT
from rigsight.effects import effect_named
from rigsight.identify.fit.windows import Windowing
from rigsight.records import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose


def fitted(*residuals: float, names: tuple[str, ...] = ()) -> Any:
    """What rules read of a model: its residuals in the fitted records, nothing held out."""
    left = tuple(np.full((3, 1), own) for own in residuals)
    return SimpleNamespace(effects=(), names=names, fit=SimpleNamespace(residuals=left), residuals=())


def basis(
    verdict: str = "effect", *, below_rest: float | None = None, factor: Any = None, **found: Any
) -> notes.Basis:
    """What a rule reads, with nothing to tell about except what is given."""
    campaign: Any = SimpleNamespace(
        notes=("of the campaign",),
        records=(Record(name="run", dt=0.1, signals={"u": np.zeros(3)}, units={}, notes=("of a record",)),),
        rig=AXIS,
        open_factor=factor,
    )
    judged = SimpleNamespace(verdict=verdict, reason="the reason", model=fitted())
    found = {
        "context": SimpleNamespace(
            along_motion=None, scales={}, estimation=(), scoring=(), floors=np.ones(1)
        ),
        "windowing": SimpleNamespace(bandwidth=None, cycles=None),
        "reidentified": fitted(),
        "judgement": judged,
        "quality": SimpleNamespace(notes=("of the quality",)),
        "imitations": (),
        "doubts": ("a doubt",),
        **found,
    }
    return notes.Basis(campaign, SimpleNamespace(**found), np.random.default_rng(0), below_rest)


@pytest.fixture
def growth(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """How far disturbances grow, as a test sets it."""
    chosen = SimpleNamespace(value=0.0)
    monkeypatch.setattr(notes, "growth_of_disturbances", lambda *_: chosen.value)
    return chosen


def test_where_nothing_is_odd_no_rule_tells_anything() -> None:
    plain = basis()
    assert [rule(plain) for rule in (*notes.ON_THE_COMPARISON, *notes.ON_WHAT_STAYS_OPEN)] == [None] * 9
    expected = ("of the campaign", "of a record", "of the quality", "the reason", "a doubt")
    assert notes.verdict_notes(plain) == expected


def test_an_open_factor_is_told() -> None:
    assert notes.open_factor_note(basis(factor=SimpleNamespace(sentence="It is open."))) == "It is open."


def test_a_noise_floor_that_a_model_undercuts_is_told() -> None:
    reported = notes.moving_at_rest_note(basis(below_rest=0.31))
    assert reported is not None
    assert "error is 0.31 of the noise floor measured at rest" in reported


def test_observers_are_told_with_the_time_over_which_errors_build_up() -> None:
    tracks = SimpleNamespace(bandwidth=4.0, cycles=None)
    reported = notes.observer_note(basis(windowing=tracks))
    assert reported is not None
    assert "up to 4 rad/s" in reported
    assert "within 0.25 s" in reported
    held = notes.observer_note(basis(windowing=tracks, context=SimpleNamespace(along_motion=object())))
    assert held is not None
    assert held.startswith(reported)
    assert len(held) > len(reported)


def test_windows_are_told_with_their_cycles() -> None:
    reported = notes.windows_note(basis(windowing=Windowing(cycles=VERDICT.window_cycles, noise={})))
    assert reported is not None
    assert f"in windows of {VERDICT.window_cycles} cycles" in reported


def test_a_sensitive_motion_is_told_where_the_cause_is_unknown_and_records_are_whole(
    growth: SimpleNamespace,
) -> None:
    growth.value = VERDICT.sensitive
    assert notes.sensitive_motion_note(basis("unknown")) is None
    growth.value = 40.0
    reported = notes.sensitive_motion_note(basis("unknown"))
    assert reported is not None
    assert "changes it by 40 times the noise" in reported
    assert notes.sensitive_motion_note(basis("effect")) is None
    assert (
        notes.sensitive_motion_note(
            basis("unknown", windowing=Windowing(cycles=VERDICT.window_cycles, noise={}))
        )
        is None
    )


def test_of_pairs_that_imitate_the_nearest_is_told_where_the_cause_is_unknown() -> None:
    pairs = [SimpleNamespace(names=("a", name), error_over_noise=e) for name, e in (("b", 1.5), ("c", 1.25))]
    reported = notes.imitations_note(basis("unknown", imitations=pairs))
    assert reported is not None
    assert reported.startswith("Together a and c leave 1.25 times the noise floor")
    assert notes.imitations_note(basis("effect", imitations=pairs)) is None


def test_all_are_read_in_order_and_none_holds_a_brace(growth: SimpleNamespace) -> None:
    """A brace would be a value that was not put in."""
    growth.value = 40.0
    pair = SimpleNamespace(names=("a", "b"), error_over_noise=1.5)
    factor = SimpleNamespace(sentence="It is open.")
    begun = []
    for cycles in (None, 4):
        full = basis(
            "unknown", below_rest=0.3, factor=factor, imitations=(pair,),
            windowing=SimpleNamespace(bandwidth=4.0, cycles=cycles),
        )  # fmt: skip
        reported = notes.verdict_notes(full)
        assert not [note for note in reported if "{" in note or "}" in note]
        begun.append([" ".join(note.split()[:3]) for note in reported])
    before = ["of the campaign", "of a record", "It is open.", "A model's error", "The rig has"]
    after = ["of the quality", "the reason", "a doubt", "Together a and"]
    assert begun == [[*before, "The motion of", *after], [*before, "In free run", *after]]


def test_a_record_that_an_effect_makes_worse_is_told() -> None:
    records = tuple(SimpleNamespace(origin=name) for name in ("slow", "fast"))
    context = SimpleNamespace(estimation=records, scoring=(), floors=np.ones(1))

    def note(slow: float) -> str | None:
        judged = SimpleNamespace(verdict="effect", model=fitted(slow, 1.0, names=("speed_limit",)))
        return notes.worse_record_note(
            basis(context=context, judgement=judged, reidentified=fitted(2.0, 9.0))
        )

    assert note(2.1) is None
    reported = note(3.0)
    assert reported is not None
    assert reported.startswith("In record 'slow' the error with speed_limit is 1.5 times that without")


def test_every_rule_is_called() -> None:
    declared = {value for name, value in vars(notes).items() if name.endswith("_note")}
    assert declared == {*notes.ON_THE_COMPARISON, *notes.ON_WHAT_STAYS_OPEN}


@pytest.mark.parametrize("effect", ["input_delay", "sensor_delay", "time_shift"])
@pytest.mark.parametrize(
    ("delay", "uncertainty", "reported"), [(1e-3, 2e-3, True), (3e-3, 2e-3, False), (1e-3, 0.0, False)]
)
def test_a_delay_shorter_than_the_clocks_can_tell_is_said(
    effect: str, delay: float, uncertainty: float, reported: bool
) -> None:
    late = effect_named(effect)
    structure = compose(AXIS, (late,))
    name = structure.parameter_name(late, late.parameters[0].name)
    model = SimpleNamespace(effects=(late,), fit=SimpleNamespace(values={name: delay}, structure=structure))
    found = basis(judgement=SimpleNamespace(verdict="effect", reason="", model=model))
    record = replace(found.campaign.records[0], clock_uncertainty=uncertainty)
    found = replace(found, campaign=SimpleNamespace(records=(record,)))
    note = notes.clocks_note(found)
    assert (note is not None) == reported
    assert note is None or f"{effect} of 0.001 s" in note

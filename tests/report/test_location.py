"""The page says where the gap lies, with the noise floor beside it, in words as well as in pictures."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace

import pytest

from rigsight.diagnose.location.gap_parts import Localization
from rigsight.diagnose.result import Diagnosis
from rigsight.report.location import force_maps, joint_maps, output_maps
from rigsight.report.render import render_report
from rigsight.report.sections import interval_text
from rigsight.report.wording import missing_force_sentence


def render(diagnosis: Diagnosis) -> str:
    return render_report(diagnosis, "rigsight diagnose", {"rigsight": "0.1.0"})


def words(html: str) -> str:
    return " ".join(re.sub(r"<[^>]+>", " ", html).split())


@pytest.mark.slow
def test_the_page_says_on_which_leg_the_gap_lies(page_of: Callable[[str], str]) -> None:
    page = words(page_of("effect"))
    assert "The gap lies before psi is measured." in page
    assert "u → psi 40 % 13 % 0.9 %" in page
    assert "−4 ± 0.1 ms, then 1.1 %" in page


def test_every_map_is_there_and_told_in_words(diagnosis: Diagnosis) -> None:
    (maps,) = output_maps(diagnosis)
    assert [figure.key.split("-")[-1] for figure in maps.figures] == [
        "bands", "states", "amplitudes", "records", "times",
    ]  # fmt: skip
    for figure in maps.figures:
        label = re.search(r'aria-label="([^"]+)"', str(figure.image))
        assert label is not None
        assert "noise floor 0.9 %" in label[1]
    bands = str(maps.figures[0].image)
    assert (
        "Above 30 rad/s: given simulation 8 %, re-identified 2.6 %, with effect 0.2 %, noise floor 0.9 %."
        in bands
    )
    assert "-1.5 N m forward and 1.2 N m backward" in str(maps.figures[1].image)


def test_amplitudes_that_are_one_record_each_are_not_drawn_twice(diagnosis: Diagnosis) -> None:
    alone = tuple(
        replace(part, records=part.records[i : i + 1])
        for i, part in enumerate(diagnosis.localization.by_amplitude)
    )
    (maps,) = output_maps(
        replace(diagnosis, localization=replace(diagnosis.localization, by_amplitude=alone))
    )
    assert "records" not in [figure.key.split("-")[-1] for figure in maps.figures]
    assert "0.25 A sweep_A0.25.csv; 0.75 A sweep_A0.75.csv." in maps.figures[2].caption


@pytest.mark.slow
def test_without_a_force_the_map_of_states_shows_the_residual_alone(diagnosis: Diagnosis) -> None:
    blind = tuple(replace(part, force_mean=math.nan) for part in diagnosis.localization.by_state)
    where = replace(diagnosis.localization, by_state=blind)
    (maps,) = output_maps(replace(diagnosis, localization=where))
    assert "force missing in the equations" in str(output_maps(diagnosis)[0].figures[1].image)
    assert "force missing in the equations" not in str(maps.figures[1].image)


@pytest.mark.slow
def test_the_budget_shows_its_intervals(page_of: Callable[[str], str]) -> None:
    page = words(page_of("effect"))
    assert "39 % to 45 %" in page
    assert "95 % to 98 %" in page


def test_two_effects_share_the_gap(page_of: Callable[[str], str]) -> None:
    assert "Coulomb friction 80 % 70 %" in words(page_of("two effects"))


def test_without_a_shift_nothing_is_said_of_it(diagnosis: Diagnosis) -> None:
    alone = replace(diagnosis.localization, by_path=diagnosis.localization.by_path[:1])
    only = replace(diagnosis, localization=alone, traces=())
    assert "input earlier by" not in render(only)


def test_a_result_without_places_has_no_such_section(diagnosis: Diagnosis) -> None:
    html = render(replace(diagnosis, localization=Localization(), traces=()))
    assert 'id="where"' not in html
    assert 'href="#where"' not in html


def test_the_missing_force_is_shown_joint_by_joint(variant: Callable[[str], Diagnosis]) -> None:
    """What it says of each joint and family stands in the page for every verdict, in a sentence only where no effect does."""
    unknown = variant("unknown")
    assert unknown.missing_force is not None
    (force,) = unknown.missing_force.forces
    second = replace(unknown.missing_force, forces=(force, replace(force, where="shaft", share=0.2)))
    (maps,) = force_maps(replace(unknown, missing_force=second))
    assert [figure.key for figure in maps.figures] == ["missing-force-1", "missing-force-2"]
    assert "Damping law in the yaw dynamics quadratic damping 98 %" in words(render(unknown))
    assert "quadratic damping in the yaw dynamics 98 %" in missing_force_sentence(unknown)
    named = replace(variant("effect"), missing_force=unknown.missing_force)
    assert missing_force_sentence(named) == ""
    assert "missing-force-1" in render(named)
    assert force_maps(variant("effect")) == []


@pytest.mark.slow
def test_the_maps_of_joints_are_those_that_the_verdict_names_else_all(diagnosis: Diagnosis) -> None:
    states = diagnosis.localization.by_state
    at_joints = tuple(replace(part, joint=joint) for joint in ("load", "shaft") for part in states)
    several = replace(diagnosis, localization=replace(diagnosis.localization, by_state=at_joints))
    (maps,) = joint_maps(several)
    assert [figure.key for figure in maps.figures] == ["where-joint-1-states", "where-joint-2-states"]
    assert "By state of load, along the motion" in maps.figures[0].caption
    assert "if everything missing acts at load." in maps.figures[0].caption
    assert "where-joint-2-states" in render(several)
    (named,) = joint_maps(replace(several, where=("shaft",)))
    assert ["By state of shaft" in figure.caption for figure in named.figures] == [True]
    assert not any(figure.key.endswith("states") for own in output_maps(several) for figure in own.figures)


def test_at_the_floor_no_joint_has_a_map(diagnosis: Diagnosis) -> None:
    unknown = {"force_mean": math.nan, "force_rms": math.nan, "force_noise": math.nan}
    parts = tuple(replace(part, joint="load", **unknown) for part in diagnosis.localization.by_state)
    assert joint_maps(replace(diagnosis, localization=replace(diagnosis.localization, by_state=parts))) == []
    assert joint_maps(diagnosis) == []


def test_an_interval_whose_ends_read_alike_is_one_number() -> None:
    assert interval_text((0.9995, 0.9998), "closed") == "over 99.9 %"
    assert interval_text((0.991, 0.9998), "closed") == "99.1 % to over 99.9 %"

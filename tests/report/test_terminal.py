from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import replace

import pytest
from rich.console import Console

from rigsight.diagnose.data_quality.finding import DataQuality, Finding
from rigsight.diagnose.result import Diagnosis
from rigsight.report.terminal import summary


def printed(diagnosis: Diagnosis, encoding: str = "ascii", width: int = 200) -> list[str]:
    stream = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
    Console(file=stream, width=width, color_system=None).print(summary(diagnosis))
    stream.seek(0)
    return stream.read().splitlines()


def test_ten_lines_say_verdict_gap_ranking_and_parameters(diagnosis: Diagnosis) -> None:
    lines = printed(diagnosis)
    assert 7 <= len(lines) <= 12
    text = "\n".join(lines)
    assert "Missing effect: rear axle, March" in text
    assert "down to 1.04 x the noise floor" in text
    assert "given simulation 42 %, re-identified 13 %, with effect 0.94 %, noise floor 0.9 %" in text
    assert (
        "Bouc-Wen hysteresis 91 % (1.04 x floor); Coulomb friction and cubic stiffness 6 % (1.06 x floor)"
        in text
    )
    assert "beta = 1203 +/- 31 1/rad" in text
    (own,) = (i for i, line in enumerate(lines) if line.startswith("  parameters"))
    (rig,) = (i for i, line in enumerate(lines) if line.startswith("  of the rig"))
    assert own < rig
    assert "k_c" in "".join(lines[rig:])
    assert "k_c" not in "".join(lines[own:rig])
    assert "gamma = not determined by these records" in text


@pytest.mark.parametrize(
    "name", ["parameters", "none", "unknown", "no candidates", "not finite", "element", "hostile"]
)
def test_every_kind_of_result_has_a_summary(variant: Callable[[str], Diagnosis], name: str) -> None:
    assert len(printed(variant(name))) >= 3


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8"])
def test_a_title_that_the_terminal_cannot_write_does_no_harm(diagnosis: Diagnosis, encoding: str) -> None:
    titled = replace(diagnosis, title="Hinterachse, März — 測定 [bold]\x1b[31m")
    first = printed(titled, encoding)[0]
    assert "Hinterachse, M" in first
    assert "[bold]" in first
    assert "\x1b" not in first


def test_a_narrow_terminal_wraps(diagnosis: Diagnosis) -> None:
    assert max(map(len, printed(diagnosis, width=60))) <= 60


def test_one_experiment_is_named_and_the_rest_left_to_the_report(variant: Callable[[str], Diagnosis]) -> None:
    text = "\n".join(printed(variant("advised")))
    assert (
        "To confirm or rule out Coulomb friction, record a sweep of amplitude 1.25 A from 0.5 to 40 rad/s"
        in text
    )
    assert "differ by 23 standard deviations of the noise" in text
    assert "Stribeck friction apart" not in text


def test_faults_of_the_records_come_before_everything_but_the_verdict(
    variant: Callable[[str], Diagnosis],
) -> None:
    diagnosis = variant("effect")
    finding = Finding("hold", "The input follows another hold.", "Set hold.", serious=True)
    minor = replace(finding, sentence="A minor thing.", serious=False)
    shown = printed(replace(diagnosis, data_quality=DataQuality((finding, minor), ())))
    assert shown[2] == "Check the records first: The input follows another hold. Set hold."
    assert not any("minor" in line for line in shown)


def test_values_of_the_given_simulation_stand_behind_those_that_were_found(diagnosis: Diagnosis) -> None:
    text = "\n".join(printed(replace(diagnosis, given={"k_c": 81.0})))
    assert "N m/rad (given 81)" in text
    assert text.count("(given") == 1


def test_where_nothing_was_given_there_is_no_given_simulation(variant: Callable[[str], Diagnosis]) -> None:
    text = "\n".join(printed(variant("nothing given")))
    assert "identified 13 %, with effect 0.94 %, noise floor 0.9 %" in text
    assert "given" not in text
    assert "re-identified" not in text


def test_an_unknown_gap_is_described_by_the_force_that_is_lacking(
    variant: Callable[[str], Diagnosis],
) -> None:
    assert "a force of 0.3 N m RMS is missing in the yaw dynamics" in " ".join(printed(variant("unknown")))

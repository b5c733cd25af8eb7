"""The configs of the study: what is measured, fitted and compared, read and checked."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Annotated, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from rigsight.errors import InputError

Table = TypeVar("Table", bound=BaseModel)
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
HERE = Path(__file__).parent


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class Noise(_Table):
    """Standard deviations of sensor noise [rad], [m] and torque disturbance [N m]."""

    psi: Positive
    y: Positive
    disturbance: Positive


class Sweep(_Table):
    """A logarithmic sweep between two rests."""

    omega_start: Positive
    omega_stop: Positive
    growth: Positive
    rest: Positive


class Step(_Table):
    """A step after some rest."""

    start: Positive
    duration: Positive


class Evaluation(_Table):
    """Records that every model is scored on; the first sweep is declared for estimation, since a campaign needs one."""

    sweeps: Annotated[list[Positive], Field(min_length=1)]
    steps: list[Positive]
    seed: int


class Calibration(_Table):
    """Structure and search of the hysteresis calibration."""

    effects: list[str]
    fixed: dict[str, float]
    n_generations: int
    n_sets: int
    n_ends: int


class Study(_Table):
    """What all configs share."""

    published: list[str]
    virtual_rig: Noise
    sweep: Sweep
    step: Step
    evaluation: Evaluation
    calibration: Calibration


class Config(_Table):
    """One set of models: the records they are fitted to, by amplitude [A], and what they are compared with."""

    title: str
    estimation: Annotated[list[Positive], Field(min_length=1)]
    validation: list[Positive] = []
    validation_steps: list[Positive] = []
    noise: Positive = 1.0
    seed: int = 1
    with_published: bool = False


def read_study(file: Path = HERE / "study.toml") -> Study:
    return _read(file, Study)


def read_configs(folder: Path = HERE / "configs") -> dict[str, Config]:
    """Return the configs by the names of their files."""
    return {file.stem: _read(file, Config) for file in sorted(folder.glob("*.toml"))}


def _read(file: Path, table: type[Table]) -> Table:
    try:
        return table.model_validate(tomllib.loads(file.read_text(encoding="utf-8")))
    except (OSError, tomllib.TOMLDecodeError, ValidationError) as error:
        raise InputError(f"{file} cannot be used: {error}") from None

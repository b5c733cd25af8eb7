"""The stages of the study: measure, identify, calibrate, discover, compare."""

from __future__ import annotations

import io
import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from store import Stage
from study import Config, Study

from rigsight import cli
from rigsight.effects import effect_named
from rigsight.errors import RigsightError
from rigsight.excitation import log_sweep, step
from rigsight.identify.hysteresis import calibrate_to_records
from rigsight.records import Record
from rigsight.rigs import RUNNING_GEAR
from rigsight.simulate import Structure, compose
from rigsight.simulate.model import Model
from rigsight.workflow.campaign.model_file import MODEL_FILE, read_model
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.compare import run_compare
from rigsight.workflow.demo import VirtualRig
from rigsight.workflow.identify import run_identify
from rigsight.workflow.run.results import json_text

EVALUATION = "evaluation"
FITTED = ("identify", "calibrate", "discover")
"""Stages that leave a model."""
_LONGEST_DISCOVERY = 3600.0


def discovery_exists() -> bool:
    """Return True if this rigsight has the command `discover`."""
    return any(
        command.callback.__name__ == "discover" for command in cli.app.registered_commands if command.callback
    )


def calibrated_structure(study: Study) -> Structure:
    effects = [effect_named(name) for name in study.calibration.effects]
    return compose(RUNNING_GEAR, effects, dict(study.calibration.fixed))


def evaluation_stage(study: Study, out: Path) -> Stage:
    """Return the stage that measures what every model is scored on."""
    asked = study.evaluation
    config = Config(
        title="evaluation",
        estimation=asked.sweeps[:1],
        validation=asked.sweeps[1:],
        validation_steps=asked.steps,
        seed=asked.seed,
    )
    return _campaign_stage(study, config, out / EVALUATION)


def chain(study: Study, name: str, config: Config, out: Path) -> Iterator[tuple[str, Stage]]:
    """Yield the stages of a config in order; a stage is made when those before it are done, since it may use their results."""
    folder = out / name
    campaign = _campaign_stage(study, config, folder / "campaign")
    yield "campaign", campaign
    upon = {"campaign": campaign.settings}
    yield "identify", Stage(folder / "identify", upon, partial(_identify, campaign.folder))
    calibration = {**upon, "calibration": study.calibration.model_dump(), "seed": config.seed}
    work = partial(_calibrate, study, campaign.folder, folder / "identify", config.seed)
    yield "calibrate", Stage(folder / "calibrate", calibration, work)
    if discovery_exists():
        yield "discover", Stage(folder / "discover", upon, partial(_discover, campaign.folder))
    models = [stage for stage in FITTED if (folder / stage / MODEL_FILE).is_file()]
    published = study.published if config.with_published else []
    evaluation = evaluation_stage(study, out)
    scored = {**upon, "evaluation": evaluation.settings, "models": models, "published": published}
    named = [f"{stage}={folder / stage}" for stage in models]
    yield (
        "compare",
        Stage(folder / "compare", scored, partial(_compare, evaluation.folder, [*published, *named])),
    )


def run_chain(study: Study, name: str, config: Config, out: Path) -> list[str]:
    """Do what is not done yet of a config, and return one line per stage that was done, or could not be."""
    told = []
    for stage_name, stage in chain(study, name, config, out):
        try:
            if stage.ensure():
                seconds = json.loads((stage.folder / "settings.json").read_text())["seconds"]
                told.append(f"{name}: {stage_name} done in {seconds:.0f} s")
        except RigsightError as error:
            told.append(f"{name}: {stage_name} left out: {error}")
    return told


def _campaign_stage(study: Study, config: Config, folder: Path) -> Stage:
    settings: dict[str, Any] = {
        "rig": study.virtual_rig.model_dump(),
        "sweep": study.sweep.model_dump(),
        "step": study.step.model_dump(),
        "config": config.model_dump(exclude={"with_published"}),
    }
    return Stage(folder, settings, partial(_measure, study, config))


def _measure(study: Study, config: Config, folder: Path) -> None:
    noise = study.virtual_rig
    rig = VirtualRig(
        noise={"psi": noise.psi * config.noise, "y": noise.y * config.noise},
        disturbance=noise.disturbance * config.noise,
    )
    records = [
        *(_sweep(study, rig, a, "estimation", config.seed) for a in config.estimation),
        *(_sweep(study, rig, a, "validation", config.seed) for a in config.validation),
        *(_step(study, rig, a, config.seed) for a in config.validation_steps),
    ]
    for record in records:
        table = np.column_stack([record.t, record["u"], record["psi"], record["y"]])
        file = io.StringIO()
        np.savetxt(file, table, fmt="%.9g", delimiter=",", header="t,u,psi,y", comments="")
        (folder / f"{record.name}.csv").write_text(file.getvalue(), encoding="utf-8")
    (folder / "campaign.toml").write_text(_campaign_toml(config.title, rig, records), encoding="utf-8")


def _rng(seed: int, name: str) -> np.random.Generator:
    """Return the noise of a record: another for each record and seed, the same in every run."""
    return np.random.default_rng([seed, *name.encode()])


def _sweep(study: Study, rig: VirtualRig, amplitude: float, role: Any, seed: int) -> Record:
    asked = study.sweep
    t = rig.time(float(np.log(asked.omega_stop / asked.omega_start)) / asked.growth)
    rest = np.zeros(round(asked.rest / rig.dt))
    u = np.concatenate([rest, log_sweep(t, amplitude, asked.omega_start, asked.omega_stop), rest])
    name = f"sweep_{amplitude:.2f}A"
    return rig.measure(name, u, _rng(seed, name), kind="sweep", role=role, amplitude=amplitude)


def _step(study: Study, rig: VirtualRig, amplitude: float, seed: int) -> Record:
    name = f"step_{amplitude:.2f}A"
    u = step(rig.time(study.step.duration), amplitude, study.step.start)
    return rig.measure(
        name, u, _rng(seed, name), kind="step", role="validation", amplitude=amplitude, hold="zoh"
    )


def _campaign_toml(title: str, rig: VirtualRig, records: Sequence[Record]) -> str:
    lines = [f'title = "Virtual rig, {title}"', "", "[rig]", 'model = "running_gear"', "", "[rig.constants]"]
    lines += [f"{name} = {value!r}" for name, value in rig.truth.constants.items()]
    for record in records:
        lines += [
            "",
            "[[records]]",
            f'file = "{record.name}.csv"',
            f'role = "{record.role}"',
            f'kind = "{record.kind}"',
        ]
        lines += [f"amplitude = {record.amplitude}", f'hold = "{record.hold}"']
    return "\n".join(lines) + "\n"


def _identify(campaign: Path, folder: Path) -> None:
    run_identify(campaign, folder, n_jobs=1)


def _calibrate(study: Study, campaign: Path, identified: Path, seed: int, folder: Path) -> None:
    """Calibrate to the yaw angle; the lateral numbers are those identified, because y inherits the errors of psi."""
    read = read_campaign(campaign)
    structure, search = calibrated_structure(study), study.calibration
    linear = read_model(identified).values
    records = [replace(r, signals={name: r[name] for name in ("u", "psi")}) for r in read.estimation]
    start = {name: linear[name] for name in ("J_z", "k_c", "k_d", "psi_off", "l_0", "c_y", "y_off")}
    found = calibrate_to_records(
        structure,
        records,
        read.constants,
        np.random.default_rng(seed),
        start=start,
        n_generations=search.n_generations,
        n_sets=search.n_sets,
        n_ends=search.n_ends,
    )
    model = Model.of(structure, {**linear, **found.fit.values}, "foh").to_json()
    (folder / MODEL_FILE).write_text(json_text(model), encoding="utf-8")


def _discover(campaign: Path, folder: Path) -> None:
    command = [
        str(Path(sys.executable).with_name("rigsight")),
        "discover",
        str(campaign),
        "--out",
        str(folder),
        "--quiet",
    ]
    run = subprocess.run(command, capture_output=True, text=True, timeout=_LONGEST_DISCOVERY, check=False)
    if run.returncode != 0:
        raise RigsightError(run.stderr.strip() or f"rigsight discover ended with exit code {run.returncode}")


def _compare(evaluation: Path, models: Sequence[str], folder: Path) -> None:
    run_compare(evaluation, models, folder, n_jobs=1, command=f"rigsight compare {evaluation} ...")

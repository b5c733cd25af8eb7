"""The work of `rigsight demo`: a campaign is simulated on the virtual rig with a hidden effect, then diagnosed."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy.signal import lfilter

from rigsight.diagnose.result import Diagnosis
from rigsight.effects import CATALOGUE, effect_named
from rigsight.excitation import log_sweep, step
from rigsight.records import Floats, Hold, Kind, Record, Role
from rigsight.rigs import RUNNING_GEAR, evaluated
from rigsight.rigs.published import PublishedSet, published_sets
from rigsight.simulate import Structure, compose, simulate
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.diagnose import diagnose_campaign, result_files
from rigsight.workflow.run.kernels import checked_jobs, prepare_kernels, structures_to_try
from rigsight.workflow.run.progress import Listener, Stage, silent
from rigsight.workflow.run.results import check_writable, write_together

VIRTUAL_RIG_SET = "iwan_tables"
DT = 5e-3
"""Sample time of the thesis's rig [s]."""
CAMPAIGN_FOLDER = "campaign"
HIDDEN_EFFECT = "iwan_hysteresis"
MEASURING = "Measuring on the virtual rig"

_GIVEN_SET = "identified"
_GIVEN_EFFECTS = {"cubic_stiffness": {"k_3": 4000.0}, "actuator_lag": {"T_a": 0.04}}
"""What the given simulation has beside the published linear parameter values: rounded, as from a data sheet."""
_SWEEP_TIME = 60.0
_SWEEP_OMEGA = (2.0 * math.pi * 0.1, 2.0 * math.pi * 10.0)
_STEP_TIME = 20.0
_STEP_START = 10.0


@dataclass(frozen=True)
class _Run:
    """One experiment on the virtual rig."""

    kind: Kind
    amplitude: float
    role: Role
    hold: Hold = "foh"

    @property
    def name(self) -> str:
        return f"{self.kind}_{self.amplitude:.2f}A"


_RUNS = (
    _Run("sweep", 0.25, "estimation"),
    _Run("sweep", 0.50, "estimation"),
    _Run("sweep", 0.75, "validation"),
    _Run("sweep", 1.00, "estimation"),
    _Run("step", 0.60, "validation", "zoh"),
)


def run_demo(
    out: str | Path,
    *,
    seed: int = 0,
    n_jobs: int | None = None,
    listener: Listener = silent,
    command: str = "rigsight demo",
) -> Diagnosis:
    """Measure a virtual running gear with a hidden hysteresis and diagnose the campaign."""
    out = Path(out)
    jobs = checked_jobs(n_jobs)
    check_writable(out)
    folder = (out / CAMPAIGN_FOLDER).absolute()
    modelled = tuple(effect_named(name) for name in _GIVEN_EFFECTS)
    tried = structures_to_try(RUNNING_GEAR, CATALOGUE, modelled)
    prepare_kernels([VirtualRig().structure, *tried], jobs, listener)
    files = _campaign(np.random.default_rng(seed), listener)
    with tempfile.TemporaryDirectory(prefix="rigsight-") as place:
        for name, text in files.items():
            Path(place, name).write_text(text, encoding="utf-8")
        # The finished fits of an interrupted demo are found by this path.
        campaign = replace(read_campaign(place), path=folder / "campaign.toml")
    # Remove results first, so that they never lie beside the campaign of another run.
    inside = {f"{CAMPAIGN_FOLDER}/{name}": text for name, text in files.items()}

    def keep(diagnosis: Diagnosis) -> None:
        write_together(out, inside | result_files(diagnosis, command, seed))

    return diagnose_campaign(campaign, CATALOGUE, seed, jobs, listener, keep)


def _campaign(rng: np.random.Generator, listener: Listener) -> dict[str, str]:
    """Return the files of the campaign; they contain neither the hidden effect nor its parameter values."""
    rig = VirtualRig()
    stage = Stage(MEASURING, len(_RUNS), listener)
    files = {"campaign.toml": _campaign_toml(published_sets()[_GIVEN_SET])}
    for run in _RUNS:
        if run.kind == "step":
            current = step(rig.time(_STEP_TIME), run.amplitude, _STEP_START)
        else:
            current = log_sweep(rig.time(_SWEEP_TIME), run.amplitude, *_SWEEP_OMEGA)
        record = rig.measure(
            run.name, current, rng, kind=run.kind, role=run.role, amplitude=run.amplitude, hold=run.hold
        )
        files[f"{run.name}.csv"] = _csv_text(record)
        stage.finished(run.name)
    return files


def _csv_text(record: Record) -> str:
    names = ("u", "psi", "y")
    rows = np.column_stack([record.t, *(record[name] for name in names)])
    lines = [",".join(("t", *names)), *(",".join(f"{value:.9g}" for value in row) for row in rows)]
    return "\n".join(lines) + "\n"


def _campaign_toml(given: PublishedSet) -> str:
    constants = "\n".join(f"{name} = {value!r}" for name, value in given.constants.items())
    numbers = {**given.parameters, **given.given}
    for alternative in RUNNING_GEAR.alternatives:
        if alternative.parameter.name in given.given:
            del numbers[alternative.gives]
    for own in _GIVEN_EFFECTS.values():
        numbers |= own
    parameters = "\n".join(f"{name} = {value!r}" for name, value in numbers.items())
    effects = ", ".join(f'"{name}"' for name in _GIVEN_EFFECTS)
    records = "\n".join(
        f'''
[[records]]
file = "{run.name}.csv"
role = "{run.role}"
kind = "{run.kind}"
amplitude = {run.amplitude}
hold = "{run.hold}"'''
        for run in _RUNS
    )
    return f'''title = "Virtual running gear"

[rig]
model = "{given.rig}"
effects = [{effects}]

[rig.constants]
{constants}

# {given.title}: {given.source};
# stiffening and lag from data sheets.
[rig.parameters]
{parameters}
{records}
'''


@dataclass(frozen=True)
class VirtualRig:
    """A running gear with known true parameters."""

    # Parameter set that is simulated.
    truth: PublishedSet = field(default_factory=lambda: published_sets()[VIRTUAL_RIG_SET])
    # Standard deviation of the white sensor noise, by output [rad], [m].
    noise: Mapping[str, float] = field(default_factory=lambda: {"psi": 2e-5, "y": 2e-5})
    disturbance: float = 1e-3  # standard deviation of the torque disturbance [N m]
    # Angular frequency below which the disturbance is white [rad/s]; above, it falls by 20 dB per decade.
    disturbance_corner: float = 5.0
    dt: float = DT  # sample time [s]

    @property
    def structure(self) -> Structure:
        """The equations that are simulated."""
        return compose(RUNNING_GEAR, [effect_named(name) for name in self.truth.effects])

    def time(self, duration: float) -> Floats:
        """Return the sample times of a record of `duration` [s], shape (n_samples,)."""
        return self.dt * np.arange(round(duration / self.dt), dtype=np.float64)

    def measure(
        self,
        name: str,
        u: Floats,
        rng: np.random.Generator,
        *,
        kind: Kind = "operation",
        role: Role = "estimation",
        amplitude: float | None = None,
        hold: Hold = "foh",
    ) -> Record:
        """Drive the rig with a current and return the measured record."""
        torque = self._torque_disturbance(u.size, rng)
        values = self.truth.values()
        per_ampere = evaluated(self.structure.rig.motion.drive_gain, values)
        driven = Record(
            name=name, dt=self.dt, signals={"u": u + torque / per_ampere}, units={"u": "A"}, role=role, kind=kind,
            amplitude=amplitude, hold=hold,
        )  # fmt: skip
        clean = simulate(self.structure, values, driven)
        seen = {output: clean[output] + rng.normal(scale=s, size=u.size) for output, s in self.noise.items()}
        return clean.with_signals(u=u, **seen)

    def _torque_disturbance(self, n_samples: int, rng: np.random.Generator) -> Floats:
        pole = float(np.exp(-self.disturbance_corner * self.dt))
        settled = int(np.ceil(5.0 / (self.disturbance_corner * self.dt)))
        white = rng.normal(scale=self.disturbance * np.sqrt(1.0 - pole**2), size=n_samples + settled)
        return np.asarray(lfilter([1.0], [1.0, -pole], white)[settled:])

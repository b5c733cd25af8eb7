"""The random rig of a trial and the experiments on it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rigsight.records import Role
from rigsight.rigs import AXIS, RUNNING_GEAR, Rig, evaluated
from rigsight_bench.trials.runs import DT, Run
from rigsight_bench.trials.waveforms import Multisine, Step, Sweep

_SWEEP_TIME = 40.0
_BAND = (0.08, 6.0)
"""Begin and end of a sweep in units of the natural frequency."""
_STEP_TIME, _STEP_START = 15.0, 5.0
_N_LINES = 50
_MULTISINE_BAND = (0.1, 4.0)
_RISE = 1.0
_WIDE = (0.7, 1.5)
"""Displacement of an axis that swings by about a radian."""
_GEAR = {"v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27}


@dataclass(frozen=True)
class LinearRig:
    """A rig without effects.

    Attributes
    ----------
    rig
        The rig.
    values
        Constants and parameters by name.
    omega
        Lowest natural frequency [rad/s]; 0 where nothing vibrates.
    """

    rig: Rig
    values: dict[str, float]
    omega: float

    @property
    def drive_gain(self) -> float:
        """Force per unit of the input."""
        return evaluated(self.rig.motion.drive_gain, self.values)


def draw_rig(rng: np.random.Generator, rig: Rig | None, swings_wide: bool) -> LinearRig:
    """Draw linear parameters.

    Parameters
    ----------
    rng
        Source of randomness.
    rig
        The rig that is needed; None to draw that as well.
    swings_wide
        True for an axis whose displacement must reach a radian.
    """
    drawn = RUNNING_GEAR if rng.random() < 0.6 else AXIS
    rig = rig or (AXIS if swings_wide else drawn)
    if rig is RUNNING_GEAR:
        inertia = 0.56 * math.exp(rng.uniform(-0.4, 0.4))
        omega = rng.uniform(8.0, 18.0)
        values = {
            **_GEAR,
            "J_z": inertia,
            "k_c": inertia * omega**2,
            "k_d": 2.0 * rng.uniform(0.08, 0.4) * inertia * omega,
            "psi_off": rng.normal(scale=5e-4),
            "l_0": 0.25 * math.exp(rng.uniform(-0.15, 0.15)),
            "c_y": rng.uniform(0.88, 0.99),
            "y_off": rng.normal(scale=2e-4),
        }
        return LinearRig(rig, values, omega)
    mass = math.exp(rng.uniform(-2.0, 2.0))
    omega = rng.uniform(7.0, 20.0)
    small, wide = math.exp(rng.uniform(math.log(0.003), math.log(0.7))), rng.uniform(*_WIDE)
    # Half of all axes swing wide whatever the effect, so that a wide swing does not reveal a pendulum.
    size = wide if rng.random() < 0.5 or swings_wide else small
    damping = rng.uniform(0.05, 0.35)
    # At resonance the displacement is that of a slow input over twice the damping ratio.
    gain = mass * omega**2 * size * 2.0 * damping
    values = {
        "gain": gain,
        "m": mass,
        "d": 2.0 * damping * mass * omega,
        "k": mass * omega**2,
        "x_off": rng.normal(scale=0.02 * size),
        "force_off": 0.0,
    }
    return LinearRig(rig, values, omega)


def draw_experiments(linear: LinearRig, rng: np.random.Generator) -> tuple[Run, ...]:
    """Draw the experiments of a campaign, and behind them two that stay withheld from every diagnosis."""
    start, stop = (share * linear.omega * math.exp(rng.uniform(-0.1, 0.1)) for share in _BAND)

    def sweep(name: str, role: Role, amplitude: float) -> Run:
        wave = Sweep(amplitude, start, stop, _SWEEP_TIME)
        n = round(_SWEEP_TIME / DT)
        return Run(name, role, "sweep", "band_limited", {"u": wave}, n, amplitude=amplitude)

    def multisine(name: str, role: Role | None, effective: float) -> Run:
        wave = _multisine(linear.omega, effective, rng)
        drawn = Run(name, role, "multisine", "band_limited", {"u": wave}, round(_SWEEP_TIME / DT))
        peak = float(np.max(np.abs(drawn.inputs()["u"])))
        return replace(drawn, amplitude=round(peak, 3))

    def step(name: str, role: Role | None, amplitude: float) -> Run:
        wave = Step(amplitude, _STEP_START)
        return Run(name, role, "step", "zoh", {"u": wave}, round(_STEP_TIME / DT), amplitude=amplitude)

    return (
        sweep("record_1", "estimation", 0.25),
        sweep("record_2", "estimation", 0.5),
        sweep("record_3", "estimation", 1.0),
        step("record_4", "estimation", 0.6),
        sweep("record_5", "validation", 0.75),
        multisine("record_6", "validation", 0.3),
        multisine("withheld_1", None, 0.22),
        step("withheld_2", None, 0.85),
    )


def _multisine(omega: float, effective: float, rng: np.random.Generator) -> Multisine:
    """Return a multisine of this root mean square whose lines are spread evenly over the logarithm of the frequency."""
    fundamental = 2.0 * math.pi / _SWEEP_TIME
    lowest, highest = (share * omega / fundamental for share in _MULTISINE_BAND)
    lines = np.unique(np.round(np.geomspace(max(lowest, 1.0), highest, _N_LINES)))
    amplitudes = np.full(lines.size, effective * math.sqrt(2.0 / lines.size))
    return Multisine(amplitudes, fundamental * lines, rng.uniform(0.0, 2.0 * np.pi, lines.size), _RISE)

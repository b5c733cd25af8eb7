"""The sweeps and steps of the thesis on the virtual rig, with more disturbance than in the demo.

The virtual rig is the library's: the one model that gives the thesis's tables (see fit_tables.py). The records of the rig itself
are not public.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from fit_tables import GROWTH
from numpy.typing import NDArray

from rigsight.effects import effect_named
from rigsight.excitation import linear_sweep, log_sweep, step
from rigsight.records import Kind, Record
from rigsight.rigs import RUNNING_GEAR, evaluated
from rigsight.rigs.published import published_sets
from rigsight.simulate import Structure, compose, simulate
from rigsight.workflow.demo import VirtualRig

AMPLITUDES = (0.25, 0.5, 0.75, 1.0, 1.25, 1.5)
"""Amplitudes of Figure 5.6 [A]; Table 5.2 has the first four."""
SWEEP_START = 1e-3
"""Angular frequency at the begin of the sweep of section 4.2 [rad/s]."""
SWEEP_TIME = 149.5
"""The thesis sweeps to 640 rad/s, above the Nyquist frequency of 628 rad/s; here the sweep ends half a second earlier."""
STEP_START, STEP_TIME, STEP_AMPLITUDE = 180.0, 200.0, 0.6
SEED = 1

CONSTANTS = dict(VirtualRig().truth.constants)
DRIVE = evaluated(RUNNING_GEAR.motion.drive_gain, CONSTANTS)
"""Torque per current [N m/A]."""
DISTURBANCE = 0.01
"""Standard deviation of the torque disturbance, as a current that is not recorded [A]: 0.008 N m."""
RIG = VirtualRig(disturbance=DRIVE * DISTURBANCE)
VIRTUAL_RIG, STRUCTURE, NOISE, DT = RIG.truth, RIG.structure, RIG.noise, RIG.dt


def times(duration: float) -> NDArray[np.float64]:
    return RIG.time(duration)


def excitation(name: str, u: NDArray[np.float64], kind: Kind, amplitude: float) -> Record:
    """Return a record that holds the current only."""
    hold = "zoh" if kind == "step" else "foh"
    return Record(
        name, DT, {"u": u}, {"u": "A", "psi": "rad", "y": "m"}, kind=kind, amplitude=amplitude, hold=hold
    )


def thesis_sweep(amplitude: float) -> Record:
    """Return the current of the sweep that the thesis identifies from (section 4.2)."""
    t = times(SWEEP_TIME)
    u = log_sweep(t, amplitude, SWEEP_START, SWEEP_START * float(np.exp(GROWTH * t[-1])))
    return excitation(f"sweep {amplitude:.2f} A", u, "sweep", amplitude)


def other_sweep(amplitude: float, omega_start: float, omega_stop: float) -> Record:
    """Return the current of a linear sweep (2.4), as those of Figure 5.1."""
    u = linear_sweep(times(SWEEP_TIME), amplitude, omega_start, omega_stop)
    return excitation(f"linear sweep from {omega_start:g} rad/s", u, "sweep", amplitude)


def slow_sweep(amplitude: float, omega_start: float, omega_stop: float, growth: float) -> Record:
    """Return the current of a logarithmic sweep with another rate [e-folds per second]."""
    t = times(float(np.log(omega_stop / omega_start)) / growth)
    return excitation(
        f"sweep {amplitude:.2f} A", log_sweep(t, amplitude, omega_start, omega_stop), "sweep", amplitude
    )


def thesis_step(amplitude: float = STEP_AMPLITUDE) -> Record:
    """Return the current of the step of section 5.2.2."""
    return excitation(
        f"step {amplitude:.2f} A", step(times(STEP_TIME), amplitude, STEP_START), "step", amplitude
    )


def measured(commanded: Record, seed: int = SEED) -> Record:
    """Return what the virtual rig answers, with sensor noise and torque disturbance.

    The seed and the record's name make the noise, so that a record is the same in whichever table it occurs.
    """
    rng = np.random.default_rng([seed, *commanded.name.encode()])
    return RIG.measure(
        commanded.name,
        commanded["u"],
        rng,
        kind=commanded.kind,
        amplitude=commanded.amplitude,
        hold=commanded.hold,
    )


def simulated(structure: Structure, values: Mapping[str, float], commanded: Record) -> Record:
    """Return what a model answers to the current of a record."""
    bare = replace(commanded, signals={"u": commanded["u"]})
    return simulate(structure, values, bare)


def published_model(name: str) -> tuple[Structure, dict[str, float]]:
    """Return structure and values of a published set."""
    published = published_sets()[name]
    return compose(RUNNING_GEAR, [effect_named(effect) for effect in published.effects]), published.values()

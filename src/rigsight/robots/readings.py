"""Sensor readings of a MuJoCo model for given controls, to compare with records or to replace them in examples."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError

if TYPE_CHECKING:
    import mujoco

_WHOLE = 1e-6
"""How far a sample time may be from a whole number of steps, in steps."""


def sensor_readings(model: mujoco.MjModel, controls: NDArray[np.float64], dt: float) -> NDArray[np.float64]:
    """Run a model by its own integrator from where it is drawn, at rest."""
    import mujoco

    controls = np.asarray(controls, dtype=np.float64)
    if controls.ndim != 2 or controls.shape[1] != model.nu:
        raise InputError(f"Controls have shape (n_samples, {model.nu}) for this model, got {controls.shape}.")
    steps = dt / float(model.opt.timestep)
    if round(steps) < 1 or abs(steps - round(steps)) > _WHOLE:
        raise InputError(
            f"dt must be a multiple of the model's step of {model.opt.timestep:g} s, got {dt:g} s."
        )
    data = mujoco.MjData(model)
    readings = np.empty((len(controls), model.nsensordata))
    for reported, reading in zip(controls, readings, strict=True):
        data.ctrl[:] = reported
        mujoco.mj_forward(model, data)
        reading[:] = data.sensordata
        mujoco.mj_step(model, data, round(steps))
    return readings

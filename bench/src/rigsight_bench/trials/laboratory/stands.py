"""Test stands of the laboratory: parameters and wiring.

The campaign of a stand names a built-in rig. The plant behind the records is the same rig with additions that the campaign does
not mention: a control law, an external force, and parts that soften as they warm up.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from rigsight.errors import SimulationError
from rigsight.rigs import RIGS, Rig
from rigsight.rigs.built_in import declared_rig
from rigsight.simulate import compose
from rigsight.simulate.linearization import linearize
from rigsight_bench.trials.any_rig_numbers import draw_numbers

PUSH, GOAL, TOLD, WARMTH = "push", "goal", "told", "warmth"
"""Inputs of a wired rig, and the sensor that shows what its control law tells the drive."""
_JOINT_MASS_SPREAD = 0.6
"""As that of the numbers of all drawn rigs."""
_JOINT_RATES = (0.3, 5.0)
"""Damping over mass of a joint without a spring [1/s]: a good bearing coasts for seconds, a stiff gear for a fifth of one."""
_JOINT_LOOP = (8.0, 25.0)
"""Bandwidth of its position loop [rad/s]: 1 to 4 Hz, as servo joints have."""
_STIFFENED = (0.5, 3.0)
"""Stiffness of the loop of a stand that has a spring, in units of that spring: less, and the loop would not matter."""
_LOOP_DAMPING = 0.7
"""Damping ratio that a controller is set to: it hardly overshoots."""
_SMOOTHED = 10.0
"""Corner of the filter of the measured rate, in units of the bandwidth: a decade above, so that it takes 6 degrees of phase."""


@dataclass(frozen=True)
class Stand:
    """A test stand.

    Attributes
    ----------
    name
        What it is called here.
    model
        The built-in rig that it is.
    held
        Parameters that its records do not tell beside the others.
    looped
        True for a stand that is never operated in open loop.
    """

    name: str
    model: str
    held: tuple[str, ...] = ()
    looped: bool = False

    @property
    def rig(self) -> Rig:
        """The rig that the campaign names."""
        return RIGS[self.model]

    def draw_numbers(self, rng: np.random.Generator) -> dict[str, float]:
        """Return constants and parameters, offsets zero; the joint without a spring has none.

        Parameters
        ----------
        rng
            Source of randomness.

        Raises
        ------
        SimulationError
            If no draw has plausible poles.
        """
        if not self.looped:
            return draw_numbers(self.rig, rng)
        mass = math.exp(rng.normal(scale=_JOINT_MASS_SPREAD))
        damping = mass * math.exp(rng.uniform(*np.log(_JOINT_RATES)))
        return {"gain": 1.0, "m": mass, "d": damping, "k": 0.0, "x_off": 0.0, "force_off": 0.0}


STANDS: dict[str, Stand] = {
    stand.name: stand
    for stand in (
        # Beside a spring a constant force is a shifted rest position.
        Stand("stage", "axis", held=("force_off",)),
        Stand("joint", "axis", held=("k", "x_off"), looped=True),
        Stand("drive_train", "drive_train"),
        Stand("arm", "two_link_arm"),
        Stand("running_gear", "running_gear"),
        Stand("element", "element"),
    )
}


@dataclass(frozen=True)
class Law:
    """``u = p (goal - reading) - d rate``, the rate of the first reading behind a filter.

    Attributes
    ----------
    p, d
        Gains [input per reading, input per rate of it].
    corner
        Of the filter [rad/s].
    bandwidth
        Of the loop [rad/s].
    """

    p: float
    d: float
    corner: float
    bandwidth: float


@dataclass(frozen=True)
class Softening:
    """Relative losses of damping and stiffness of the last joint when it is warm."""

    damping: float
    stiffness: float


def draw_law(stand: Stand, values: Mapping[str, float], rng: np.random.Generator) -> Law:
    """Draw the control law of a stand with one input.

    Parameters
    ----------
    stand
        The test stand.
    values
        Its numbers.
    rng
        Source of randomness.

    Raises
    ------
    SimulationError
        If the loop is not stable.
    """
    if stand.looped:
        bandwidth = math.exp(rng.uniform(*np.log(_JOINT_LOOP)))
        p = values["m"] * bandwidth**2 / values["gain"]
        d = max(2.0 * _LOOP_DAMPING * values["m"] * bandwidth - values["d"], 0.0) / values["gain"]
    else:
        found = linearize(compose(stand.rig), values)
        gain = float(np.real(found.frequency_response(np.zeros(1))[0, 0, 0]))
        is_oscillating = np.abs(found.poles.imag) > 0.0
        # A stand may be damped so strongly that none of its motions oscillates.
        lowest = float(np.min(np.abs(found.poles[is_oscillating] if np.any(is_oscillating) else found.poles)))
        stiffened = math.exp(rng.uniform(*np.log(_STIFFENED)))
        bandwidth = lowest * math.sqrt(1.0 + stiffened)
        p = stiffened / gain
        d = 2.0 * _LOOP_DAMPING * math.sqrt(1.0 + stiffened) / (lowest * gain)
    law = Law(p, d, _SMOOTHED * bandwidth, bandwidth)
    wired = wired_rig(stand.rig, law, None)
    if linearize(compose(wired), {**values, **wired_numbers(law, None)}).stability == "unstable":
        raise SimulationError(f"The position loop of {stand.name} is not stable.")
    return law


def wired_numbers(law: Law | None, softening: Softening | None) -> dict[str, float]:
    """Return the constants that a wired rig has beside those of the rig."""
    found: dict[str, float] = {}
    if law is not None:
        found |= {"law_p": law.p, "law_d": law.d, "law_corner": law.corner}
    if softening is not None:
        found |= {"lost_damping": softening.damping, "lost_stiffness": softening.stiffness}
    return found


def wired_rig(rig: Rig, law: Law | None, softening: Softening | None) -> Rig:
    """Return a rig on whose last joint a force pushes from outside, with a control law or parts that warm up if asked for.

    Parameters
    ----------
    rig
        The rig; for a law with one input and one drive.
    law
        Its control law; None where it runs open loop.
    softening
        What warming up does to its last joint; None where nothing drifts.
    """
    tables: dict[str, Any] = copy.deepcopy(dict(rig.declaration))
    tables.pop("alternatives", None)
    tables["name"] = f"{rig.name}_on_its_stand"
    joint = rig.mechanism.joints[-1]
    table = tables["joints"][joint.name]
    force = f"({table.get('force', '0')}) - pushed" if "force" in table else "-pushed"
    units = rig.units_at(joint.name)
    tables["inputs"][PUSH] = {"unit": units["force"]}
    tables["signals"] = {**tables.get("signals", {}), "pushed": PUSH}
    if law is not None:
        _close(tables, rig)
    if softening is not None:
        _warm_up(tables)
        rest = f"({table['motion']} - ({table.get('rest', '0')}))" if "rest" in table else table["motion"]
        if "damping" in table:
            force += f" - warm*lost_damping*({table['damping']})*{_rate(joint.motion)}"
        if "stiffness" in table:
            force += f" - warm*lost_stiffness*({table['stiffness']})*{rest}"
        else:
            del tables["constants"]["lost_stiffness"]
    table["force"] = force
    found = declared_rig(tables["name"], tables)
    assert found is not None
    return found


def _rate(motion: sp.Expr) -> str:
    """Return the rate of a joint that moves along one coordinate, as an expression of a rig file."""
    return f"d({motion})"


def _close(tables: dict[str, Any], rig: Rig) -> None:
    (name,), sensor = tables["inputs"].keys() - {PUSH}, rig.outputs[0]
    unit = tables["inputs"].pop(name)["unit"]
    per_reading = f"({unit})/({sensor.unit})"
    tables["inputs"][GOAL] = {"unit": sensor.unit}
    tables.setdefault("constants", {})
    tables["constants"] |= {
        "law_p": {"unit": per_reading},
        "law_d": {"unit": f"{per_reading}*s"},
        "law_corner": {"unit": "1/s"},
    }
    seen = sensor.name
    tables["states"] = {
        **tables.get("states", {}),
        "seen": {"rate": f"({seen} - seen)*law_corner", "unit": sensor.unit},
    }
    tables["signals"]["command"] = f"law_p*(goal - {seen}) - law_d*law_corner*({seen} - seen)"
    (drive,) = tables["drives"].values()
    drive["signal"] = "command"
    tables["sensors"][TOLD] = {"reads": "command", "unit": unit}


def _warm_up(tables: dict[str, Any]) -> None:
    tables["inputs"][WARMTH] = {"unit": "1"}
    tables["signals"]["warm"] = WARMTH
    tables.setdefault("constants", {})
    tables["constants"] |= {"lost_damping": {"unit": "1"}, "lost_stiffness": {"unit": "1"}}

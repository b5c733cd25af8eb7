"""Equations of motion of four rigs as derived in textbooks (Newton-Euler).

The state of a plant contains the positions, then their rates, then first-order states. Every function takes the forces of the
drives and the force with which a law resists the motion of one joint.

References
----------
J. P. Den Hartog, *Mechanical Vibrations* (McGraw-Hill 1956), chapters 2 and 3: one mass, two masses.
M. Spong, S. Hutchinson and M. Vidyasagar, *Robot Modeling and Control* (Wiley 2006), chapter 7: the planar elbow manipulator;
its angles count from the horizontal, here from hanging, so that gravity has sines.
J. Klingel, Organ fuer die Fortschritte des Eisenbahnwesens 38 (1883) 113: a rolling axle drifts sideways with its yaw angle.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Joint:
    """Where a law acts.

    Attributes
    ----------
    name
        As the rig's file calls it.
    pulls
        Share of each coordinate's motion in the joint's, +1 or -1 or 0.
    stiffness
        Of its linear spring [N/m, N m/rad].
    damping
        Of its damper [N s/m, N m s/rad].
    rest
        Where the spring rests [m, rad].
    """

    name: str
    pulls: tuple[int, ...]
    stiffness: float
    damping: float
    rest: float = 0.0


class Motion:
    """What the equations of all rigs have in common.

    Attributes
    ----------
    n
        Number of coordinates.
    start
        State from which the rest is looked for.
    joints
        Joints by name.
    drives
        Coordinate along which each drive acts, by the drive's name.
    gains
        Force of each drive per unit of its input.
    sensors
        Number of the state that each sensor reads, by its name.
    """

    n: int
    start: tuple[float, ...]
    joints: Mapping[str, Joint]
    drives: Mapping[str, int]
    gains: tuple[float, ...]
    sensors: Mapping[str, int]

    def rates(self, y: Sequence[float], drives: Sequence[float], resist: Sequence[float]) -> list[float]:
        """Return the rates of the states.

        Parameters
        ----------
        y
            States.
        drives
            Output of each drive, in the unit of its input.
        resist
            Force of the law against each coordinate [N, N m].
        """
        raise NotImplementedError


class OneMass(Motion):
    """m x'' + d x' + k (x - x_off) = gain u + force_off.

    Parameters
    ----------
    p
        Numbers by name [SI].
    """

    def __init__(self, p: Mapping[str, float]) -> None:
        self.n = 1
        self.start = (p["x_off"] + (p["force_off"] / p["k"] if p["k"] else 0.0), 0.0)
        self.joints = {"dynamics": Joint("dynamics", (1,), p["k"], p["d"], p["x_off"])}
        self.drives = {"actuator": 0}
        self.sensors = {"x": 0}
        self.gains = (p["gain"],)
        self._gain, self._m, self._d, self._k = p["gain"], p["m"], p["d"], p["k"]
        self._x_off, self._force_off = p["x_off"], p["force_off"]

    def rates(self, y: Sequence[float], drives: Sequence[float], resist: Sequence[float]) -> list[float]:
        """Return velocity and acceleration."""
        x, v = y[0], y[1]
        force = self._gain * drives[0] + self._force_off - self._d * v - self._k * (x - self._x_off)
        return [v, (force - resist[0]) / self._m]


class TwoMasses(Motion):
    """A motor and a load on a flexible shaft (Den Hartog, both with a bearing's friction).

    Parameters
    ----------
    p
        Numbers by name [SI].
    """

    def __init__(self, p: Mapping[str, float]) -> None:
        self.n = 2
        self.start = (0.0, 0.0, 0.0, 0.0)
        self.joints = {
            "shaft": Joint("shaft", (1, -1), p["k_s"], p["d_s"]),
            "motor_bearing": Joint("motor_bearing", (1, 0), 0.0, p["d_m"]),
            "load_bearing": Joint("load_bearing", (0, 1), p["k_l"], p["d_l"]),
        }
        self.drives = {"motor": 0}
        self.sensors = {"motor_angle": 0, "load_angle": 1}
        self.gains = (p["k_t"],)
        self._k_t, self._J_m, self._J_l = p["k_t"], p["J_m"], p["J_l"]
        self._k_s, self._d_s, self._d_m, self._d_l, self._k_l = (
            p[name] for name in ("k_s", "d_s", "d_m", "d_l", "k_l")
        )

    def rates(self, y: Sequence[float], drives: Sequence[float], resist: Sequence[float]) -> list[float]:
        """Return both velocities and accelerations."""
        motor, load, w_m, w_l = y[0], y[1], y[2], y[3]
        shaft = self._k_s * (motor - load) + self._d_s * (w_m - w_l)
        on_motor = self._k_t * drives[0] - shaft - self._d_m * w_m - resist[0]
        on_load = shaft - self._d_l * w_l - self._k_l * load - resist[1]
        return [w_m, w_l, on_motor / self._J_m, on_load / self._J_l]


class PlanarArm(Motion):
    """Two links in the vertical plane (Spong et al., with the angle of link 2 from link 1).

    Their numbers: I_1 + I_2 + m_2 l_1^2 = alpha, s_2 l_1 = beta, I_2 = delta; inertias about the joints.

    Parameters
    ----------
    p
        Numbers by name [SI].
    """

    def __init__(self, p: Mapping[str, float]) -> None:
        self.n = 2
        self.start = (0.0, 0.0, 0.0, 0.0)
        self.joints = {
            "shoulder": Joint("shoulder", (1, 0), 0.0, p["d_1"]),
            "elbow": Joint("elbow", (0, 1), 0.0, p["d_2"]),
        }
        self.drives = {"shoulder_motor": 0, "elbow_motor": 1}
        self.sensors = {"angle_1": 0, "angle_2": 1}
        self.gains = (1.0, 1.0)
        self._alpha = p["I_1"] + p["I_2"] + p["m_2"] * p["l_1"] ** 2
        self._beta = p["s_2"] * p["l_1"]
        self._delta = p["I_2"]
        self._upper = p["g"] * (p["s_1"] + p["m_2"] * p["l_1"])
        self._lower = p["g"] * p["s_2"]
        self._d_1, self._d_2 = p["d_1"], p["d_2"]

    def rates(self, y: Sequence[float], drives: Sequence[float], resist: Sequence[float]) -> list[float]:
        """Return both velocities and accelerations."""
        q_1, q_2, w_1, w_2 = y[0], y[1], y[2], y[3]
        coupling = self._beta * math.cos(q_2)
        m_11, m_12, m_22 = self._alpha + 2.0 * coupling, self._delta + coupling, self._delta
        h = -self._beta * math.sin(q_2)
        lower = self._lower * math.sin(q_1 + q_2)
        on_1 = drives[0] - resist[0] - self._d_1 * w_1 - self._upper * math.sin(q_1) - lower
        on_1 -= h * w_2 * w_1 + h * (w_1 + w_2) * w_2
        on_2 = drives[1] - resist[1] - self._d_2 * w_2 - lower + h * w_1 * w_1
        determinant = m_11 * m_22 - m_12 * m_12
        return [
            w_1,
            w_2,
            (m_22 * on_1 - m_12 * on_2) / determinant,
            (m_11 * on_2 - m_12 * on_1) / determinant,
        ]


class RollingAxle(Motion):
    """An axle that a motor yaws against a spring and that rolls sideways as it yaws (Klingel 1883).

    J_z psi'' + k_d psi' + k_c (psi - psi_off) = b k_tau / r_0 u,  y' = v c_y (psi - (y - y_off) / (2 l_0)).

    Parameters
    ----------
    p
        Numbers by name [SI].
    creep
        Effective creepage over the creepage, for a contact that saturates.
    """

    def __init__(self, p: Mapping[str, float], creep: Callable[[float], float] | None = None) -> None:
        self.n = 1
        self.start = (p["psi_off"], 0.0, p["y_off"] + 2.0 * p["l_0"] * p["psi_off"])
        self.joints = {"yaw_dynamics": Joint("yaw_dynamics", (1,), p["k_c"], p["k_d"], p["psi_off"])}
        self.drives = {"actuator": 0}
        self.sensors = {"psi": 0, "y": 2}
        self._gain = p["b"] * p["k_tau"] / p["r_0"]
        self.gains = (self._gain,)
        self._J_z, self._k_d, self._k_c, self._psi_off = (p[n] for n in ("J_z", "k_d", "k_c", "psi_off"))
        self._rolled, self._y_off, self._l_0 = p["v"] * p["c_y"], p["y_off"], p["l_0"]
        self._creep = creep or (lambda creepage: creepage)

    def rates(self, y: Sequence[float], drives: Sequence[float], resist: Sequence[float]) -> list[float]:
        """Return yaw rate, yaw acceleration and lateral velocity."""
        psi, w, lateral = y[0], y[1], y[2]
        torque = self._gain * drives[0] - self._k_d * w - self._k_c * (psi - self._psi_off) - resist[0]
        creepage = psi - (lateral - self._y_off) / (2.0 * self._l_0)
        return [w, torque / self._J_z, self._rolled * self._creep(creepage)]


def saturating_creep(saturation: float) -> Callable[[float], float]:
    """Return the creep of a contact that slides at last, in the form of a hyperbolic tangent.

    J. J. Kalker, *Three-Dimensional Elastic Bodies in Rolling Contact* (Kluwer 1990), on its limits: in
    proportion for small creepage, bounded for large.

    Parameters
    ----------
    saturation
        The bound.
    """
    return lambda creepage: saturation * math.tanh(creepage / saturation)

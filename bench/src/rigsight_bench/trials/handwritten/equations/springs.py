"""Springs and dampers without memory from textbooks.

Each is written as the force added to a linear spring ``k x`` of the joint; if the law replaces that spring, the spring force is
subtracted.

References
----------
I. Kovacic and M. J. Brennan, *The Duffing Equation* (Wiley 2011), chapter 2.
K. Worden and G. R. Tomlinson, *Nonlinearity in Structural Dynamics* (IoP 2001), section 2.2.
S. W. Shaw and P. J. Holmes, "A periodically forced piecewise linear oscillator", J. Sound Vib. 90 (1983) 129.
K. L. Johnson, *Contact Mechanics* (Cambridge 1985), chapter 4.
J. P. Den Hartog, *Mechanical Vibrations* (McGraw-Hill 1956), on the vibration absorber.
D. J. Ewins, *Modal Testing* (Research Studies Press 2000), on mass cancellation.
T. M. Jahns and W. L. Soong, "Pulsating torque minimization techniques", IEEE Trans. Ind. Electron. 43 (1996) 321.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import ClassVar

from rigsight_bench.trials.handwritten.equations.laws import JointLaw


class Static(JointLaw):
    """A force that is a function of displacement and rate.

    Parameters
    ----------
    force
        The function [N, N m].
    """

    def __init__(self, force: Callable[[float, float], float]) -> None:
        self._force = force

    def resist(self, x: float, v: float, z: Sequence[float]) -> float:  # noqa: ARG002
        """Return the force."""
        return self._force(x, v)


def cubic(stiffness: float) -> Static:
    """Return Duffing's cubic part [N/m^3] (Kovacic and Brennan)."""
    return Static(lambda x, _: stiffness * x * x * x)


def quadratic(stiffness: float) -> Static:
    """Return a spring's even part [N/m^2] (Worden and Tomlinson)."""
    return Static(lambda x, _: stiffness * x * x)


def power_law(stiffness: float, power: float, reference: float) -> Static:
    """Return a force proportional to a power of the deflection, such as 3/2 for a Hertzian contact (Johnson)."""

    def force(x: float, _: float) -> float:
        return math.copysign(stiffness * reference * (abs(x) / reference) ** power, x)

    return Static(force)


def stops(stiffness: float, clearance: float) -> Static:
    """Return two springs that the joint meets behind a clearance (Shaw and Holmes, both sides)."""

    def force(x: float, _: float) -> float:
        if x > clearance:
            return stiffness * (x - clearance)
        if x < -clearance:
            return stiffness * (x + clearance)
        return 0.0

    return Static(force)


def loose_spring(stiffness: float, half_width: float) -> Static:
    """Return what play without memory makes of the joint's spring (Worden and Tomlinson)."""

    def force(x: float, _: float) -> float:
        if abs(x) <= half_width:
            return -stiffness * x
        return -math.copysign(stiffness * half_width, x)

    return Static(force)


def drag(coefficient: float) -> Static:
    """Return the drag of a fluid, with the square of the speed [N s^2/m^2] (Worden and Tomlinson)."""
    return Static(lambda _, v: coefficient * v * v if v > 0.0 else -coefficient * v * v)


def squeeze(coefficient: float) -> Static:
    """Return damping proportional to the square of the displacement [N s/m^3] (van der Pol's term with the opposite sign)."""
    return Static(lambda x, v: coefficient * x * x * v)


def ripple(sine: float, cosine: float, wave_number: float, rest: float) -> Static:
    """Return a force that is periodic in position: one harmonic of cogging (Jahns and Soong).

    Parameters
    ----------
    sine, cosine
        Parts [N, N m].
    wave_number
        Of the position [1/m, 1/rad].
    rest
        Position at which the joint's displacement is zero [m, rad].
    """
    size, phase = math.hypot(sine, cosine), math.atan2(cosine, sine)
    return Static(lambda x, _: size * math.sin(wave_number * (x + rest) + phase))


def exponential(stiffness: float, reach: float) -> Static:
    """Return a spring that stiffens exponentially one way and softens the other, without its linear part.

    As of tendons and textile belts: Y. C. Fung, *Biomechanics* (Springer 1993).
    """
    return Static(lambda x, _: stiffness * (reach * math.expm1(min(x / reach, 50.0)) - x))


def power_damping(coefficient: float, power: float, reference: float) -> Static:
    """Return the damping of an orifice between laminar and turbulent flow: ``c v (|v| / v_r)^(power - 1)``.

    H. E. Merritt, *Hydraulic Control Systems* (Wiley 1967), chapter 3, on orifices.
    """

    def force(_: float, v: float) -> float:
        return coefficient * v * math.pow(abs(v) / reference, power - 1.0)

    return Static(force)


def breathing_crack(stiffness: float) -> Static:
    """Return the stiffness that a crack takes away while it is open, x > 0: a bilinear spring.

    M. I. Friswell and J. E. T. Penny, Struct. Health Monit. 1 (2002) 139.
    """
    return Static(lambda x, _: -stiffness * x if x > 0.0 else 0.0)


class Maxwell(JointLaw):
    """A spring in series with a damper, beside the joint's spring (the standard linear solid).

    The state is the force of the branch: ``F' = k x' - F / tau`` (J. D. Ferry, *Viscoelastic Properties of Polymers*, Wiley
    1980).

    Parameters
    ----------
    stiffness
        Of its spring [N/m, N m/rad].
    relaxation
        Time [s].
    """

    n_states: ClassVar[int] = 1

    def __init__(self, stiffness: float, relaxation: float) -> None:
        self._stiffness, self._relaxation = stiffness, relaxation

    def resist(self, x: float, v: float, z: Sequence[float]) -> float:  # noqa: ARG002
        """Return the force of the branch."""
        return z[0]

    def rates(self, x: float, v: float, z: Sequence[float]) -> list[float]:  # noqa: ARG002
        """Return its rate."""
        return [self._stiffness * v - z[0] / self._relaxation]


class Absorber(JointLaw):
    """A further mass on a spring and a damper (Den Hartog).

    Parameters
    ----------
    mass
        Of the further mass [kg, kg m^2].
    omega
        Its angular frequency with the joint held [rad/s].
    damping_ratio
        Its damping ratio there.
    """

    n_states: ClassVar[int] = 2

    def __init__(self, mass: float, omega: float, damping_ratio: float) -> None:
        self._mass = mass
        self._stiffness = mass * omega**2
        self._damping = 2.0 * damping_ratio * mass * omega

    def resist(self, x: float, v: float, z: Sequence[float]) -> float:
        """Return what spring and damper pull."""
        return self._stiffness * (x - z[0]) + self._damping * (v - z[1])

    def rates(self, x: float, v: float, z: Sequence[float]) -> list[float]:
        """Return the motion of the further mass."""
        return [z[1], self.resist(x, v, z) / self._mass if self._mass else 0.0]


class CarriedMass(JointLaw):
    """A mass that moves with a prescribed motion (Ewins).

    Parameters
    ----------
    mass
        [kg].
    """

    def __init__(self, mass: float) -> None:
        self.mass = mass

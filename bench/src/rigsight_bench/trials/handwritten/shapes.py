"""Parameters of hidden effects, drawn from realistic ranges in units of the motion; start values of the search are not used.

The strength of an effect is found afterwards; drawn here are the parameters of its form, uniformly in the logarithm if a range
spans more than a factor of three.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Sizes:
    """How far and how fast a rig moves without an effect, at the place where the effect is to act.

    Attributes
    ----------
    x, v
        Displacement and rate of the joint.
    force
        Of the drive, of an element its own.
    stiffness
        Of the joint's spring; force per displacement where it has none.
    input
        Of the drive's input.
    """

    x: float
    v: float
    force: float
    stiffness: float
    input: float

    @property
    def time(self) -> float:
        """Displacement over rate [s]: the reciprocal of the motion's angular frequency."""
        return self.x / self.v


@dataclass(frozen=True)
class Shape:
    """Parameters of an effect over its strength, by the catalogue's names.

    Attributes
    ----------
    fixed
        Numbers that give the form.
    growing
        Parameters that are zero without the effect, at strength 1.
    thresholds
        Parameters that are infinite without the effect, at strength 1.
    elastic
        Shares that are 1 without the effect, at strength 1.
    """

    fixed: Mapping[str, float] = field(default_factory=dict)
    growing: Mapping[str, float] = field(default_factory=dict)
    thresholds: Mapping[str, float] = field(default_factory=dict)
    elastic: Mapping[str, float] = field(default_factory=dict)

    def at(self, strength: float) -> dict[str, float]:
        """Return the parameters at a strength above zero."""
        return {
            **self.fixed,
            **{name: strength * value for name, value in self.growing.items()},
            **{name: value / strength for name, value in self.thresholds.items()},
            **{name: max(1.0 - strength * (1.0 - value), 0.02) for name, value in self.elastic.items()},
        }


Draw = Callable[[Sizes, np.random.Generator], Shape]

_FRICTION = 0.15
"""Dry friction at strength 1, in units of the drive's force: the smallest record still moves."""


def draw_shape(effect: str, sizes: Sizes, rng: np.random.Generator) -> Shape:
    """Draw the form of an effect.

    Parameters
    ----------
    effect
        Its name.
    sizes
        Of the motion where it acts.
    rng
        Source of randomness.
    """
    return SHAPES[effect](sizes, rng)


def _any(rng: np.random.Generator, low: float, high: float) -> float:
    return math.exp(rng.uniform(math.log(low), math.log(high)))


def _either(rng: np.random.Generator) -> float:
    return 1.0 if rng.random() < 0.5 else -1.0


def _coulomb(s: Sizes, _: np.random.Generator) -> Shape:
    return Shape(growing={"T_c": _FRICTION * s.force})


def _stribeck(s: Sizes, rng: np.random.Generator) -> Shape:
    # Greased bearings break away 10 to 80 % above kinetic friction; their Stribeck velocity is a small part of the machine's
    # speed (Armstrong-Helouvry et al. 1994): with a larger one it would be negative viscous friction.
    kinetic, static = 1.0, rng.uniform(1.1, 1.8)
    level = _FRICTION * s.force / static
    return Shape({"w_s": s.v * _any(rng, 0.012, 0.25)}, {"T_c": kinetic * level, "T_s": static * level})


def _directional(s: Sizes, rng: np.random.Generator) -> Shape:
    # A lip seal or a screw under load: a fifth to two thirds as much the easy way.
    hard, easy = _FRICTION * s.force, _FRICTION * s.force * rng.uniform(0.2, 0.67)
    forwards, backwards = (hard, easy) if rng.random() < 0.5 else (easy, hard)
    return Shape(growing={"T_fwd": forwards, "T_bwd": backwards})


def _presliding(s: Sizes, rng: np.random.Generator) -> Shape:
    # Rolling guides yield over 10 to 100 micrometers and move by millimeters; gears over a tenth of a turn of theirs.
    return Shape({"x_p": s.x * _any(rng, 0.015, 0.5)}, {"T_c": _FRICTION * s.force})


def _cubic(s: Sizes, rng: np.random.Generator) -> Shape:
    # Clamped springs harden by as much as their stiffness; softening ends where the slope would.
    share = 0.8 if rng.random() < 0.7 else -0.15
    return Shape(growing={"k_3": share * s.stiffness / s.x**2})


def _asymmetric(s: Sizes, rng: np.random.Generator) -> Shape:
    return Shape(growing={"k_2": 0.35 * _either(rng) * s.stiffness / s.x})


def _power_law(s: Sizes, rng: np.random.Generator) -> Shape:
    # From a ball on a plate (1.5) over rough faces (2) to wire ropes (2.5).
    return Shape({"n": rng.uniform(1.35, 2.6), "x_r": s.x}, {"k_p": s.stiffness})


def _end_stop(s: Sizes, rng: np.random.Generator) -> Shape:
    # A rubber buffer is as stiff as the spring, a flange twenty times; one that nothing meets is none.
    return Shape({"s": s.x * rng.uniform(0.35, 0.85)}, {"k_s": s.stiffness * _any(rng, 1.0, 20.0)})


def _free_play(s: Sizes, _: np.random.Generator) -> Shape:
    return Shape(growing={"g": 0.5 * s.x})


def _bouc_wen(s: Sizes, rng: np.random.Generator) -> Shape:
    # Loops of real joints saturate at a sixth of the motion (metal) to all of it (rubber); |gamma| <= beta dissipates whatever
    # the motion (Ikhouane and Rodellar 2007); n is 1 for rubber, 2 to 3 for steel.
    power, saturation = rng.uniform(1.0, 3.0), s.x * _any(rng, 0.15, 1.0)
    total, skew = saturation**-power, rng.uniform(-0.5, 0.8)
    beta = total / (1.0 + skew)
    return Shape(
        {"A": 1.0, "n": power, "beta": beta, "gamma": skew * beta}, elastic={"a": rng.uniform(0.1, 0.4)}
    )


def _iwan(s: Sizes, rng: np.random.Generator) -> Shape:
    # Lap joints reach macro-slip beyond the motion, dampers within it; the power covers Segalman's chi of -1 to 0 either way.
    return Shape(
        {"x_s": s.x * _any(rng, 0.4, 3.0), "q": rng.uniform(-0.6, 0.6)}, elastic={"a": rng.uniform(0.1, 0.4)}
    )


def _maxwell(s: Sizes, rng: np.random.Generator) -> Shape:
    # Relaxation about the motion's own time: far off, the branch would be a spring or a damper.
    return Shape({"tau_m": s.time * _any(rng, 0.3, 4.0)}, {"k_m": s.stiffness})


def _drag(s: Sizes, _: np.random.Generator) -> Shape:
    return Shape(growing={"c_2": s.force / s.v**2})


def _squeeze(s: Sizes, _: np.random.Generator) -> Shape:
    return Shape(growing={"c_x": 2.0 * s.force / (s.v * s.x**2)})


def _ripple(s: Sizes, rng: np.random.Generator) -> Shape:
    # One and a half to six periods over the whole motion: slower is a spring, faster is friction that shakes.
    phase, level = rng.uniform(0.0, 2.0 * math.pi), 0.3 * s.force
    return Shape(
        {"kappa": math.pi * _any(rng, 1.5, 6.0) / s.x},
        {"T_sin": level * math.cos(phase), "T_cos": level * math.sin(phase)},
    )


def _absorber(s: Sizes, rng: np.random.Generator) -> Shape:
    # A bracket or a cable: lightly damped, up to five times above the motion.
    return Shape(
        {"w_a": _any(rng, 1.3, 5.0) / s.time, "zeta_a": _any(rng, 0.008, 0.08)},
        {"m_a": 0.4 * s.force * s.time**2 / s.x},
    )


def _mass(s: Sizes, _: np.random.Generator) -> Shape:
    return Shape(growing={"m_e": s.force * s.time**2 / s.x})


def _late(name: str) -> Draw:
    return lambda s, _: Shape(growing={name: 0.6 * s.time})


def _saturation(s: Sizes, _: np.random.Generator) -> Shape:
    return Shape(thresholds={"u_max": 0.4 * s.input})


def _dead_zone(s: Sizes, _: np.random.Generator) -> Shape:
    return Shape(growing={"u_0": 0.15 * s.input})


def _speed_limit(s: Sizes, rng: np.random.Generator) -> Shape:
    # A motor that runs up to between a third and all of its idle speed.
    stall = 0.5 * s.input
    return Shape({"c_u": rng.uniform(0.3, 1.0) * stall / s.v}, thresholds={"u_s": stall})


def _creep(s: Sizes, _: np.random.Generator) -> Shape:
    return Shape(thresholds={"s": 0.3 * s.x})


def _exponential(s: Sizes, rng: np.random.Generator) -> Shape:
    # Within the motion: over a small part of its reach an exponential is a parabola.
    return Shape({"x_e": s.x * rng.uniform(0.3, 0.7)}, {"k_e": s.stiffness})


def _power_damping(s: Sizes, rng: np.random.Generator) -> Shape:
    # Between laminar (1) and turbulent (2) flow, and not near either.
    return Shape({"power": rng.uniform(1.4, 1.6), "v_r": s.v}, {"c_p": s.force / s.v})


def _meshing(s: Sizes, rng: np.random.Generator) -> Shape:
    return Shape(
        {"depth": rng.uniform(0.5, 0.9), "wave_number": math.pi * rng.uniform(1.0, 4.0) / s.x},
        {"level": _FRICTION * s.force},
    )


def _crack(s: Sizes, _: np.random.Generator) -> Shape:  # noqa: ARG001
    # At strength 1 half of the stiffness is gone while it is open; at 1.5 a quarter is left.
    return Shape(growing={"lost_share": 0.5})


def _rate_limit(s: Sizes, _: np.random.Generator) -> Shape:
    # A servo valve follows within milliseconds until its rate is at its limit.
    return Shape({"lag": 2e-3}, thresholds={"fastest": 0.3 * s.input / s.time})


SHAPES: dict[str, Draw] = {
    "coulomb_friction": _coulomb,
    "stribeck_friction": _stribeck,
    "directional_friction": _directional,
    "presliding_friction": _presliding,
    "cubic_stiffness": _cubic,
    "asymmetric_stiffness": _asymmetric,
    "power_law_stiffness": _power_law,
    "end_stop": _end_stop,
    "free_play": _free_play,
    "backlash": _free_play,
    "bouc_wen_hysteresis": _bouc_wen,
    "iwan_hysteresis": _iwan,
    "maxwell_branch": _maxwell,
    "quadratic_damping": _drag,
    "position_dependent_damping": _squeeze,
    "torque_ripple": _ripple,
    "flexible_mode": _absorber,
    "inertia": _mass,
    "input_delay": _late("T_d"),
    "actuator_lag": _late("T_a"),
    "input_saturation": _saturation,
    "input_dead_zone": _dead_zone,
    "speed_limit": _speed_limit,
    "sensor_delay": _late("T_s"),
    "sensor_lag": _late("T_m"),
    "creep_saturation": _creep,
    "exponential_spring": _exponential,
    "power_damping": _power_damping,
    "meshing_friction": _meshing,
    "breathing_crack": _crack,
    "rate_limit": _rate_limit,
}

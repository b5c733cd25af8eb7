"""Bouc-Wen hysteresis of the spring.

Equation
--------
``spring torque = a k x + (1 - a) k z``,  ``z' = A x' - beta |x'| |z|^(n-1) z - gamma x' |z|^n``

=====  ==================================================================================
A      scale of z; redundant (z -> c z changes nothing), kept at 1
a      ratio of the post-yield stiffness to k, 0 to 1; the effect vanishes at 1
beta   with gamma: loading branch saturates at z_max = (1/(beta + gamma))^(1/n)
gamma  with beta: unloading branch, slope set by beta - gamma
n      sharpness of the transition, 1 or more
=====  ==================================================================================

Applies to rubber, dry-friction dampers, rolling contact and magnetorheological elements with rounded, rate-independent
loops. Does not describe viscous losses, nor pinched or creeping loops.

Signature: stiffer and less damped at small amplitude, softer at large; odd harmonics; loops at any speed.

References: R. Bouc (1967); Y. K. Wen, J. Eng. Mech. 102 (1976) 249; F. Ikhouane and J. Rodellar, *Systems with
Hysteresis* (Wiley 2007); thesis, equations (6.1) to (6.3).
"""

import sympy as sp

from rigsight.effects.effect import (
    Effect,
    Energy,
    Family,
    GainTrend,
    Place,
    Signature,
    Start,
    State,
    SumAndDifference,
)
from rigsight.effects.symbols import deflection_rate, k, spring_torque, x_size
from rigsight.parameters import Parameter

A, a, beta, gamma, n, z = sp.symbols("A a beta gamma n z", real=True)

T_c, x_p = sp.symbols("T_c x_p", real=True)


def _from_secant(share: float, saturation: float, skew: float) -> Start:
    """Start with the fitted stiffness as the secant of the loop at the records' displacement.

    `share` is a, `saturation` is (beta + gamma) and `skew` (beta - gamma) times that displacement.
    """
    softening = share + (1 - share) * (1 - sp.exp(-saturation)) / saturation
    return Start(
        {
            "k": k / softening,
            "a": sp.Float(share),
            "beta": (saturation + skew) / (2 * x_size),
            "gamma": (saturation - skew) / (2 * x_size),
        }
    )


def _from_coulomb(saturation: float) -> Start:
    """Start as friction T_c that builds up over the records' displacement divided by `saturation`."""
    hysteretic = T_c * saturation / x_size
    half = saturation / (2 * x_size)
    values = {"k": k + hysteretic, "a": k / (k + hysteretic), "beta": half, "gamma": half}
    return Start(values, parent="coulomb_friction")


_FROM_PRESLIDING = Start(
    {"k": k + T_c / x_p, "a": k / (k + T_c / x_p), "beta": 1 / x_p, "gamma": sp.Integer(0)},
    parent="presliding_friction",
)
"""Beside a spring presliding friction is this loop with gamma = 0."""

BOUC_WEN_HYSTERESIS = Effect(
    name="bouc_wen_hysteresis",
    place=Place.DYNAMICS,
    family=Family.MEMORY,
    summary="Part of the spring torque depends on the history of the deflection (rounded hysteresis loops).",
    parameters=(
        Parameter("A", "scale of z, redundant", "", lower=1e-6, upper=1e6, default=1.0, fitted=False),
        Parameter(
            "a",
            "ratio of post-yield to initial stiffness",
            "",
            lower=0.0,
            upper=1.0,
            null=1.0,
            starts=(0.3, 0.7),
            search=(0.0, 1.0),
        ),
        Parameter(
            "beta",
            "loop shape, even part",
            "x^-1",
            lower=-1e12,
            upper=1e12,
            starts=(3.0, 10.0),
            search=(0.0, 1e3),
        ),
        Parameter(
            "gamma",
            "loop shape, odd part",
            "x^-1",
            lower=-1e12,
            upper=1e12,
            starts=(0.0, -5.0),
            search=(-1e3, 1e3),
        ),
        Parameter(
            "n",
            "sharpness of the transition",
            "",
            lower=1.0,
            upper=20.0,
            default=1.0,
            starts=(1.0,),
            search=(1.0, 20.0),
        ),
    ),
    energy=Energy.DISSIPATIVE,
    post_yield_stiffness_ratio="a",
    yields_over=(beta + gamma) ** (-1 / n),
    signature=Signature(gain_trend=GainTrend.RISES),
    spring=a * spring_torque + (1 - a) * k * z,
    states=(
        State(
            z,
            A * deflection_rate
            - beta * sp.Abs(deflection_rate) * sp.Abs(z) ** (n - 1) * z
            - gamma * deflection_rate * sp.Abs(z) ** n,
            "x",
        ),
    ),
    searched_as=(
        SumAndDifference("beta", "gamma", sum_range=(-1.0, 1e3), difference_range=(0.0, 2e3), exponent="n"),
    ),
    starts=(
        _from_secant(0.5, 2.0, 2.0),
        _from_secant(0.3, 0.5, 20.0),
        _from_secant(0.2, 8.0, 8.0),
        _from_coulomb(10.0),
        _from_coulomb(50.0),
        _FROM_PRESLIDING,
    ),
    special_cases={"n": 1.0},
)

"""Iwan hysteresis of the spring: many spring-slider elements in parallel, which slip one after the other.

Equation
--------
``spring torque = a k x + (1 - a) k sum_i w_i z_i``,  ``z_i' = x'`` within ``-s_i <= z_i <= s_i`` (held at the ends),
``s_i = x_s 10^(-2.7 (11 - 2 i) / 12)``, i = 0 to 5,  ``w_i = s_i^q / sum_j s_j^q``

===  ======================================================================================
a    ratio of the post-yield stiffness to k, 0 to 1; the effect vanishes at 1
x_s  deflection at which (nearly) all elements slip
q    which elements are stiff: below 0 those that slip early, above 0 those that slip late
===  ======================================================================================

k is the stiffness at very small motion, where nothing slips.

Applies to joints, rolling contact and bearings whose micro-slip spreads over decades of amplitude: stiffness falls and
damping grows with amplitude as a power law. Does not describe viscous losses, nor loops that change with speed.

Signature: stiffer and less damped at small amplitude, softer at large, over a wider range of amplitudes than one Bouc-Wen
loop; odd harmonics; loops at any speed.

References: W. D. Iwan, J. Appl. Mech. 33 (1966) 893; D. J. Segalman, J. Appl. Mech. 72 (2005) 752 (power-law distribution);
F. Al-Bender, V. Lampaert and J. Swevers, IEEE Trans. Autom. Control 50 (2005) 1883 (Maxwell slip).
"""

import sympy as sp

from rigsight.effects.effect import Effect, Energy, Family, GainTrend, Place, Signature, Start, State
from rigsight.effects.kinds import scale
from rigsight.effects.symbols import deflection_rate, k, spring_torque, x_size
from rigsight.parameters import Parameter

N_ELEMENTS = 6
"""Enough for loops without visible corners; each is a state of its own."""
DECADES = 2.7
"""Range of deflections over which the elements let go."""

a, x_s, q, beta, gamma = sp.symbols("a x_s q beta gamma", real=True)
elements = sp.symbols(f"z0:{N_ELEMENTS}", real=True)

_reaches = [sp.Float(10.0 ** (-DECADES * (1.0 - (i + 0.5) / N_ELEMENTS))) for i in range(N_ELEMENTS)]
"""Deflections at which the elements slip, as shares of x_s."""
_weights = [reach**q for reach in _reaches]


def _from_secant(share: float, reach: float, power: float) -> Start:
    """Start with the fitted stiffness as the secant of the loop at the records' displacement.

    `share` is a, `reach` is x_s in units of that displacement and `power` is q.
    """
    slips = [float(r) for r in _reaches]
    weights = [slip**power for slip in slips]
    stuck = sum(w * min(1.0, slip * reach) for w, slip in zip(weights, slips, strict=True)) / sum(weights)
    softening = share + (1.0 - share) * stuck
    values = {"k": k / softening, "a": share, "x_s": reach * x_size, "q": power}
    return Start({name: sp.sympify(value) for name, value in values.items()})


_FROM_BOUC_WEN = Start(
    {"a": a, "x_s": 2 / sp.sqrt(beta**2 + gamma**2), "q": sp.Integer(0)}, parent="bouc_wen_hysteresis"
)
"""The same loop with its rounding spread over many sliders: where both fit, the one state is preferred to the six."""

_STEP = _reaches[1] / _reaches[0]
_AGAIN = tuple(
    Start({"x_s": x_s * _STEP**steps}, parent="iwan_hysteresis")
    for steps in (-3.0, -2.0, -1.0, -0.5, -0.2, 0.2, 0.5, 1.0)
)
"""A fit may take the sliders for their neighbors, or stop where one slider lets go at the wrong turn of the motion."""


IWAN_HYSTERESIS = Effect(
    name="iwan_hysteresis",
    place=Place.DYNAMICS,
    family=Family.MEMORY,
    summary="Part of the spring torque comes from many small friction sliders that slip one after the other.",
    parameters=(
        Parameter(
            "a",
            "ratio of post-yield to initial stiffness",
            "",
            lower=0.0,
            upper=1.0,
            null=1.0,
            starts=(0.1, 0.4),
            search=(0.0, 1.0),
        ),
        scale(
            "x_s", "deflection at which nearly all elements slip", "x", starts=(0.5, 2.0), search=(1e-2, 1e2)
        ),
        Parameter(
            "q",
            "power of the stiffness over the slip deflection",
            "",
            lower=-3.0,
            upper=3.0,
            starts=(-0.5, 0.5),
            search=(-2.0, 2.0),
        ),
    ),
    energy=Energy.DISSIPATIVE,
    post_yield_stiffness_ratio="a",
    yields_over=x_s,
    mean_yield=x_s * sum(w * reach for w, reach in zip(_weights, _reaches, strict=True)) / sum(_weights),
    signature=Signature(gain_trend=GainTrend.RISES),
    spring=a * spring_torque
    + (1 - a) * k * sum(w * z for w, z in zip(_weights, elements, strict=True)) / sum(_weights),
    states=tuple(
        State(z, deflection_rate, "x", limit=reach * x_s) for z, reach in zip(elements, _reaches, strict=True)
    ),
    starts=(
        _from_secant(0.03, 0.05, -0.4),
        _from_secant(0.03, 0.2, -0.4),
        _from_secant(0.1, 2.0, -0.4),
        _from_secant(0.3, 0.15, -0.4),
        _from_secant(0.3, 0.5, -0.4),
        _from_secant(0.3, 1.5, -0.4),
        _from_secant(0.5, 4.0, 0.4),
        _from_secant(0.7, 0.4, 0.4),
        _from_secant(0.7, 1.2, 0.4),
        _FROM_BOUC_WEN,
        *_AGAIN,
    ),
)

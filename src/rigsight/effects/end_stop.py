"""End stop (flange contact): a second spring beyond a clearance.

Equation
--------
``resisting torque = k_s (x - s)`` for x > s, ``k_s (x + s)`` for x < -s, zero between.

=========  ================================================================
k_s        stiffness of the stop [force per displacement], 0: no stop
s          clearance to either side of the rest position
=========  ================================================================

Applies to flanges, bump stops and cable ends. Invisible in records that stay inside the clearance.

Signature: linear up to an amplitude, then the resonance rises suddenly; odd harmonics beyond the clearance only.

References: S. W. Shaw and P. J. Holmes, J. Sound Vib. 90 (1983) 129.
"""

import sympy as sp

from rigsight.effects.effect import Effect, Energy, Family, GainTrend, Place, Signature
from rigsight.effects.kinds import amount
from rigsight.effects.symbols import beyond, x
from rigsight.parameters import Parameter

k_s, s = sp.symbols("k_s s", real=True)

END_STOP = Effect(
    name="end_stop",
    place=Place.DYNAMICS,
    family=Family.PLAY_AND_STOPS,
    summary="Beyond a clearance the mass meets a second, stiffer spring.",
    parameters=(
        amount("k_s", "stiffness of the stop", "force x^-1", starts=(1.0, 5.0), search=(0.0, 300.0)),
        Parameter("s", "clearance", "x", lower=0.0, upper=1e9, starts=(0.7, 0.3, 1.1), search=(0.0, 3.0)),
    ),
    energy=Energy.CONSERVATIVE,
    signature=Signature(gain_trend=GainTrend.FALLS),
    torque=k_s * beyond(x, s),
)

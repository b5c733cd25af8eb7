"""Position-dependent damping: damping increases away from the rest position.

Equation
--------
``torque = c_x x^2 x'``

c_x: damping per squared displacement; the effect vanishes at 0.

Applies to squeeze films, magnetic dampers and seals whose overlap changes with position, and to electronic dampers with a
curved characteristic. Does not describe drag, which depends on speed alone.

Signature: the peak falls and widens with amplitude while the gain far below resonance stays; odd harmonics.

References: K. Worden and G. R. Tomlinson, *Nonlinearity in Structural Dynamics* (IOP 2001), on damping nonlinearities; the
van der Pol equation has its negative.
"""

import sympy as sp

from rigsight.effects.effect import Effect, Energy, Family, GainTrend, Place, Signature
from rigsight.effects.kinds import amount
from rigsight.effects.symbols import v, x

c_x = sp.Symbol("c_x", real=True)

POSITION_DEPENDENT_DAMPING = Effect(
    name="position_dependent_damping",
    place=Place.DYNAMICS,
    family=Family.DAMPING_LAW,
    summary="Damping that grows with the square of the displacement.",
    parameters=(
        amount(
            "c_x", "damping per squared displacement", "force time x^-3", starts=(0.3, 3.0), search=(0.0, 1e3)
        ),
    ),
    energy=Energy.DISSIPATIVE,
    signature=Signature(gain_trend=GainTrend.FALLS),
    torque=c_x * x**2 * v,
)

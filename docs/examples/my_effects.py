"""Which effect of our own is the diagnosis to try? A spring that hardens with the fifth power of the deflection."""

from sympy import Symbol

from rigsight.effects import Effect, Energy, GainTrend, Place, Signature
from rigsight.effects.symbols import x
from rigsight.parameters import Parameter

QUINTIC_STIFFNESS = Effect(
    name="quintic_stiffness",
    place=Place.DYNAMICS,
    summary="The spring hardens with the fifth power of the deflection.",
    parameters=(
        Parameter("k_5", "quintic stiffness", "force x^-5", null=0.0, starts=(0.3,), search=(0.0, 1e3)),
    ),
    energy=Energy.CONSERVATIVE,
    signature=Signature(GainTrend.FALLS),
    torque=Symbol("k_5", real=True) * x**5,
)

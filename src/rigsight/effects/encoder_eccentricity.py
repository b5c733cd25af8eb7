"""Encoder eccentricity: the reading has an error that is periodic in the position.

Equation
--------
``measured = x + e_sin sin(kappa x) + e_cos cos(kappa x)``

=====  ====================================================================================================
e_sin  part of the error that is zero at the origin; the effect vanishes where both parts are 0
e_cos  part that is largest there
kappa  wave number: periods per turn of an angle in rad (1 for a disk off its center), 2 pi over the period of a displacement
=====  ====================================================================================================

The amplitude is ``sqrt(e_sin^2 + e_cos^2)``, the phase ``atan2(e_cos, e_sin)``.

Applies to disks and magnets that sit off the center of the shaft, and to the interpolation between the lines of an encoder. A
torque ripple moves the mass; this error moves only the reading, as much at rest as at any speed.

Signature: an error that is the same at every speed and drive; the gain depends on the position about which the rig moves; even
harmonics.

References: E. O. Doebelin, *Measurement Systems* (McGraw-Hill 2004), on shaft encoders.
"""

import sympy as sp

from rigsight.effects.effect import Effect, Energy, Family, GainTrend, Place, Signature
from rigsight.effects.kinds import scale, signed
from rigsight.effects.symbols import reading

e_sin, e_cos, kappa = sp.symbols("e_sin e_cos kappa", real=True)

ENCODER_ECCENTRICITY = Effect(
    name="encoder_eccentricity",
    place=Place.SENSOR,
    family=Family.TONE_OR_RIPPLE,
    summary="The reading has an error that is periodic in the position.",
    parameters=(
        signed(
            "e_sin",
            "part of the error that is zero at the origin",
            "x",
            lower=-1e9,
            upper=1e9,
            starts=(0.02, 0.01),
            search=(-0.3, 0.3),
        ),
        signed(
            "e_cos",
            "part of the error that is largest at the origin",
            "x",
            lower=-1e9,
            upper=1e9,
            starts=(0.01, -0.02),
            search=(-0.3, 0.3),
        ),
        scale("kappa", "wave number", "x^-1", starts=(6.0, 15.0), search=(3.3, 60.0)),
    ),
    energy=Energy.ACTIVE,
    wave_number="kappa",
    signature=Signature(gain_trend=GainTrend.FALLS, even_harmonics=True),
    measured=reading + e_sin * sp.sin(kappa * reading) + e_cos * sp.cos(kappa * reading),
)

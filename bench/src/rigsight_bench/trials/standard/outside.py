"""Effects outside the catalogue, for which a diagnosis should answer `unknown`.

Four resemble nothing in the catalogue: a stiffness that varies periodically, a drive that weakens as it warms up, a drive whose
gain depends on the displacement, a sensor that drifts. Five resemble something: each has the sign, symmetry and loss of a
catalogue effect, but another law. None of them becomes a catalogue equation, alone or with other linear parameters, for any value
drawn here (a van der Pol term, for instance, is position-dependent damping beside less viscous damping, and friction of one
direction is Coulomb friction beside an offset; a resistance that grows with the deflection is friction that goes with a spring's
load: none of these is in). Two more are smooth laws of the deflection and of the speed, drawn at random for each trial.
"""

from __future__ import annotations

import sympy as sp

from rigsight.effects import Effect
from rigsight.effects.effect import Energy, GainTrend, Place, Signature, State
from rigsight.effects.symbols import k, reading, t, u, v, x
from rigsight.parameters import Parameter

_strength, _rate, _time, _reach, _phase, _memory = sp.symbols(
    "strength rate settling reach phase memory", real=True
)
_RISES = Signature(GainTrend.RISES)
_STEADY = Signature(GainTrend.STEADY)


def _strength_of(description: str, dimension: str, *starts: float) -> Parameter:
    return Parameter("strength", description, dimension, null=0.0, starts=starts)


PULSATING_STIFFNESS = Effect(
    name="pulsating_stiffness",
    place=Place.DYNAMICS,
    summary="The stiffness rises and falls with its own period (parametric excitation).",
    parameters=(
        _strength_of("relative change of the stiffness", "", 0.15, 0.3),
        Parameter("rate", "its angular frequency", "time^-1", starts=(0.4, 1.3)),
    ),
    energy=Energy.ACTIVE,
    signature=_STEADY,
    torque=_strength * k * x * sp.sin(_phase),
    states=(State(_phase, _rate, ""),),
)
FADING_DRIVE = Effect(
    name="fading_drive",
    place=Place.ACTUATOR,
    summary="The drive weakens as it warms up during a record.",
    parameters=(
        _strength_of("share of the drive that is lost", "", 0.2, 0.4),
        Parameter("settling", "time constant of warming up", "time", starts=(60.0, 200.0)),
    ),
    energy=Energy.ACTIVE,
    signature=_STEADY,
    drive=u * (1 - _strength * (1 - sp.exp(-t / _time))),
)
DRIVE_OVER_POSITION = Effect(
    name="drive_over_position",
    place=Place.ACTUATOR,
    summary="The drive is weaker away from the middle.",
    parameters=(_strength_of("loss per squared displacement", "x^-2", 0.2, 0.5),),
    energy=Energy.ACTIVE,
    signature=_RISES,
    drive=u * (1 - _strength * x**2),
)
DRIFTING_SENSOR = Effect(
    name="drifting_sensor",
    place=Place.SENSOR,
    summary="The displacement's sensor drifts as long as a record lasts.",
    parameters=(_strength_of("drift per time", "x time^-1", 0.0005, 0.001),),
    energy=Energy.ACTIVE,
    signature=_STEADY,
    measured=reading + _strength * t,
)
LEVELING_STIFFNESS = Effect(
    name="leveling_stiffness",
    place=Place.DYNAMICS,
    summary="A second spring whose force levels off, as that of a magnet.",
    parameters=(
        _strength_of("its stiffness about rest", "force x^-1", 0.5, 1.0),
        Parameter("reach", "deflection at which it levels off", "x", starts=(0.3,)),
    ),
    energy=Energy.CONSERVATIVE,
    signature=_RISES,
    torque=_strength * _reach * sp.tanh(x / _reach),
)
THINNING_BRANCH = Effect(
    name="thinning_branch",
    place=Place.DYNAMICS,
    summary="Beside the spring, another one in series with a damper that gives way more under a larger force.",
    parameters=(
        _strength_of("stiffness of the branch", "force x^-1", 0.3, 0.8),
        Parameter("settling", "relaxation time at the deflection `reach`", "time", starts=(0.5, 2.0)),
        Parameter("reach", "deflection of the branch", "x", starts=(0.3,)),
    ),
    energy=Energy.DISSIPATIVE,
    signature=_RISES,
    torque=_strength * _memory,
    states=(State(_memory, v - _memory * sp.Abs(_memory) / (_reach * _time), "x"),),
)
CUBIC_DAMPING = Effect(
    name="cubic_damping",
    place=Place.DYNAMICS,
    summary="Damping that grows with the cube of the speed.",
    parameters=(_strength_of("drag coefficient", "force time^3 x^-3", 0.2, 0.6),),
    energy=Energy.DISSIPATIVE,
    signature=Signature(GainTrend.FALLS),
    torque=_strength * v**3,
)
DRIVE_OVER_SPEED = Effect(
    name="drive_over_speed",
    place=Place.ACTUATOR,
    summary="The drive is weaker the faster the rig moves, either way.",
    parameters=(_strength_of("loss per speed", "x^-1 time", 0.2, 0.5),),
    energy=Energy.ACTIVE,
    signature=_RISES,
    drive=u * (1 - _strength * sp.Abs(v)),
)
FRICTION_ON_ONE_SIDE = Effect(
    name="friction_on_one_side",
    place=Place.DYNAMICS,
    summary="Dry friction that acts on one side of the middle only.",
    parameters=(_strength_of("friction", "drive", 0.1, 0.2),),
    energy=Energy.DISSIPATIVE,
    signature=Signature(GainTrend.RISES, even_harmonics=True),
    torque=_strength * sp.sign(v) * (1 + sp.sign(x)) / 2,
)

_N_WAVES = 3


def _waves(argument: sp.Expr) -> sp.Expr:
    """Return a smooth random function without a preferred shape: random Fourier features of a Gaussian process."""
    numbers = [sp.symbols(f"height_{i} rate_{i} phase_{i}", real=True) for i in range(_N_WAVES)]
    return sp.Add(*(height * sp.cos(rate * argument + phase) for height, rate, phase in numbers))


def _wave_parameters() -> tuple[Parameter, ...]:
    return tuple(
        Parameter(f"{name}_{i}", description, "", starts=starts)
        for i in range(_N_WAVES)
        for name, description, starts in (
            ("height", "of a wave of the logarithm of the law", (-0.4, 0.4)),
            ("rate", "of a wave", (0.7, 2.0)),
            ("phase", "of a wave", (-1.5, 1.5)),
        )
    )


def _smooth(
    name: str, summary: str, argument: sp.Symbol, unit: str, dimension: str, energy: Energy
) -> Effect:
    """Return a law that is proportional to one quantity at every size, with a factor that is a smooth random function of it."""
    return Effect(
        name=name,
        place=Place.DYNAMICS,
        summary=summary,
        parameters=(
            _strength_of("factor at the middle of its waves", dimension, 0.5, 1.0),
            Parameter("reach", "over which the factor changes", unit, starts=(0.3,)),
            *_wave_parameters(),
        ),
        energy=energy,
        signature=Signature(GainTrend.RISES, even_harmonics=True),
        torque=_strength * argument * sp.exp(_waves(argument / _reach)),
    )


SMOOTH_SPRING = _smooth(
    "smooth_spring",
    "A second spring whose stiffness is a smooth random function of the deflection.",
    x,
    "x",
    "force x^-1",
    Energy.CONSERVATIVE,
)
SMOOTH_DAMPING = _smooth(
    "smooth_damping",
    "A second damper whose resistance is a smooth random function of the speed.",
    v,
    "x time^-1",
    "force time x^-1",
    Energy.DISSIPATIVE,
)

UNLIKE_THE_CATALOGUE: tuple[Effect, ...] = (
    PULSATING_STIFFNESS,
    FADING_DRIVE,
    DRIVE_OVER_POSITION,
    DRIFTING_SENSOR,
)
LIKE_THE_CATALOGUE: tuple[Effect, ...] = (
    LEVELING_STIFFNESS,
    THINNING_BRANCH,
    CUBIC_DAMPING,
    DRIVE_OVER_SPEED,
    FRICTION_ON_ONE_SIDE,
)
RANDOM: tuple[Effect, ...] = (SMOOTH_SPRING, SMOOTH_DAMPING)
OUTSIDE: tuple[Effect, ...] = UNLIKE_THE_CATALOGUE + LIKE_THE_CATALOGUE + RANDOM

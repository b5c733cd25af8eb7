"""Assignment of hand-written plants to effects of the catalogue and the names of their parameters.

Only these names are shared with the catalogue, because keys and scores use them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from rigsight_bench.trials.handwritten.equations import drives, friction, memory, springs
from rigsight_bench.trials.handwritten.equations.bench_element import Element
from rigsight_bench.trials.handwritten.equations.held_inputs import Input
from rigsight_bench.trials.handwritten.equations.laws import JointLaw
from rigsight_bench.trials.handwritten.equations.motions import (
    Joint,
    Motion,
    OneMass,
    PlanarArm,
    RollingAxle,
    TwoMasses,
    saturating_creep,
)
from rigsight_bench.trials.handwritten.equations.plant import Plant, Reading, Response

Numbers = Mapping[str, float]

MOTIONS: dict[str, Callable[[Numbers], Motion]] = {
    "axis": OneMass,
    "drive_train": TwoMasses,
    "two_link_arm": PlanarArm,
    "running_gear": RollingAxle,
}
"""Rigs that move, by the names of the built-in rigs; beside them there is the element, whose motion is prescribed."""
PRESCRIBED = "element"

JOINT_LAWS: dict[str, Callable[[Numbers, Joint], JointLaw]] = {
    "coulomb_friction": lambda e, _: friction.Coulomb(e["T_c"]),
    "stribeck_friction": lambda e, _: friction.Stribeck(e["T_c"], e["T_s"], e["w_s"]),
    "directional_friction": lambda e, _: friction.Directional(e["T_fwd"], e["T_bwd"]),
    "presliding_friction": lambda e, _: friction.Dahl(e["T_c"], e["x_p"]),
    "cubic_stiffness": lambda e, _: springs.cubic(e["k_3"]),
    "asymmetric_stiffness": lambda e, _: springs.quadratic(e["k_2"]),
    "power_law_stiffness": lambda e, _: springs.power_law(e["k_p"], e["n"], e["x_r"]),
    "end_stop": lambda e, _: springs.stops(e["k_s"], e["s"]),
    "free_play": lambda e, joint: springs.loose_spring(joint.stiffness, e["g"]),
    "backlash": lambda e, joint: memory.Backlash(joint.stiffness, e["g"]),
    "bouc_wen_hysteresis": lambda e, joint: memory.BoucWen(
        joint.stiffness, e["a"], e["A"], e["beta"], e["gamma"], e["n"]
    ),
    "iwan_hysteresis": lambda e, joint: memory.iwan_of_power(joint.stiffness, e["a"], e["x_s"], e["q"]),
    "quadratic_damping": lambda e, _: springs.drag(e["c_2"]),
    "position_dependent_damping": lambda e, _: springs.squeeze(e["c_x"]),
    "torque_ripple": lambda e, joint: springs.ripple(e["T_sin"], e["T_cos"], e["kappa"], joint.rest),
    "maxwell_branch": lambda e, _: springs.Maxwell(e["k_m"], e["tau_m"]),
    "flexible_mode": lambda e, _: springs.Absorber(e["m_a"], e["w_a"], e["zeta_a"]),
    "inertia": lambda e, _: springs.CarriedMass(e["m_e"]),
    # Of no catalogue.
    "exponential_spring": lambda e, _: springs.exponential(e["k_e"], e["x_e"]),
    "power_damping": lambda e, _: springs.power_damping(e["c_p"], e["power"], e["v_r"]),
    "meshing_friction": lambda e, _: friction.Meshing(e["level"], e["depth"], e["wave_number"]),
    "breathing_crack": lambda e, joint: springs.breathing_crack(e["lost_share"] * joint.stiffness),
}
DRIVE_LAWS: dict[str, Callable[[Numbers], drives.DriveLaw]] = {
    "input_delay": lambda e: drives.DeadTime(e["T_d"]),
    "actuator_lag": lambda e: drives.Lag(e["T_a"]),
    "input_saturation": lambda e: drives.Saturation(e["u_max"]),
    "input_dead_zone": lambda e: drives.DeadZone(e["u_0"]),
    "speed_limit": lambda e: drives.TorqueSpeedLine(e["u_s"], e["c_u"]),
    # Of no catalogue.
    "rate_limit": lambda e: drives.RateLimit(e["fastest"], e["lag"]),
}
SENSOR_LAWS: dict[str, Callable[[Numbers, str], Reading]] = {
    "sensor_delay": lambda e, sensor: Reading(sensor, dead_time=e["T_s"]),
    "sensor_lag": lambda e, sensor: Reading(sensor, lag=e["T_m"]),
}
LATERAL_LAWS: dict[str, Callable[[Numbers], Callable[[float], float]]] = {
    "creep_saturation": lambda e: saturating_creep(e["s"]),
}


def respond(
    rig: str,
    numbers: Numbers,
    inputs: Sequence[Input],
    dt: float,
    n_samples: int,
    effect: str = "",
    place: str = "",
    own: Numbers | None = None,
) -> Response:
    """Drive a hand-written plant from rest.

    Parameters
    ----------
    rig
        Name of the built-in rig whose equations they are.
    numbers
        Constants and parameters of the rig.
    inputs
        In the order of the rig's file.
    dt
        Sample time [s].
    n_samples
        Number of samples.
    effect
        Name of the hidden effect; none if empty.
    place
        Joint, drive or sensor at which it acts, and whose motion is returned; if empty, the first joint.
    own
        Parameters of the effect.

    Raises
    ------
    SimulationError
        If the motion diverges, or events accumulate.
    """
    own = own or {}
    if rig == PRESCRIBED:
        joint = Joint("dynamics", (1,), numbers["k"], numbers["d"])
        law = JOINT_LAWS[effect](own, joint) if effect else None
        return Element(numbers, law).respond(inputs[0], dt, n_samples)
    if effect in LATERAL_LAWS:
        motion: Motion = RollingAxle(numbers, LATERAL_LAWS[effect](own))
    else:
        motion = MOTIONS[rig](numbers)
    joint = motion.joints.get(place) or next(iter(motion.joints.values()))
    plant = Plant(motion, joint)
    if effect in JOINT_LAWS:
        plant = Plant(motion, joint, JOINT_LAWS[effect](own, joint))
    elif effect in DRIVE_LAWS:
        plant = Plant(motion, joint, drive=place, drive_law=DRIVE_LAWS[effect](own))
    elif effect in SENSOR_LAWS:
        # A rig of one motion calls the place of its first sensor plainly that.
        sensor = place if place in motion.sensors else next(iter(motion.sensors))
        plant = Plant(motion, joint, reading=SENSOR_LAWS[effect](own, sensor))
    return plant.respond(inputs, dt, n_samples)

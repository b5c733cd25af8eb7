"""Bodies that another program simulates: their inertia and the forces between them, as leaves of a rig's equations."""

from rigsight.simulators.bodies import KINDS, Bodies, bodies_of
from rigsight.simulators.leaf import force_leaf, mass_leaf, place_of, simulated, simulated_slope
from rigsight.simulators.mujoco_program import has_constraints
from rigsight.simulators.python_program import give_function

__all__ = [
    "KINDS",
    "Bodies",
    "bodies_of",
    "force_leaf",
    "give_function",
    "has_constraints",
    "mass_leaf",
    "place_of",
    "simulated",
    "simulated_slope",
]

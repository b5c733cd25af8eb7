"""Bodies that another program simulates: their inertia and the forces between them, as leaves of a rig's equations."""

from rigsight.simulators.bodies import KINDS as KINDS
from rigsight.simulators.bodies import Bodies as Bodies
from rigsight.simulators.bodies import bodies_of as bodies_of
from rigsight.simulators.bodies import force_leaf as force_leaf
from rigsight.simulators.bodies import mass_leaf as mass_leaf
from rigsight.simulators.bodies import place_of as place_of
from rigsight.simulators.bodies import simulated as simulated
from rigsight.simulators.bodies import simulated_slope as simulated_slope
from rigsight.simulators.mujoco_program import has_constraints as has_constraints
from rigsight.simulators.python_program import give_function as give_function

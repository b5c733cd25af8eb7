"""Simulation: rig and effects -> compiled kernel -> outputs for a record's input."""

from rigsight.libraries import cache_folder as cache_folder
from rigsight.simulate.compiled.kernel import FittedRecord as FittedRecord
from rigsight.simulate.compiled.kernel import kernel_of as kernel_of
from rigsight.simulate.equations.composition import compose as compose
from rigsight.simulate.equations.composition import structure_named as structure_named
from rigsight.simulate.equations.composition import structure_of_fit as structure_of_fit
from rigsight.simulate.equations.composition import without_vanished_effects as without_vanished_effects
from rigsight.simulate.equations.structure import Structure as Structure
from rigsight.simulate.equations.structure import carried_over as carried_over
from rigsight.simulate.equations.structure import special_values as special_values
from rigsight.simulate.equations.structure import unique_names as unique_names
from rigsight.simulate.equilibrium import rest_state as rest_state
from rigsight.simulate.model import Model as Model
from rigsight.simulate.side_by_side import Substeps as Substeps
from rigsight.simulate.side_by_side import carries_tangents as carries_tangents
from rigsight.simulate.side_by_side import differs_at_events as differs_at_events
from rigsight.simulate.side_by_side import has_dry_friction as has_dry_friction
from rigsight.simulate.side_by_side import simulate_sets as simulate_sets
from rigsight.simulate.side_by_side import simulate_tangents as simulate_tangents
from rigsight.simulate.side_by_side import state_limits as state_limits
from rigsight.simulate.simulation import parameter_vector as parameter_vector
from rigsight.simulate.simulation import record_input as record_input
from rigsight.simulate.simulation import record_values as record_values
from rigsight.simulate.simulation import simulate as simulate
from rigsight.simulate.simulation import simulate_outputs as simulate_outputs

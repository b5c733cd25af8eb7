"""What a rig is: signals, numbers to know and to identify, and the mechanism into whose places effects are put."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import sympy as sp

from rigsight.effects import Effect, Place, symbols
from rigsight.effects.symbols import derivative
from rigsight.parameters import Parameter
from rigsight.rigs.controller import Controller, controller_of
from rigsight.rigs.evaluation import evaluated
from rigsight.rigs.mechanism import Mechanism
from rigsight.rigs.parts import Drive, Follower, Joint, Motion, RateState, Sensor, Signal, follower_of
from rigsight.units import unit_text


@dataclass(frozen=True)
class Alternative:
    """A number that people know in the place of one of the rig's own."""

    parameter: Parameter
    gives: str  # name of the parameter that follows from it
    value: sp.Expr  # that parameter, of the number and of constants


@dataclass(frozen=True)
class Rig:
    """A rig as a declaration.

    Attributes
    ----------
    name
        Name in campaigns (``rig.model``).
    summary
        One plain sentence.
    inputs
        Recorded signals that drive it.
    constants
        Known numbers of the rig; one with a default may be left out of a campaign.
    parameters
        Numbers to identify, in the order of the equations.
    mechanism
        Its equations.
    alternatives
        Accepted in a campaign in the place of one of `parameters`.
    declaration
        The tables of its file; empty for a rig that is part of another.
    """

    name: str
    summary: str
    inputs: tuple[Signal, ...]
    constants: tuple[Parameter, ...]
    parameters: tuple[Parameter, ...]
    mechanism: Mechanism
    alternatives: tuple[Alternative, ...] = ()
    declaration: Mapping[str, Any] = field(default_factory=dict, compare=False, repr=False)

    @cached_property
    def outputs(self) -> tuple[Signal, ...]:
        """What is recorded of it; a record holds `required_outputs`, and one at least."""
        return tuple(Signal(sensor.name, sensor.unit, sensor.about) for sensor in self.mechanism.sensors)

    @cached_property
    def usually_positive(self) -> frozenset[str]:
        """Parameters that are positive on rigs that return to rest: those that cannot be negative, and stiffnesses."""
        stiffness = {str(s) for joint in self.mechanism.joints for s in joint.stiffness.free_symbols}
        return frozenset(p.name for p in self.parameters if p.lower >= 0.0 or p.name in stiffness)

    @property
    def signal_units(self) -> dict[str, str]:
        """Unit of every input and output by name."""
        return {signal.name: signal.unit for signal in (*self.inputs, *self.outputs)}

    @property
    def required_outputs(self) -> tuple[str, ...]:
        """Names of the outputs that every record holds: with one motion, the one that shows it."""
        return (self.outputs[0].name,) if self.has_one_motion else ()

    @property
    def absent_inputs(self) -> tuple[str, ...]:
        """Names of the inputs that are 0 in a record that holds none of them: those that prescribe no motion."""
        return tuple(s.name for s in self.inputs if s.name not in self.mechanism.prescribing)

    @property
    def alternative_parameters(self) -> tuple[Parameter, ...]:
        """The numbers that are accepted in the place of one of `parameters`."""
        return tuple(alternative.parameter for alternative in self.alternatives)

    @property
    def moving_inputs(self) -> tuple[str, ...]:
        """Names of the inputs that move in every record that is fitted: of one element the motion that is prescribed to it."""
        return () if self.is_driven or not self.has_one_motion else (self.inputs[0].name,)

    def in_own_parameters(
        self, given: Mapping[str, float], constants: Mapping[str, float]
    ) -> dict[str, float]:
        """Return given values with alternatives turned into the parameters that follow from them.

        Parameters
        ----------
        given
            Values by name [SI].
        constants
            The rig's constants by name [SI].
        """
        own = dict(given)
        for alternative in self.alternatives:
            name = alternative.parameter.name
            if name in own:
                numbers = {**constants, name: own.pop(name)}
                own[alternative.gives] = evaluated(alternative.value, numbers)
        return own

    @property
    def is_driven(self) -> bool:
        """True if an input moves a mass, False if the motion is prescribed."""
        return bool(self.mechanism.free)

    @property
    def has_one_motion(self) -> bool:
        """True if `motion` says all there is to say, see `Mechanism.has_one_motion`."""
        return self.mechanism.has_one_motion

    @cached_property
    def motion(self) -> Motion:
        """The one degree of freedom.

        Raises
        ------
        ValueError
            If the rig is more than that, see `has_one_motion`.
        """
        mechanism = self.mechanism
        if not self.has_one_motion:
            raise ValueError(f"{self.name} has more than one mass or element.")
        (coordinate,), (joint,) = mechanism.coordinates, mechanism.joints
        drive_gain, inertia = sp.S.Zero, None
        if mechanism.free:
            (drive,) = mechanism.drives
            drive_gain = derivative(drive.force, sp.Symbol(drive.name, real=True))
            inertia = mechanism.mass_matrix[0, 0]
        bias = -joint.force if mechanism.free else joint.force
        resisting = joint.stiffness, joint.damping, drive_gain, joint.rest
        return Motion(coordinate.symbol, coordinate.rate, *resisting, bias, inertia)

    @cached_property
    def follower(self) -> Follower | None:
        """The first-order state that follows the motion of a rig with one joint and drives nothing, if there is one."""
        mechanism = self.mechanism
        if not len(mechanism.coordinates) == len(mechanism.joints) == 1:
            return None
        read = {symbol for drive in mechanism.drives for symbol in (drive.signal + drive.force).free_symbols}
        states = (state for state in mechanism.states if state.symbol not in read)
        found = (follower_of(state, mechanism.coordinates[0]) for state in states)
        return next((follower for follower in found if follower is not None), None)

    @property
    def downstream(self) -> dict[sp.Symbol, sp.Expr]:
        """States driven by the motion of which it knows nothing, with their rates without effects."""
        return {state.symbol: state.rate for state in self.mechanism.states}

    @property
    def downstream_parameters(self) -> frozenset[str]:
        """Names of the parameters of which the motion knows nothing."""
        parts = vars(self.motion).values()
        own = {symbol.name for part in parts if part is not None for symbol in part.free_symbols}
        return frozenset(parameter.name for parameter in self.parameters if parameter.name not in own)

    @property
    def units(self) -> dict[str, str]:
        """Unit of each base quantity of its first joint: x, force, input, time, and length where a state follows."""
        return self.units_at(self.mechanism.first_joint.name)

    def units_at(self, place: str) -> dict[str, str]:
        """Return the unit of each base quantity at a joint, a drive or a sensor.

        Parameters
        ----------
        place
            Its name; at a drive x and force are those of the first joint, at a sensor x is what it reads.
        """
        mechanism = self.mechanism
        joint = mechanism.joint_named(place)
        coordinates = [c for c in mechanism.coordinates if c.symbol in joint.motion.free_symbols]
        x = coordinates[0].unit if coordinates else "1"
        force = {"rad": "N m", "m": "N"}.get(x, f"J/{x}" if " " not in x else f"J/({x})")
        reading = next((sensor.unit for sensor in mechanism.sensors if sensor.name == place), x)
        units = {"x": reading, "force": force, "time": "s"}
        if self.is_driven and self.inputs:
            drive = next((drive for drive in mechanism.drives if drive.name == place), None)
            source = drive.signal if drive is not None else sp.Symbol(self.inputs[0].name, real=True)
            # What a control law gives has no unit that stands anywhere.
            units["input"] = next(
                (s.unit for s in self.inputs if sp.Symbol(s.name, real=True) == source), "1"
            )
        if mechanism.states:
            units["length"] = mechanism.states[0].unit
        return units

    @cached_property
    def sensors_of_motion(self) -> tuple[Sensor, ...]:
        """Sensors that read no state which follows the motion."""
        followers = {state.symbol for state in self.mechanism.states}
        return tuple(s for s in self.mechanism.sensors if not s.reads.free_symbols & followers)

    def motion_alone(self) -> Rig:
        """Return the rig without the states that follow its motion, their sensors and their parameters in the equations."""
        sensors = self.sensors_of_motion
        kept = {sensor.name for sensor in sensors} | {drive.name for drive in self.mechanism.drives}
        order = tuple(name for name in self.mechanism.order if name in kept)
        mechanism = replace(self.mechanism, states=(), sensors=sensors, order=order)
        return replace(self, mechanism=mechanism, declaration={})

    def with_unit(self, parameter: Parameter, place: str | None = None) -> Parameter:
        """Return the parameter with its unit on this rig, at a place or at its first joint.

        The base quantity "drive" is a force of the size of the drive's, where "force" is one of the size of the spring's.

        Parameters
        ----------
        parameter
            Of an effect.
        place
            Name of a joint, drive or sensor.
        """
        units = self.units if place is None else self.units_at(place)
        units = {**units, "drive": units["force"]}
        return replace(parameter, unit=unit_text(parameter.dimension, units))

    def place_name(self, place: Place) -> str:
        """Return how results call a place on this rig.

        Parameters
        ----------
        place
            Kind of place.
        """
        return self.mechanism.joints[0].name if place is Place.DYNAMICS else place.value

    def constant_forces_at(self, joint: Joint) -> frozenset[str]:
        """Return the names of the parameters that do nothing but push a joint with a constant force.

        The rest position of its spring is one of them, unless something else goes by it.

        Parameters
        ----------
        joint
            One of the rig's.
        """
        moving, own = self.mechanism.moving, {p.name for p in self.parameters}
        pushing = {
            s.name
            for s in joint.force.free_symbols
            if s.name in own and not derivative(joint.force, s).free_symbols & moving
        }
        resting = {s.name for s in joint.rest.free_symbols if s.name in own and joint.stiffness != 0}
        return frozenset((pushing | resting) - self._read_elsewhere(joint))

    def _read_elsewhere(self, joint: Joint) -> set[str]:
        """Return the names of what the equations hold beside the force and the rest position of a joint."""
        mechanism = self.mechanism
        parts = [mechanism.kinetic, mechanism.potential]
        parts += [*mechanism.signals.values(), *mechanism.initial.values()]
        parts += [part for drive in mechanism.drives for part in (drive.signal, drive.force, drive.along)]
        parts += [sensor.reads for sensor in mechanism.sensors] + [state.rate for state in mechanism.states]
        for other in mechanism.joints:
            parts += [other.motion, other.stiffness, other.damping, other.inertia or sp.S.Zero]
            parts += [] if other is joint else [other.force, other.rest]
        return {symbol.name for part in parts for symbol in part.free_symbols}

    def places(self, kind: Place) -> tuple[str, ...]:
        """Return the names of the joints, drives, sensors or states at which effects of a kind can act.

        Parameters
        ----------
        kind
            Kind of place.
        """
        mechanism = self.mechanism
        if kind is Place.CONTROLLER:
            return tuple(drive.name for drive in mechanism.drives if drive.name in self.controllers)
        parts: Mapping[Place, Sequence[Drive | Sensor | RateState]] = {
            Place.ACTUATOR: mechanism.drives,
            Place.SENSOR: mechanism.sensors,
            Place.LATERAL_DYNAMICS: mechanism.states,
        }
        return tuple(place.name for place in parts.get(kind, mechanism.joints))

    @cached_property
    def controllers(self) -> dict[str, Controller]:
        """Control laws by the name of their drive."""
        found = {drive.name: controller_of(self.mechanism, drive) for drive in self.mechanism.drives}
        return {name: controller for name, controller in found.items() if controller is not None}

    def where(self, effect: Effect) -> str:
        """Return how results call the place of an effect.

        Parameters
        ----------
        effect
            At its place, or of no place.
        """
        is_one_of_several = effect.place is Place.SENSOR and len(self.sensors_of_motion) > 1
        if effect.at is not None or not self.has_one_motion or is_one_of_several:
            return self.acts_at(effect)
        return self.place_name(effect.place)

    def acts_at(self, effect: Effect) -> str:
        """Return the name of the joint, drive, sensor or state at which an effect acts; the first where it names none.

        Parameters
        ----------
        effect
            At its place, or of no place.
        """
        return effect.at if effect.at is not None else self.places(effect.place)[0]

    def offers(self, effect: Effect) -> bool:
        """Return True if the effect makes sense on this rig.

        Parameters
        ----------
        effect
            At its place, or of no place.
        """
        if effect.at is not None and effect.at not in self.places(effect.place):
            return False
        if effect.place is Place.LATERAL_DYNAMICS:
            return self.follower is not None
        if not self.places(effect.place) or not self._suits(effect):
            return False
        if self.is_driven or effect.shifts_the_record:
            return True
        lacks_inertia = effect.needs_inertia and joint_of(self, effect).inertia is None
        return effect.place is Place.DYNAMICS and not lacks_inertia

    def _suits(self, effect: Effect) -> bool:
        """Return False where an effect lacks what it acts on, or does what another one at its place does already."""
        mechanism, at = self.mechanism, self.acts_at(effect)
        if effect.place is Place.CONTROLLER:
            return self.controllers[at].suits(effect)
        if effect.place is Place.SENSOR and effect.wave_number is not None:
            sensor = next(own for own in mechanism.sensors if own.name == at)
            return not any(c.rate in sensor.reads.free_symbols for c in mechanism.coordinates)
        joint = joint_of(self, effect)
        if effect.reads(symbols.acceleration) and mechanism.moves_inertia(joint.motion):
            return False  # Only that of a prescribed motion is known.
        if effect.turns_freely:
            units = {c.unit for c in mechanism.coordinates if c.symbol in joint.motion.free_symbols}
            if units != {"rad"} or joint.stiffness != 0:
                return False
        if effect.needs_known_inertia and not mechanism.has_known_inertia(joint.motion, self.parameters):
            return False
        # What needs the inertia of a joint takes forces of the drive from it, with a load or without.
        if effect.reads(symbols.driven) and not effect.needs_inertia:
            resists = (mechanism.resisted_by(joint), joint.stiffness, joint.force)
            if mechanism.driven_by(joint) == 0 or not any(part != 0 for part in resists):
                return False
        if effect.at is None or effect.place not in (Place.DYNAMICS, Place.DISTURBANCE):
            return True
        if effect.reads_inertia and joint.inertia is None and not mechanism.has_short_inverse:
            return False
        if joint.stiffness == 0 and (effect.spring is not None or effect.deflection is not None):
            return False
        return not effect.needs_inertia or joint.inertia is not None or mechanism.moves_inertia(joint.motion)


def joint_of(rig: Rig, effect: Effect) -> Joint:
    """Return the joint at which an effect acts; the first one for an effect at a drive, a sensor or a state."""
    return rig.mechanism.joint_named(effect.at)

"""Does an effect make sense at a place of a rig? Not where it lacks what it acts on, or does what another effect does already."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from rigsight.effects import symbols
from rigsight.effects.effect import Effect, Place
from rigsight.effects.symbols import derivative
from rigsight.parameters import Parameter
from rigsight.rigs.controller import Controller
from rigsight.rigs.mechanism import Mechanism
from rigsight.rigs.parts import Joint


def suits_place(
    effect: Effect,
    at: str,
    mechanism: Mechanism,
    controllers: Mapping[str, Controller],
    parameters: Iterable[Parameter],
) -> bool:
    """Return True if an effect makes sense at a place of its kind.

    Parameters
    ----------
    effect
        At its place, or of no place.
    at
        Name of the joint, drive or sensor.
    mechanism
        The equations of the rig.
    controllers
        Control laws by the name of their drive.
    parameters
        Numbers of the rig that are not known.
    """
    if effect.place is Place.CONTROLLER:
        return _suits_controller(effect, controllers[at])
    if effect.place is Place.SENSOR and effect.wave_number is not None:
        sensor = next(own for own in mechanism.sensors if own.name == at)
        return not any(c.rate in sensor.reads.free_symbols for c in mechanism.coordinates)
    joint = mechanism.joint_named(effect.at)
    if effect.reads(symbols.acceleration) and mechanism.moves_inertia(joint.motion):
        return False  # Only that of a prescribed motion is known.
    if effect.needs_known_inertia and not mechanism.has_known_inertia(joint.motion, parameters):
        return False
    # What needs the inertia of a joint takes forces of the drive from it, with a load or without.
    if effect.reads(symbols.driven) and not effect.needs_inertia and not _has_two_loads(mechanism, joint):
        return False
    if effect.at is None or effect.place not in (Place.DYNAMICS, Place.DISTURBANCE):
        return True
    if effect.reads_inertia and joint.inertia is None and not mechanism.has_short_inverse:
        return False
    if joint.stiffness == 0 and (effect.spring is not None or effect.deflection is not None):
        return False
    return not effect.needs_inertia or joint.inertia is not None or mechanism.moves_inertia(joint.motion)


def _has_two_loads(mechanism: Mechanism, joint: Joint) -> bool:
    """Return True if a joint carries a drive, and a weight or a spring as well."""
    resists = (mechanism.resisted_by(joint), joint.stiffness, joint.force)
    return bool(mechanism.driven_by(joint) != 0 and any(part != 0 for part in resists))


def _suits_controller(effect: Effect, controller: Controller) -> bool:
    """Return False for an effect of the drive under another name, or of this controller."""
    if effect.command_delay is not None or _is_filter_of_command(effect):
        return not controller.in_force  # There it is a delay or a lag of the drive.
    reads_command = effect.reads(symbols.command)
    if not effect.states and not reads_command and controller.error == controller.output:
        return controller.in_force  # Else it is a dead zone or a saturation of the drive.
    if reads_command or effect.reads(symbols.error):
        return True
    # Of the output alone: an integral of it beside that of the error, and a saturation beside that of the drive.
    return controller.error != controller.output if effect.states else controller.in_force


def _is_filter_of_command(effect: Effect) -> bool:
    """Return True for a linear filter before the command of a controller."""
    rates = (derivative(state.rate, symbols.command) for state in effect.states)
    return effect.command is not None and not any(rate.has(symbols.command) for rate in rates)

"""Insertion of effects into the equations of a rig: one pass along its places, which builds an `EquationTree`.

At a drive: ``signal -> delays -> static effects and lags -> generalized force``. Its controller comes before that, or last where
the law is the force. At a joint: ``motion -> effects on deflection -> spring -> effects on its torque``, and other torques in
parallel. At a sensor: ``reading -> effects -> delays``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy as sp

from rigsight.effects import Effect, Energy, Place
from rigsight.effects import symbols as canonical
from rigsight.effects.symbols import derivative, rate_along
from rigsight.rigs import Controller, Drive, Joint, Rig, Sensor, force_symbol, reading_symbol
from rigsight.simulate.equations.binder import Binder, DefinedSignals
from rigsight.simulate.equations.structure import ahead_name, bandwidth_name, input_symbols
from rigsight.simulate.equations.tree import (
    EquationsOfMotion,
    EquationTree,
    FirstOrderState,
    Kind,
    Output,
    equations_of_motion,
    late,
    measured_before,
    observer_acceleration,
    shifted,
)
from rigsight.units import at_place, size_of

_OUTPUT = sp.Symbol("output of a controller", real=True)


def equation_tree(
    rig: Rig,
    effects: tuple[Effect, ...],
    symbols: Mapping[str, sp.Symbol],
    unique: Mapping[tuple[str, str], str],
    fixed: Mapping[str, float],
    offsets: tuple[str, ...] = (),
    observed: tuple[str, ...] = (),
) -> EquationTree:
    """Return the equations of a rig with effects."""
    bandwidths = {sensor: symbols[bandwidth_name(sensor)] for sensor in observed}
    ahead = {s: symbols[ahead_name(s)] for s in observed if ahead_name(s) in symbols}
    return _Path(Binder(rig, symbols, unique, fixed), rig, effects, offsets, bandwidths, ahead).tree()


def bound_to(
    rig: Rig, symbols: Mapping[str, sp.Symbol], expressions: Sequence[sp.Expr]
) -> tuple[sp.Expr, ...]:
    """Return expressions of a rig's declaration in the symbols of its structure, with drives and sensors without effects."""
    return _Path(Binder(rig, symbols, {}, {}), rig, ()).bound(expressions)


class _Path:
    """Collects definitions and states while it follows the signals from the inputs to the sensors."""

    def __init__(
        self,
        binder: Binder,
        rig: Rig,
        effects: tuple[Effect, ...],
        offsets: tuple[str, ...] = (),
        bandwidths: Mapping[str, sp.Symbol] | None = None,
        ahead: Mapping[str, sp.Symbol] | None = None,
    ) -> None:
        self._binder, self._defined = binder, DefinedSignals(binder, rig)
        self._rig, self._effects = rig, effects
        self._bandwidths, self._ahead = bandwidths or {}, ahead or {}
        self._shown: dict[str, tuple[sp.Expr, sp.Expr]] = {}
        """Reading of each sensor of the observer, and its delay."""
        self._offsets = {name: sp.Symbol(f"offset of {name}", real=True) for name in offsets}
        self._read = _read_by_laws(rig)

    def tree(self) -> EquationTree:
        """Walk the path."""
        mechanism = self._rig.mechanism
        drives = {drive.name: drive for drive in mechanism.drives}
        sensors = {sensor.name: sensor for sensor in mechanism.sensors}
        lags: list[FirstOrderState] = []
        of_sensors: list[FirstOrderState] = []
        memories: list[FirstOrderState] = []
        readings: dict[str, tuple[sp.Expr, ...]] = {}
        of_joints = {force_symbol(joint.name) for joint in mechanism.joints}
        last = [n for n in mechanism.order if n in sensors and sensors[n].reads.free_symbols & of_joints]
        for name in mechanism.order:
            if name in drives:
                lags += self._drive(drives[name])
            elif name not in last:
                readings[name] = self._sensor(sensors[name], {}, of_sensors)
        resisting = {joint.name: self._joint(joint, memories) for joint in mechanism.joints}
        followers = self._followers()
        for name in last:
            readings[name] = self._sensor(sensors[name], resisting, of_sensors)
        shifts = [FirstOrderState(s, (sp.Integer(0),), at_place("x", n)) for n, s in self._offsets.items()]
        states = (*followers, *memories, *lags, *of_sensors, *shifts)
        definitions, motion = tuple(self._defined.definitions), EquationsOfMotion()
        if mechanism.free:
            pulled = self._observer(states) if self._bandwidths else None
            motion = equations_of_motion(self._rig, self._defined.bound, resisting, pulled)
        outputs = tuple(Output(sensor.name, readings[sensor.name]) for sensor in mechanism.sensors)
        return EquationTree(self._inputs(), definitions, motion, states, outputs)

    def bound(self, expressions: Sequence[sp.Expr]) -> tuple[sp.Expr, ...]:
        """Return expressions with drives and sensors replaced by their definitions, without forces of joints."""
        mechanism = self._rig.mechanism
        drives = {drive.name: drive for drive in mechanism.drives}
        sensors = {sensor.name: sensor for sensor in mechanism.sensors}
        for name in mechanism.order:
            if name in drives:
                self._drive(drives[name])
            else:
                self._sensor(sensors[name], {}, [])
        bound = tuple(self._defined.bound(expression) for expression in expressions)
        return tuple(map(self._defined.flattened, bound))

    def _inputs(self) -> tuple[sp.Symbol, ...]:
        mechanism, found = self._rig.mechanism, list[sp.Symbol]()
        for index, name in enumerate(mechanism.inputs):
            found += input_symbols(index)[: 2 if name in mechanism.prescribing else 1]
        for index in range(len(self._bandwidths)):
            found += input_symbols(len(mechanism.inputs) + index)
        return tuple(found)

    def _observer(self, states: Sequence[FirstOrderState]) -> sp.Matrix:
        """Return the accelerations by which an observer follows the measured readings, shape (n_degrees, 1)."""
        mechanism = self._rig.mechanism
        sensors = {sensor.name: sensor for sensor in mechanism.sensors}
        rates = {c.symbol: c.rate for c in mechanism.free} | {state.symbol: state.rate for state in states}
        found = sp.zeros(len(mechanism.free), 1)
        for place, (name, bandwidth) in enumerate(self._bandwidths.items(), len(mechanism.inputs)):
            reading, delay = self._shown[name]
            shown = self._defined.flattened(reading)
            found += observer_acceleration(
                mechanism.free,
                self._defined.bound(sensors[name].reads),
                (reading, rate_along(shown, rates)),
                measured_before(input_symbols(place), delay - self._ahead.get(name, sp.Integer(0))),
                bandwidth,
            )
        return found

    def _at(self, place: str, *kinds: Place) -> list[Effect]:
        return [e for e in self._effects if e.place in kinds and self._rig.acts_at(e) == place]

    def _drive(self, drive: Drive) -> list[FirstOrderState]:
        """Chain the effects of a drive and of its controller: the one that computes its signal acts before it."""
        # In the controller: ``command -> delays -> filters -> law -> what is added to it -> limits``.
        effects, own = self._at(drive.name, Place.CONTROLLER), sp.Symbol(drive.name, real=True)
        law = self._rig.controllers[drive.name] if effects else None
        states: list[FirstOrderState] = []
        lags: list[FirstOrderState] = []
        if law is None or law.in_force:
            source = self._defined.bound(drive.signal)
        else:
            _, output = self._controlled(law, effects, {}, states)
            source = self._defined.bound(law.limited(_OUTPUT)).xreplace({_OUTPUT: output})
        source = self._sent(drive, source, lags)
        if law is not None and law.in_force:
            before, output = self._controlled(law, effects, {own: source}, states)
            source = source + output - before
        self._defined.stands_for(own, source)
        return [*states, *lags]

    def _controlled(
        self,
        law: Controller,
        effects: Sequence[Effect],
        own: Mapping[sp.Symbol, sp.Expr],
        states: list[FirstOrderState],
    ) -> tuple[sp.Expr, sp.Expr]:
        """Return the output of a controller without and with its effects."""
        parts = [self._defined.bound(part).xreplace(own) for part in (law.output, law.error, law.command)]
        before = parts[0]
        for effect in effects:
            if effect.command_delay is not None:
                delay = self._binder.effect(effect, effect.command_delay, {})
                symbols = [input_symbols(i)[0] for i in range(len(self._rig.mechanism.inputs))]
                read = [symbol for symbol in symbols if symbol in before.free_symbols]
                arriving = {
                    value: self._defined.define(Kind.DRIVE, effect, late(value, delay), of=" " * number)
                    for number, value in enumerate(read)
                }
                parts = [part.xreplace(arriving) for part in parts]
        output, error, command = parts
        for effect in effects:
            if effect.command is not None:
                own_command = {"command": command}
                followed = self._defined.changed(Kind.DRIVE, effect, effect.command, own_command, states)
                output, error, command = output + followed - command, error + followed - command, followed
        for effect in effects:
            if effect.control is not None:
                signals = {"output": output, "error": error, "command": command}
                output = self._defined.changed(Kind.DRIVE, effect, effect.control, signals, states)
        return before, output

    def _sent(self, drive: Drive, source: sp.Expr, lags: list[FirstOrderState]) -> sp.Expr:
        """Chain the actuator effects, delays first, because static effects and lags may as well act on the delayed signal."""
        source = self._defined.name(Kind.DRIVE, drive.name, source)
        effects = self._at(drive.name, Place.ACTUATOR)
        for effect in effects:
            if effect.delay is not None:
                delay = self._binder.effect(effect, effect.delay, {})
                source = self._defined.define(Kind.DRIVE, effect, late(source, delay))
        for effect in effects:
            if effect.drive is not None:
                # The speed is that of the drive's own shaft, not of a joint.
                speed = self._defined.bound(self._rig.mechanism.rate(drive.along))
                signals = {**self._of_motion(), "u": source, "v": speed}
                source = self._defined.changed(Kind.DRIVE, effect, effect.drive, signals, lags)
        return source

    def _joint(self, joint: Joint, memories: list[FirstOrderState]) -> tuple[sp.Expr, ...]:
        """Return the forces that resist the motion of a joint; the states of its effects are appended."""
        signals = self._signals(joint)
        effects = self._at(joint.name, Place.DYNAMICS, Place.DISTURBANCE)
        spring, squeezed = self._spring(effects, signals, memories)
        at_rest = {c.rate: sp.S.Zero for c in self._rig.mechanism.coordinates}
        carried, torques = [spring, self._defined.bound(joint.force.xreplace(at_rest))], []
        # The load of a joint must be known before effects that depend on it.
        for effect in sorted(effects, key=lambda effect: effect.reads(canonical.load)):
            if effect.torque is None:
                continue
            if effect.reads(canonical.load):
                # Effects on the springs of other joints are left out, because the loads of two joints may depend on each other.
                load = sp.Add(self._defined.bound(self._rig.mechanism.carried_by(joint)), *carried)
                signals = {
                    **signals,
                    "load": self._defined.define(Kind.LOAD, effect, load),
                    "damped": self._defined.bound(joint.damping) * signals["v"],
                }
            torque = self._defined.changed(Kind.TORQUE, effect, effect.torque, signals, memories)
            if effect.energy is Energy.CONSERVATIVE:
                carried.append(torque)
            torques.append(torque)
        damped = squeezed if joint.damps_spring else signals["v"]
        damping, force = self._defined.bound(joint.damping) * damped, self._defined.bound(joint.force)
        return tuple(term for term in (damping, spring, *torques, force) if term != 0)

    def _signals(self, joint: Joint) -> dict[str, sp.Expr]:
        """Return the signals of the motion of a joint that effects use."""
        mechanism = self._rig.mechanism
        x = self._defined.bound(joint.motion) - self._defined.bound(joint.rest)
        rate = mechanism.rate(joint.motion)
        signals = {
            "x": x,
            "v": self._defined.bound(rate),
            "k": self._defined.bound(joint.stiffness),
            "position": self._defined.bound(joint.motion),
            "driven": self._defined.bound(mechanism.driven_by(joint)),
        }
        if not any(derivative(joint.motion, c.symbol) != 0 for c in mechanism.free):
            signals["acceleration"] = self._defined.bound(mechanism.prescribed_rate(rate))
        if not any(effect.reads_inertia for effect in self._effects):
            return signals
        inertia = joint.inertia
        if inertia is None and mechanism.has_short_inverse:
            inertia = mechanism.inertia_along(joint.motion)
        if inertia is not None:
            signals["m"] = self._defined.bound(inertia)
        return signals

    def _of_motion(self) -> dict[str, sp.Expr]:
        """Return the signals of the motion for effects at a drive, a sensor or a state: those of the first joint."""
        return self._signals(self._rig.mechanism.first_joint)

    def _spring(
        self, effects: Sequence[Effect], signals: Mapping[str, sp.Expr], memories: list[FirstOrderState]
    ) -> tuple[sp.Expr, sp.Expr]:
        """Chain the effects between displacement and spring, then those on the spring's torque."""
        deflection, rate = signals["x"], signals["v"]
        for effect in effects:
            if effect.deflection is not None:
                own = self._defined.states(effect, {**signals, "x": deflection, "v": rate})
                before = sp.Symbol("deflection_before", real=True)
                after = self._binder.effect(effect, effect.deflection, {**signals, "x": before})
                rate = derivative(after, before).xreplace({before: deflection}) * rate
                rate += rate_along(after, {state.symbol: state.limited_rate for state in own})
                deflection = self._defined.define(
                    Kind.DEFLECTION, effect, after.xreplace({before: deflection})
                )
                rate = self._defined.define(Kind.DEFLECTION_RATE, effect, rate, rate_of=deflection)
                memories += own
        torque = signals["k"] * deflection
        for effect in effects:
            if effect.spring is not None:
                chained = {
                    **signals,
                    "spring_torque": torque,
                    "deflection": deflection,
                    "deflection_rate": rate,
                }
                torque = self._defined.changed(Kind.SPRING, effect, effect.spring, chained, memories)
        return torque, rate

    def _followers(self) -> list[FirstOrderState]:
        """Return the rig's own states; effects change the rate of the state that follows the motion."""
        follower, found = self._rig.follower, []
        for state in self._rig.mechanism.states:
            if follower is None or state.symbol != follower.symbol:
                rate = self._defined.bound(state.rate)
                found.append(FirstOrderState(state.symbol, (rate,), size_of(state.name)))
                continue
            signals = {
                **self._of_motion(),
                "creepage": self._defined.bound(follower.creepage),
                "creep_gain": self._defined.bound(follower.gain),
                "lateral_displacement": self._defined.bound(follower.displacement),
                "lateral_feedback": self._defined.bound(follower.feedback),
            }
            linear, changes = signals["creep_gain"] * signals["creepage"], []
            # Each effect defines the whole rate; of several effects, the differences from the linear rate are added.
            for effect in (e for e in self._effects if e.lateral is not None):
                change = self._binder.effect(effect, effect.lateral, signals) - linear
                changes.append(self._defined.define(Kind.LATERAL, effect, change))
            found.append(FirstOrderState(state.symbol, (linear, *changes), "length"))
        return found

    def _sensor(
        self, sensor: Sensor, resisting: Mapping[str, tuple[sp.Expr, ...]], states: list[FirstOrderState]
    ) -> tuple[sp.Expr, ...]:
        """Chain the sensor effects, delays last, because the simulation itself may not need the delayed reading."""
        effects = self._at(sensor.name, Place.SENSOR)
        forces = {force_symbol(name): terms for name, terms in resisting.items()}
        shift = self._offsets.get(sensor.name, sp.Integer(0))
        if not effects and sensor.reads in forces:
            return (*forces[sensor.reads], *([shift] if shift != 0 else []))
        reading = shift + self._defined.bound(sensor.reads).xreplace(
            {force: sp.Add(*terms) for force, terms in forces.items()}
        )
        for effect in effects:
            if effect.measured is not None:
                signals = {**self._of_motion(), "reading": reading}
                reading = self._defined.changed(Kind.READING, effect, effect.measured, signals, states)
        delays = [
            (effect, self._binder.effect(effect, effect.reading_delay, {}))
            for effect in effects
            if effect.reading_delay is not None
        ]
        if sensor.name in self._bandwidths:
            self._shown[sensor.name] = (reading, sp.Add(*(delay for _, delay in delays)))
        for effect, delay in delays:
            if not effect.shifts_the_record:
                reading = self._defined.define(Kind.READING, effect, late(reading, delay))
        if reading_symbol(sensor.name) in self._read:
            reading = self._defined.name(Kind.READING, sensor.name, reading)
        self._defined.stands_for(reading_symbol(sensor.name), reading)
        for effect, delay in delays:
            if effect.shifts_the_record:
                reading = self._defined.define(Kind.READING, effect, shifted(reading, delay))
        return (reading,)


def _read_by_laws(rig: Rig) -> frozenset[sp.Symbol]:
    """Return the symbols used by control laws, signals, states, joint forces and sensors, among them those of sensors."""
    mechanism = rig.mechanism
    laws = [drive.signal for drive in mechanism.drives] + [drive.force for drive in mechanism.drives]
    laws += [*mechanism.signals.values(), *(state.rate for state in mechanism.states)]
    laws += [*(joint.force for joint in mechanism.joints), *(sensor.reads for sensor in mechanism.sensors)]
    return frozenset().union(*(law.free_symbols for law in laws))

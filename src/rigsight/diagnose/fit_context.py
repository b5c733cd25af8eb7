"""What every candidate is fitted and scored with, and how it follows from a campaign: records, scales, noise, free parameters."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from rigsight.campaign import Campaign
from rigsight.diagnose.policy import HORIZON
from rigsight.effects import Effect, Place, placed
from rigsight.effects import symbols as canonical
from rigsight.identify import (
    DEFAULT_ACCURACY,
    FitMemory,
    FitResult,
    GreyBoxFit,
    IdleThreads,
    characteristic_scales,
    free_names,
    linear_start,
    swallowed_by_offsets,
)
from rigsight.identify.fit.fit_data import Prior
from rigsight.identify.fit.windows import (
    Observer,
    Windowing,
    cut,
    followed_sensors,
    liveliest,
    strongest,
    until_rest,
)
from rigsight.inverse import NumbersBeside, numbers_along_motion
from rigsight.records.record import Floats, Record
from rigsight.records.signals import is_constant
from rigsight.rigs import Rig, joint_of
from rigsight.simulate import Structure, compose, special_values, structure_of_fit

Prepare = Callable[[Sequence[Structure]], None]
"""Called with the structures that are about to be simulated, to compile them side by side."""

_ROUGH_ACCURACY = 1e-3
_FINE_TOLERANCE = 1e-7


@dataclass(frozen=True)
class FittedModel:
    """A fitted model with its residuals on the records that score it."""

    effects: tuple[Effect, ...]  # the effects added
    fit: FitResult  # the fit to the estimation records
    # The same numbers on the scoring records, only initial states fitted; without residuals where they cannot be simulated.
    held_out: FitResult
    error_over_noise: float  # RMS of the residuals in units of the noise floor
    along_motion: bool = False  # whether the numbers of its effect are those along the measured motion, which no simulation sees

    @property
    def residuals(self) -> tuple[Floats, ...]:
        """Per scoring record, shape (n_samples, n_outputs), NaN where an output was not measured."""
        return self.held_out.residuals

    @property
    def initial_states(self) -> tuple[Floats, ...]:
        """Of the equations, per scoring record."""
        return self.held_out.rig_states

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return tuple(effect.name for effect in self.effects)

    def not_simulated(self) -> FittedModel:
        """Return the same as a model that cannot be simulated on the scoring records."""
        return replace(self, held_out=replace(self.held_out, residuals=()), error_over_noise=float("inf"))

    @property
    def n_free(self) -> int:
        """Number of fitted parameters."""
        return len(self.fit.free)


@dataclass(frozen=True)
class FitContext:
    """What every candidate is fitted and scored with."""

    rig: Rig
    # Records to fit and records to score, already cut into windows where that is needed.
    estimation: tuple[Record, ...]
    scoring: tuple[Record, ...]
    # The most excited stretch of each estimation record, for the first fit from each start.
    look: tuple[Record, ...]
    scales: Mapping[str, float]  # size of each base quantity
    noise: Mapping[str, float]  # noise floor of each output
    # Parameters of the rig that are held in all fits (such as those of an absent spring or of outputs that were not measured).
    held: frozenset[str]
    # Values before any fit, from the given simulation or a regression: fits without the effect may distort them too much.
    start: Mapping[str, float] = field(default_factory=dict)
    given: Mapping[str, float] = field(default_factory=dict)  # parameters of the rig in the given simulation
    # Effects already in the given simulation; every candidate is added to them.
    modelled: tuple[Effect, ...] = ()
    memory: FitMemory | None = None  # where the outcomes of fits are kept
    compiler: Prepare | None = None  # compiles side by side what is about to be fitted
    threads: IdleThreads = field(default_factory=IdleThreads)  # threads that help with the records of a fit
    # Where simulations track the sensors and the motion shows the forces: fits must hold along the motion, too.
    along_motion: NumbersBeside | None = None
    error_of_force: float = 0.0  # what the missing force causes in a simulation, in units of the noise floor

    @cached_property
    def records(self) -> tuple[Record, ...]:
        """All records, each once."""
        return self.estimation if self.scoring == self.estimation else (*self.estimation, *self.scoring)

    def prepare(self, structures: Iterable[Structure]) -> None:
        """Compile structures side by side that are about to be fitted."""
        if self.compiler is not None:
            self.compiler([structure_of_fit(s, (*self.estimation, *self.scoring)) for s in structures])

    @cached_property
    def floors(self) -> Floats:
        """Noise floor of each output of the rig in order; infinite for one that was never measured, shape (n_outputs,)."""
        return np.array([self.noise.get(signal.name, np.inf) for signal in self.rig.outputs])

    @property
    def period(self) -> float:
        """Natural period of the rig, or the typical one of its motion [s]."""
        return float(2.0 * np.pi * self.scales["time"])

    @cached_property
    def look_in_pieces(self) -> tuple[tuple[Record, ...], ...]:
        """Pieces of each of the most excited stretches: an inaccurate model stays in phase with the motion in them."""
        return tuple(self.cut_in_pieces([record], HORIZON.piece) for record in self.look)

    def cut_in_pieces(self, records: Sequence[Record], periods: float) -> tuple[Record, ...]:
        """Cut records into pieces of so many periods of the rig, longer where they would be too many."""
        duration = sum(record.n_samples * record.dt for record in records)
        most = HORIZON.most_pieces / max(1, len(self.rig.mechanism.free))
        return cut(records, max(periods * self.period, duration * len(self.look) / len(records) / most))

    def looking_at_residual(self, fit: FitResult) -> FitContext:
        """Return the same, with the stretch of each estimation record that has the largest residual of a fit as `look`."""
        # What one more effect would explain may lie far from the strongest motion, such as a second resonance.
        if len(fit.residuals) != len(self.estimation):
            return self
        weights = np.array([1.0 / self.noise[signal.name] for signal in self.rig.outputs])
        remainder = [np.nansum((residual * weights) ** 2, axis=1) for residual in fit.residuals]
        return replace(self, look=strongest(self.estimation, remainder, HORIZON.examined))

    def problem(
        self, structure: Structure, records: Sequence[Record], accuracy: float = DEFAULT_ACCURACY
    ) -> GreyBoxFit:
        """Return the fit of a structure to records, with the bench's scales and noise."""
        prior = None
        if self.along_motion is not None:
            # A force that the numbers leave along the measured motion costs what it causes in a simulation.
            found = self.along_motion.beside([e for e in structure.effects if e not in self.modelled])
            prior = Prior(found.names, found.values, self.error_of_force**2 * found.curvature)
        return GreyBoxFit(
            structure, records, self.scales, self.noise, accuracy, self.memory, self.threads, prior
        )

    def composed(self, effects: Iterable[Effect] = (), fixed: Mapping[str, float] | None = None) -> Structure:
        """Return the equations of the given simulation with effects added."""
        return compose(self.rig, (*self.modelled, *effects), fixed)

    def simplest(self, effects: Sequence[Effect], like: Structure | None = None) -> Structure:
        """Return the same with parameters of these effects at the values that make the equations shorter."""
        # A parameter that another structure with its effect left free stays free.
        return self.composed(effects, special_values(self.rig, effects, self.modelled, like))

    def free_parameters(self, structure: Structure) -> list[str]:
        """Return what a fit of this structure moves from the start."""
        names = {p.name for p in self.rig.parameters} - self.held
        if self.rig.has_one_motion and self.rig.is_driven:
            rest = {symbol.name for symbol in self.rig.motion.rest.free_symbols}
            if not self.has_stiffness and not any(_sees_position(e) for e in structure.effects):
                names -= rest
            elif rest:
                # A linear spring cannot tell a constant force from a shifted rest position.
                names -= self._bias
        held = self.constant_forces_beside(structure.effects).keys()
        return [name for name in free_names(structure, names) if name not in held]

    def constant_forces_beside(self, effects: Iterable[Effect]) -> dict[str, float]:
        """Return the values at which constant forces are held beside effects with a mean force of their own."""
        held: dict[str, float] = {}
        for effect in effects:
            held |= self._known_constant_forces(effect) or {}
        return held

    def _known_constant_forces(self, effect: Effect) -> dict[str, float] | None:
        has_stiffness = not (self.rig.has_one_motion and self.rig.is_driven) or self.has_stiffness
        return known_constant_forces(self.rig, effect, self.given, has_stiffness)

    def leaves_numbers_open(self, fit: FitResult) -> bool:
        """Return True if a fit leaves a mass, a stiffness or a damping undetermined: a missing effect may have distorted it."""
        return any(
            name in self.rig.usually_positive and not fit.standard_errors[name] < abs(fit.values[name])
            for name in fit.free
        )

    def releasable_parameters(self, structure: Structure) -> list[str]:
        """Return the parameters freed after a first fit: a constant force, if an asymmetric spring determines it."""
        # A symmetric spring does not distinguish them: a shift changes its slope, which is already free.
        bent = any(_sees_position(e) and not e.signature.even_harmonics for e in structure.effects)
        even = any(_sees_position(e) and e.signature.even_harmonics for e in structure.effects)
        if not (self.rig.has_one_motion and self.rig.is_driven and self.has_stiffness and bent and not even):
            return []
        return sorted(self._bias - self.held)

    @property
    def _bias(self) -> set[str]:
        return {symbol.name for symbol in self.rig.motion.bias.free_symbols}

    @property
    def has_stiffness(self) -> bool:
        """True for a rig of one motion with a spring."""
        return not {symbol.name for symbol in self.rig.motion.stiffness.free_symbols} <= self.held

    def offered(self, effects: Iterable[Effect]) -> list[Effect]:
        """Return the effects that apply to this rig and these records, each at each place."""
        # Excluded are effects of the spring if there is none, effects of a drive whose input is constant, and effects with a mean
        # force if the constant force is unknown.
        offered = [
            effect
            for effect in candidates_on(self.rig, effects, self.modelled)
            if self._can_show(effect) and self._known_constant_forces(effect) is not None
        ]
        if not self.rig.has_one_motion:
            return offered
        return [
            effect
            for effect in offered
            if effect not in self.modelled
            and (effect.lateral is None or not self.rig.downstream_parameters <= self.held)
            and (self.has_stiffness or (effect.spring is None and effect.deflection is None))
        ]

    def _can_show(self, effect: Effect) -> bool:
        if effect.place is not Place.ACTUATOR or not self.rig.inputs:
            return True
        place = self.rig.acts_at(effect)
        drive = next(drive for drive in self.rig.mechanism.drives if drive.name == place)
        reported = {str(symbol) for symbol in drive.signal.free_symbols}
        if not reported <= {signal.name for signal in self.rig.inputs}:
            return True
        records = (*self.estimation, *self.scoring)
        return any(not is_constant(record[name]) for record in records for name in reported)

    def score(
        self,
        effects: tuple[Effect, ...],
        fit: FitResult,
        roughly: bool = False,
        tolerance: float = _FINE_TOLERANCE,
    ) -> FittedModel:
        """Simulate the scoring records with a fitted model; only their initial states are estimated."""
        # `roughly` is sufficient to rank a model that is far from the best. The tolerance is that of the initial states: those of
        # a fit that was stopped early need not be exact.
        if roughly:
            rough = self.problem(fit.structure, self.scoring, _ROUGH_ACCURACY)
            result = rough.fit(
                fit.values, [], max_evaluations=HORIZON.rough_evaluations_of_rig, tolerance=_ROUGH_ACCURACY
            )
        else:
            result = self.problem(fit.structure, self.scoring).fit(fit.values, [], tolerance=tolerance)
        error_over_noise = result.weighted_rms if result.residuals else float("inf")
        return FittedModel(effects, fit, result, error_over_noise)

    def on_all_records(self, model: FittedModel) -> FitResult:
        """Return the residuals of a model on `records` with refitted initial states; parameters are not refitted."""
        if self.scoring == self.estimation:
            return model.held_out
        parts = (model.fit, model.held_out)
        return replace(
            model.fit,
            residuals=tuple(r for part in parts for r in part.residuals),
            initial_states=tuple(s for part in parts for s in part.initial_states),
            substeps=tuple(n for part in parts for n in part.substeps),
        )


def _sees_position(effect: Effect) -> bool:
    expressions = [e for e in (effect.torque, effect.deflection) if e is not None]
    return any(canonical.x in expression.free_symbols for expression in expressions)


def known_constant_forces(
    rig: Rig, effect: Effect, given: Mapping[str, float], has_stiffness: bool
) -> dict[str, float] | None:
    """Return the values at which the constant forces are held while an effect is fitted."""
    if not effect.holds_constant_force:
        return {}
    joint = joint_of(rig, effect)
    names = rig.constant_forces_at(joint)
    resting = {symbol.name for symbol in joint.rest.free_symbols}
    defaults = {p.name: p.default for p in rig.parameters if p.name not in resting and p.default is not None}
    known = {**defaults, **given}
    needed = [name for name in names if has_stiffness or name not in resting]
    if any(name not in known for name in needed):
        return None
    return {name: known[name] for name in names if name in known}


def candidates_on(rig: Rig, effects: Iterable[Effect], modelled: Iterable[Effect] = ()) -> list[Effect]:
    """Return effects at the places of a rig, in the order of the effects, without those that the simulation has already.

    An effect that has a place keeps it. On one mass or one element each effect has only one place, so its name needs no place;
    only of several sensors the further ones are named.
    """
    there = {effect.name for effect in modelled}
    found = []
    for effect in effects:
        if effect.at is not None:
            found.append(effect)
        elif rig.has_one_motion:
            further = rig.sensors_of_motion[1:] if effect.place is Place.SENSOR else ()
            found += [effect, *(placed(effect, sensor.name) for sensor in further)]
        else:
            found += [placed(effect, place) for place in _places(rig, effect)]
    return [effect for effect in found if rig.offers(effect) and effect.name not in there]


def _places(rig: Rig, effect: Effect) -> tuple[str, ...]:
    places = rig.places(effect.place)
    # What comes from outside and not from a motion is the same force at each joint of one coordinate: the first stands for them.
    if effect.place is not Place.DISTURBANCE:
        return places
    motions = {joint.name: joint.motion for joint in rig.mechanism.joints}
    return tuple({motions[place]: place for place in reversed(places)}.values())[::-1]


def fit_context_of(
    campaign: Campaign,
    noise: Mapping[str, float],
    windowing: Windowing,
    memory: FitMemory | None,
    threads: IdleThreads,
    start: Mapping[str, float],
    compiler: Prepare | None = None,
) -> FitContext:
    """Return the context in which candidates of a campaign are fitted and scored."""
    fitted = windowing.cut(campaign.estimation)
    held = frozenset(_set_aside(campaign))
    if campaign.rig.has_one_motion and not all(
        any(symbol.name in record for record in campaign.estimation) for symbol in campaign.rig.downstream
    ):
        held |= campaign.rig.downstream_parameters  # these records do not determine them
    asked = [p.name for p in campaign.rig.parameters if p.name not in held]
    scales = characteristic_scales(campaign.rig, campaign.estimation, start)
    held |= frozenset(
        swallowed_by_offsets(compose(campaign.rig), campaign.estimation, scales, noise, start, asked)
    )
    return FitContext(
        rig=campaign.rig,
        estimation=fitted,
        look=liveliest(until_rest(fitted, campaign.rig), campaign.rig, HORIZON.examined),
        scoring=windowing.cut(campaign.validation or campaign.estimation),
        scales=scales,
        noise=noise,
        held=held,
        start=start,
        given=campaign.given,
        modelled=campaign.modelled,
        memory=memory,
        compiler=compiler,
        threads=threads,
    )


def structures_to_fit(campaign: Campaign, structures: Iterable[Structure]) -> list[Structure]:
    """Return structures as they are simulated in fits to the records of a campaign: with free offsets and with an observer."""
    sensors = followed_sensors(campaign.rig, campaign.records) if campaign.drifts else ()
    records = Observer(sensors, bandwidth=0.0).following(campaign.records)
    return [structure_of_fit(structure, records) for structure in structures]


def start_values_of(campaign: Campaign) -> dict[str, float]:
    """Return values of all constants and parameters before any fit."""
    held = _set_aside(campaign)
    rig, given = campaign.rig, {**campaign.constants, **campaign.given, **held}
    along = None
    if not rig.has_one_motion and all(p.name in given for p in rig.parameters):
        along = numbers_along_motion(campaign, given)
    regressed = along or linear_start(rig, campaign.estimation, campaign.constants, held)
    # Numbers fitted without the effects that the simulation has are farther off than those it came with.
    sure = campaign.given if campaign.modelled or rig.mechanism.bodies_are_nonlinear else {}
    return {**campaign.constants, **regressed, **sure}


def _set_aside(campaign: Campaign) -> dict[str, float]:
    """Return the values of an absent spring and of one number of a factor that is open."""
    held = {} if campaign.absent_spring is None else {campaign.absent_spring: 0.0}
    if campaign.open_factor is not None:
        held[campaign.open_factor.held] = campaign.open_factor.value
    return held

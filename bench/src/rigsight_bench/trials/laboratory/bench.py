"""Motion of a stand, its records, and the gap of the equations without its effects."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rigsight.effects import Effect, effect_named, kind_of, placed
from rigsight.errors import SimulationError
from rigsight.identify import FitResult, characteristic_scales
from rigsight.identify.fit.windows import cut, window_length
from rigsight.records import Record
from rigsight.records.signals import typical_size
from rigsight.rigs import Rig, evaluated
from rigsight.simulate import Structure, compose, simulate
from rigsight_bench.trials.fitted import fitted, largest_left, left_of
from rigsight_bench.trials.laboratory.channels import in_steps, sampled
from rigsight_bench.trials.laboratory.runs import before
from rigsight_bench.trials.laboratory.stands import (
    PUSH,
    STANDS,
    TOLD,
    WARMTH,
    Stand,
    wired_numbers,
    wired_rig,
)
from rigsight_bench.trials.laboratory.subjects import LaboratorySubject
from rigsight_bench.trials.laboratory.surroundings import LEAST_BESIDE, Surroundings
from rigsight_bench.trials.runs import DT, Run
from rigsight_bench.trials.strength import GAPS, Sized, draw_shape, scaled, sized
from rigsight_bench.trials.waveforms import low_pass_noise

Floats = NDArray[np.float64]

FINER = 4
"""Samples of the plant's inputs for one of the records: between theirs it follows the inputs themselves."""
_ACCURACY = 1e-7
"""Relative: far below the noise."""
_EVERY = 30.0
"""Time from one record's begin to the next [s]: it is stored in between, and the rig goes on warming up."""


@dataclass(frozen=True)
class LaboratoryBench:
    """A stand without effects, its surroundings and its experiments."""

    subject: LaboratorySubject
    values: Mapping[str, float]
    around: Surroundings
    runs: Sequence[Run]

    @property
    def stand(self) -> Stand:
        """The test stand."""
        return STANDS[self.subject.stand]

    @property
    def rig(self) -> Rig:
        """The rig that the campaign names."""
        return self.stand.rig

    @cached_property
    def _wired(self) -> Rig:
        return wired_rig(self.rig, self.around.law, self.around.softening)

    @cached_property
    def _undisturbed(self) -> list[Record]:
        runs = [run for run in self.runs if run.role == "estimation"]
        return [self.quiet((), {}, run) for run in runs]

    @cached_property
    def scales(self) -> dict[str, float]:
        """Size of each base quantity in the records."""
        return characteristic_scales(self.rig, self._undisturbed, self.values)

    @cached_property
    def sizes(self) -> dict[str, float]:
        """Size of each reading and of each recorded input."""
        return {
            signal.name: typical_size([r[signal.name] for r in self._undisturbed])
            for signal in (*self.rig.inputs, *self.rig.outputs)
        }

    @cached_property
    def noise(self) -> dict[str, float]:
        """Noise that a sensor adds to each reading."""
        by_size = math.hypot(self.around.noise, self.around.step / math.sqrt(12.0))
        return {signal.name: by_size * self.sizes[signal.name] for signal in self.rig.outputs}

    def quiet(self, effects: Sequence[Effect], own: Mapping[str, float], run: Run) -> Record:
        """Return the record of a run without noise, force from outside, and drift.

        Parameters
        ----------
        effects
            What is hidden.
        own
            Their parameters by their names on the rig.
        run
            The run.
        """
        fine = self._moved(effects, own, run)
        names = (*self.rig.inputs, *self.rig.outputs)
        skipped = round(before(self.subject) / DT)
        return self._record(run, {s.name: fine[s.name][::FINER][skipped:] for s in names})

    def measured(
        self,
        effects: Sequence[Effect],
        own: Mapping[str, float],
        run: Run,
        number: int,
        rng: np.random.Generator,
    ) -> Record:
        """Return the record of a run as it is measured, but for offsets of the sensors.

        Parameters
        ----------
        effects, own, run
            As of `quiet`.
        number
            How many records were taken before.
        rng
            Source of randomness.
        """
        around = self.around
        t = DT / FINER * np.arange(FINER * run.n_samples)
        outside: dict[str, Floats] = {}
        if around.push:
            size = around.push * self._drive_force(self.quiet(effects, own, run))
            outside[PUSH] = low_pass_noise(size, around.push_corner, run.n_samples * DT, rng).spline(t)
        if around.softening is not None:
            outside[WARMTH] = 1.0 - np.exp(-(t + number * _EVERY) / around.warms_up)
        fine = self._moved(effects, own, run, outside)
        noise = {s.name: around.input_noise * self.sizes[s.name] for s in self.rig.inputs}
        noise |= {s.name: around.noise * self.sizes[s.name] for s in self.rig.outputs}
        skipped = round(before(self.subject) / DT)
        seen = {
            name: sampled(fine[name], FINER, around.filter_corner, size, rng)[skipped:]
            for name, size in noise.items()
        }
        for signal in self.rig.outputs:
            seen[signal.name] = in_steps(seen[signal.name], around.step * self.sizes[signal.name])
        return self._record(run, seen)

    def _moved(
        self,
        effects: Sequence[Effect],
        own: Mapping[str, float],
        run: Run,
        outside: Mapping[str, Floats] | None = None,
    ) -> Record:
        """Return inputs and readings of the rig at fine samples; what nothing moves from outside is still."""
        there = [placed(effect_of(effect), self.rig.acts_at(effect)) for effect in effects]
        structure = compose(self._wired, there)
        named = compose(self.rig, effects)
        numbers = {**self.values, **wired_numbers(self.around.law, self.around.softening)}
        for effect, at in zip(effects, there, strict=True):
            for p in effect.parameters:
                numbers[structure.parameter_name(at, p.name)] = own[named.parameter_name(effect, p.name)]
        record = run.record(finer=FINER)
        still = {s.name: np.zeros(record.n_samples) for s in self._wired.inputs if s.name not in record}
        record = record.with_signals(**{**still, **(outside or {})})
        shown = simulate(structure, numbers, record, accuracy=_ACCURACY)
        if self.around.law is None:
            return shown
        (told,) = self.rig.inputs
        return shown.with_signals(**{told.name: shown[TOLD]})

    def _record(self, run: Run, signals: Mapping[str, Floats]) -> Record:
        first = signals[self.rig.inputs[0].name]
        largest = float(np.max(np.abs(first)))
        return Record(
            name=run.name,
            dt=DT,
            signals=dict(signals),
            units={},
            role=run.role or "validation",
            kind=run.kind,
            # What only decays has none.
            amplitude=float(f"{largest:.4g}") if largest else None,
            hold=run.hold,
        )

    def _drive_force(self, record: Record) -> float:
        """Return the RMS force of the drive, or of an element whose motion is prescribed."""
        if not self.rig.is_driven:
            return float(np.std(record[self.rig.outputs[0].name]))
        (drive,) = self.rig.mechanism.drives
        signal = record[self.rig.inputs[0].name]
        gain = evaluated(drive.force, {**self.values, drive.name: 1.0})
        return abs(gain) * float(np.sqrt(np.mean(signal**2)))

    def truth(
        self,
        effects: Sequence[Effect],
        wishes: Sequence[float],
        floor: Mapping[str, float],
        rng: np.random.Generator,
    ) -> tuple[dict[str, float], list[Sized]]:
        """Return the parameters of the effects by their names on the rig, and the size of each, scaled each by itself.

        Parameters
        ----------
        effects
            What is hidden.
        wishes
            Gap that each is to leave, in units of the floor.
        floor
            What is left of each reading without effects.
        rng
            Source of randomness.

        Raises
        ------
        SimulationError
            If one of them cannot leave the least that counts, or a further one leaves more than the main one.
        """
        together = compose(self.rig, effects)
        found: dict[str, float] = {}
        sizes: list[Sized] = []
        for effect, wished in zip(effects, wishes, strict=True):
            shape = draw_shape(effect, self.scales, rng)
            gap = functools.partial(self._gap_of, effect, floor)
            least = LEAST_BESIDE if sizes else GAPS[0]
            at = functools.partial(scaled, effect, shape, scales=self.scales)
            own = sized(effect.name, at, gap, wished, least)
            sizes.append(own)
            found |= {together.parameter_name(effect, name): value for name, value in own.values.items()}
        if max(sizes, key=lambda own: own.gap) is not sizes[0]:
            raise SimulationError(f"{effects[0].name} is not the largest of the effects.")
        return found, sizes

    def _gap_of(self, effect: Effect, floor: Mapping[str, float], own: Mapping[str, float]) -> float:
        """Return what the equations without an effect leave of two quiet records, in units of the floor."""
        alone = compose(self.rig, [effect])
        named = {alone.parameter_name(effect, name): value for name, value in own.items()}
        runs = [run for run in self.runs if run.role == "estimation" and run.kind != "step"]
        records = [self.quiet([effect], named, run) for run in runs[1:3]]
        return largest_left(self.refit(records), floor)

    def refit(self, records: Sequence[Record]) -> FitResult:
        """Return the equations without effects with the numbers that fit these records best.

        Raises
        ------
        SimulationError
            If the fit fails.
        """
        return self._fitted(compose(self.rig), records, self.values, self.free)

    def scored(self, refit: FitResult, records: Sequence[Record]) -> FitResult:
        """Return the residuals of fitted equations on other records."""
        return self._fitted(compose(self.rig), records, refit.values, ())

    def floor(
        self, effects: Sequence[Effect], own: Mapping[str, float], records: Sequence[Record]
    ) -> dict[str, float]:
        """Return what the truth leaves of each reading of measured records: noise, force from outside, drift.

        Parameters
        ----------
        effects, own
            As of `quiet`.
        records
            The records.
        """
        # Numbers that drift have no true values for all records: those that suit them best take their place.
        free = () if self.around.softening is None else self.free
        found = self._fitted(compose(self.rig, effects), records, {**self.values, **own}, free)
        return {
            name: max(size, self.noise[name]) for name, size in zip(self.noise, left_of(found), strict=True)
        }

    @property
    def free(self) -> tuple[str, ...]:
        """The numbers that a fit of these records may move; of a rig that only decays one is held."""
        held = set(self.stand.held)
        if self.subject.condition == "free_decay":
            held.add(next(p.name for p in self.rig.parameters if p.logarithmic))
        return tuple(p.name for p in self.rig.parameters if p.name not in held)

    def _fitted(
        self,
        structure: Structure,
        records: Sequence[Record],
        start: Mapping[str, float],
        free: Sequence[str],
    ) -> FitResult:
        # What drifts is compared over windows, as a diagnosis does it.
        whole = not self.stand.looped
        pieces = records if whole else cut(records, window_length(self.rig, records))
        return fitted(structure, pieces, self.scales, self.noise, start, free)


def effect_of(effect: Effect) -> Effect:
    """Return an effect without its place."""
    return effect_named(kind_of(effect.name))

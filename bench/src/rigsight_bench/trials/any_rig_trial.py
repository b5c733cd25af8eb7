"""Records and key of one trial of design ``rigs``; everything follows from seed and number.

Unlike the trials of one mass, which have a separate integrator, a rig of any shape is simulated by the accurate integrator of
`rigsight.simulate`, at a different sample time and with disturbed inputs that are not recorded.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rigsight.effects import Effect, kind_of
from rigsight.errors import SimulationError
from rigsight.identify import FitResult, GreyBoxFit, characteristic_scales
from rigsight.identify.typical_size import typical_size
from rigsight.records import Record
from rigsight.rigs import RIGS, Rig
from rigsight.simulate import compose, simulate
from rigsight.simulate.linearization import linearize
from rigsight_bench.trials.any_rig_campaign import DT, DURATION, Run, draw_runs
from rigsight_bench.trials.any_rig_numbers import draw_numbers, draw_offsets
from rigsight_bench.trials.any_rig_subjects import PlacedSubject, draw_effects, placed_subject_of
from rigsight_bench.trials.attempts import first_that_succeeds
from rigsight_bench.trials.campaign import LinearRig
from rigsight_bench.trials.draw import Trial
from rigsight_bench.trials.strength import draw_shape, sized
from rigsight_bench.trials.subjects import NOISE_SIZES, TIERS
from rigsight_bench.trials.waveforms import Disturbance, low_pass_noise

Floats = NDArray[np.float64]

_FINER = 4
"""Samples of the plant's inputs for one of the records: between theirs it follows the inputs themselves."""
_ACCURACY = 1e-7
"""Relative: far below the noise."""
_DISTURBED = (0.2, 0.5)
"""Effect of a disturbance on the sensors, in units of their noise."""
_CORNER = 5.0
"""Angular frequency above which the disturbance falls [rad/s]."""
_FIRST = 1e-3
"""Disturbance of an input, in units of the input, from whose effect its size follows."""
_OFF = (0.05, 0.2)
"""How far wrong parameters are off."""
_DIGITS = 5
"""Digits of the given simulation's parameters."""


def draw_placed_trial(seed: int, trial: int) -> Trial:
    """Draw and measure one trial of design ``rigs``.

    Parameters
    ----------
    seed
        Seed of the whole bench.
    trial
        Number of the trial.

    Raises
    ------
    SimulationError
        If no rig that was drawn can be integrated, or no effect causes a gap of the requested size.
    """
    subject = placed_subject_of(seed, trial)
    return first_that_succeeds(lambda attempt: _drawn(subject, seed, trial, attempt), seed, trial)


def _drawn(subject: PlacedSubject, seed: int, trial: int, attempt: int) -> Trial:
    streams = [np.random.default_rng(s) for s in np.random.SeedSequence([seed, trial, attempt]).spawn(6)]
    of_rig, of_effect, of_strength, of_noise, of_disturbance, of_given = streams
    rig = RIGS[subject.rig]
    effects = draw_effects(rig, subject, of_effect)
    bench = _drawn_bench(rig, NOISE_SIZES[subject.noise] * math.exp(of_noise.uniform(-0.2, 0.2)), of_rig)
    wished = None if subject.tier is None else math.exp(of_strength.uniform(*np.log(TIERS[subject.tier])))
    values, strengths = bench.truth(effects, wished, of_effect)
    records, floor = bench.measure(effects, values, of_noise, of_disturbance)
    seen = tuple(r for r, run in zip(records, bench.runs, strict=True) if run.role is not None)
    withheld = tuple(r for r, run in zip(records, bench.runs, strict=True) if run.role is None)
    refit = bench.refit([r for r in seen if r.role == "estimation"])
    given = bench.given(subject, seen, refit, of_given)
    key = {
        "schema_version": 2,
        "design": "rigs",
        "seed": seed,
        "trial": trial,
        "kind": subject.kind,
        "effects": [kind_of(effect.name) for effect in effects],
        "where": [rig.where(effect) for effect in effects],
        "rig": rig.name,
        "noise": subject.noise,
        "aimed_tier": subject.tier,
        "aimed_gap": wished,
        "gap": bench.gap([r for r in seen if r.role == "validation"], refit, floor),
        "strengths": strengths,
        "values": values,
        "noise_floor": floor,
    }
    poles = linearize(compose(rig), bench.values).poles
    vibrating = np.abs(poles[np.abs(poles.imag) > 0.0])
    return Trial(
        LinearRig(rig, bench.values, float(np.min(vibrating, initial=0.0))), given, seen, withheld, key
    )


def _drawn_bench(rig: Rig, noise: float, rng: np.random.Generator) -> _Bench:
    values = draw_numbers(rig, rng)
    runs = draw_runs(rig, values, rng)
    structure = compose(rig)
    undisturbed = [simulate(structure, values, run.record()) for run in runs if run.role == "estimation"]
    values |= draw_offsets(rig, undisturbed, values, rng)
    return _Bench(rig, values, runs, noise)


@dataclass(frozen=True)
class _Bench:
    """A rig without effects, with its experiments and the noise of its sensors in units of their readings."""

    rig: Rig
    values: dict[str, float]
    runs: Sequence[Run]
    noise_share: float

    @cached_property
    def _undisturbed(self) -> list[Record]:
        structure = compose(self.rig)
        return [simulate(structure, self.values, r.record()) for r in self.runs if r.role == "estimation"]

    @cached_property
    def scales(self) -> dict[str, float]:
        return characteristic_scales(self.rig, self._undisturbed, self.values)

    @cached_property
    def noise(self) -> dict[str, float]:
        return {
            s.name: self.noise_share * typical_size([r[s.name] for r in self._undisturbed])
            for s in self.rig.outputs
        }

    def truth(
        self, effects: Sequence[Effect], wished: float | None, rng: np.random.Generator
    ) -> tuple[dict[str, float], list[float]]:
        """Return the value of every parameter of the plant, and the strength of each effect, scaled each by itself."""
        structure = compose(self.rig, effects)
        values, strengths = dict(self.values), []
        for effect in effects:
            assert wished is not None
            shape = draw_shape(effect, self.scales, rng)
            own = sized(effect, shape, self.scales, functools.partial(self._gap_of, effect), wished)
            strengths.append(own.strength)
            for name, value in own.values.items():
                values[structure.parameter_name(effect, name)] = value
        return values, strengths

    def _gap_of(self, effect: Effect, own: Mapping[str, float]) -> float:
        """Return what the equations without an effect leave of two quiet records, in units of the sensor noise."""
        structure = compose(self.rig, [effect])
        named = {structure.parameter_name(effect, name): value for name, value in own.items()}
        records = [
            simulate(structure, {**self.values, **named}, run.record())
            for run in self.runs
            if run.role == "estimation" and run.kind in ("sweep", "multisine")
        ][-2:]
        return self._left(self.refit(records), self.noise)

    def measure(
        self,
        effects: Sequence[Effect],
        values: Mapping[str, float],
        of_noise: np.random.Generator,
        of_disturbance: np.random.Generator,
    ) -> tuple[list[Record], dict[str, float]]:
        """Return every run's record, disturbed and noisy, and the noise floor."""
        plant = _Plant(self.rig, effects, values)
        sizes = self._disturbance_sizes(plant, of_disturbance)
        records = []
        passed: dict[str, list[Floats]] = {name: [] for name in self.noise}
        for run in self.runs:
            disturbances = {
                name: low_pass_noise(size, _CORNER, DURATION, of_disturbance) for name, size in sizes.items()
            }
            calm, clean = plant.readings(run), plant.readings(run, disturbances)
            seen = {
                name: clean[name] + of_noise.normal(scale=noise, size=clean[name].size)
                for name, noise in self.noise.items()
            }
            records.append(run.record(seen))
            for name in passed:
                passed[name].append(clean[name] - calm[name])
        through = {name: math.sqrt(float(np.mean(np.concatenate(p) ** 2))) for name, p in passed.items()}
        return records, {name: math.hypot(self.noise[name], through[name]) for name in self.noise}

    def _disturbance_sizes(self, plant: _Plant, rng: np.random.Generator) -> dict[str, float]:
        """Return for each input the disturbance that all sensors show as a part of their noise, in the plant as it is."""
        run = self.runs[0]
        first = {
            name: _FIRST * float(np.max(np.abs(samples))) for name, samples in run.record().signals.items()
        }
        wanted = rng.uniform(*_DISTURBED)
        same = np.random.default_rng(0)
        disturbed = plant.readings(
            run, {name: low_pass_noise(size, _CORNER, DURATION, same) for name, size in first.items()}
        )
        calm = plant.readings(run)
        most = max(
            math.sqrt(float(np.mean((disturbed[name] - calm[name]) ** 2))) / noise
            for name, noise in self.noise.items()
        )
        return {name: size * wanted / max(most, 1e-300) for name, size in first.items()}

    def refit(self, records: Sequence[Record]) -> FitResult:
        """Return the equations without effects with the numbers that fit these records best."""
        fit = GreyBoxFit(compose(self.rig), records, self.scales, self.noise)
        found = fit.fit(self.values, [p.name for p in self.rig.parameters])
        if not found.residuals:
            raise SimulationError(
                f"The equations without effects cannot be fitted to this motion: {found.message}"
            )
        return found

    def gap(self, records: Sequence[Record], refit: FitResult, floor: Mapping[str, float]) -> float:
        """Return the error of the re-identified equations on the validation records, in units of the noise floor."""
        fit = GreyBoxFit(compose(self.rig), records, self.scales, self.noise).fit(refit.values, [])
        return self._left(fit, floor)

    def _left(self, fit: FitResult, floor: Mapping[str, float]) -> float:
        left = np.concatenate(fit.residuals) / [floor[s.name] for s in self.rig.outputs]
        return float(np.max(np.sqrt(np.mean(left**2, axis=0))))

    def given(
        self, subject: PlacedSubject, seen: Sequence[Record], refit: FitResult, rng: np.random.Generator
    ) -> dict[str, float]:
        """Return the given simulation: fitted to one sweep, well fitted to all, or with numbers that are off."""
        sweeps = [r for r in seen if r.kind == "sweep" and r.role == "estimation"]
        one = sweeps[int(rng.integers(len(sweeps)))]
        parameters = self.rig.parameters
        off = [1.0 + rng.uniform(*_OFF) * rng.choice([-1.0, 1.0]) for _ in parameters]
        if subject.kind == "parameters":
            found = {p.name: self.values[p.name] * factor for p, factor in zip(parameters, off, strict=True)}
        else:
            found = (refit if subject.kind == "none" else self.refit([one])).values
        return {p.name: float(f"{found[p.name]:.{_DIGITS}g}") for p in parameters}


class _Plant:
    """A rig with its effects and parameters; periodic disturbances have phase zero at the start of a record."""

    def __init__(self, rig: Rig, effects: Sequence[Effect], values: Mapping[str, float]) -> None:
        self._structure = compose(rig, effects)
        self._values = values

    def readings(self, run: Run, disturbances: Mapping[str, Disturbance] | None = None) -> dict[str, Floats]:
        """Return the readings of all sensors at the samples of a record, without noise."""
        record = run.record(dt=DT / _FINER, disturbances=disturbances)
        shown = simulate(self._structure, self._values, record, accuracy=_ACCURACY)
        return {s.name: shown[s.name][::_FINER] for s in self._structure.rig.outputs}

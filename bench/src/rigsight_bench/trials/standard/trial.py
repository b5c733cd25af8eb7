"""Records and key of one trial of design ``standard``; everything follows from seed and number."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from rigsight.effects import Effect
from rigsight.identify import FitResult, characteristic_scales, linear_start
from rigsight.records import Record
from rigsight.rigs import RUNNING_GEAR, evaluated
from rigsight.simulate import compose, simulate
from rigsight.units import characteristic_value
from rigsight_bench.trials.attempts import first_that_succeeds
from rigsight_bench.trials.fitted import fitted, largest_left
from rigsight_bench.trials.kinds import TIERS
from rigsight_bench.trials.runs import DT, Run
from rigsight_bench.trials.standard.campaign import LinearRig, draw_experiments, draw_rig
from rigsight_bench.trials.standard.plant import Plant
from rigsight_bench.trials.standard.subjects import (
    NOISES,
    Subject,
    hidden_effects,
    needs_running_gear,
    standard_subject_of,
)
from rigsight_bench.trials.strength import draw_shape, scaled, sized
from rigsight_bench.trials.trial import Trial, as_given, off_by
from rigsight_bench.trials.waveforms import Disturbance

_REST_TIME = 2.0
"""Time before each record [s] during which the plant is left to the disturbance alone."""
_SPACING = 0.02
"""Distance of the disturbance's values [s]."""
_CORNER = 5.0
"""Angular frequency above which the disturbance falls [rad/s]."""
_OFF = (0.05, 0.2)
"""How far wrong parameters are off."""


def draw_standard_trial(seed: int, trial: int) -> Trial:
    """Draw and measure one trial of design ``standard``.

    Parameters
    ----------
    seed
        Seed of the whole bench.
    trial
        Number of the trial.

    Raises
    ------
    SimulationError
        If no plant that was drawn can be integrated, or is close enough to a linear one to be re-identified.
    """
    subject = standard_subject_of(seed, trial)
    return first_that_succeeds(lambda streams: _drawn(subject, seed, trial, streams), seed, trial)


def _drawn(subject: Subject, seed: int, trial: int, streams: Sequence[np.random.Generator]) -> Trial:
    of_rig, of_effect, of_strength, of_noise, of_disturbance, of_given = streams
    effects = hidden_effects(subject)
    linear = draw_rig(
        of_rig,
        RUNNING_GEAR if any(needs_running_gear(e) for e in effects) else None,
        swings_wide="gravity_pendulum" in subject.effects,
    )
    experiments = draw_experiments(linear, of_rig)
    bench = _Bench(linear, experiments, NOISES[subject.noise] * math.exp(of_noise.uniform(-0.2, 0.2)))
    wished = None if subject.tier is None else math.exp(of_strength.uniform(*np.log(TIERS[subject.tier])))
    values, strengths = bench.truth(effects, wished, of_effect)
    records = bench.measure(effects, values, of_noise, of_disturbance)
    seen = tuple(r for r, e in zip(records, experiments, strict=True) if e.role is not None)
    withheld = tuple(r for r, e in zip(records, experiments, strict=True) if e.role is None)
    refit = bench.refit([r for r in seen if r.role == "estimation"])
    given = bench.given(subject, seen, refit, of_given)
    key = {
        "schema_version": 1,
        "design": "standard",
        "seed": seed,
        "trial": trial,
        "kind": subject.kind,
        "effects": list(subject.effects),
        "where": sorted({linear.rig.place_name(effect.place) for effect in effects}),
        "rig": linear.rig.name,
        "noise": subject.noise,
        "aimed_tier": subject.tier,
        "aimed_gap": wished,
        "gap": bench.gap([r for r in seen if r.role == "validation"], refit),
        "strengths": strengths,
        "values": values,
        "noise_floor": bench.floor,
    }
    return Trial(linear.rig, linear.values, given, seen, withheld, key)


_MOST_DISTURBED = 0.5
"""Share of the sensor noise that a disturbance may reach in the plant's displacement."""


class _Bench:
    """A linear rig with its experiments, sizes and noise."""

    def __init__(self, linear: LinearRig, experiments: Sequence[Run], noise: float) -> None:
        self.linear = linear
        self.experiments = experiments
        self.structure = compose(linear.rig)
        self.outputs = [signal.name for signal in linear.rig.outputs]
        undisturbed = [
            simulate(self.structure, linear.values, e.record()) for e in experiments if e.role == "estimation"
        ]
        self.scales = characteristic_scales(linear.rig, undisturbed, linear.values)
        sizes = [self.scales["x"], self.scales["length"]]
        self.noise = {name: noise * size for name, size in zip(self.outputs, sizes, strict=False)}
        self.floor: dict[str, float] = dict(self.noise)

    def truth(
        self, effects: Sequence[Effect], wished: float | None, rng: np.random.Generator
    ) -> tuple[dict[str, float], list[float]]:
        """Return the value of every parameter of the plant, and the strength of each effect, scaled each by itself."""
        structure = compose(self.linear.rig, effects)
        values, strengths = dict(self.linear.values), []
        for effect in effects:
            assert wished is not None
            shape = draw_shape(effect, self.scales, rng)
            at = functools.partial(scaled, effect, shape, scales=self.scales)
            own = sized(effect.name, at, functools.partial(self._gap_of, effect), wished, least=0.0)
            strengths.append(own.strength)
            values |= {structure.parameter_name(effect, name): value for name, value in own.values.items()}
        return values, strengths

    def _gap_of(self, effect: Effect, own: Mapping[str, float]) -> float:
        """Return what the linear equations leave of two small sweeps, in units of the sensor noise."""
        alone = compose(self.linear.rig, [effect])
        named = {alone.parameter_name(effect, name): value for name, value in own.items()}
        plant = self._plant([effect], {**self.linear.values, **named})
        records = []
        for experiment in self.experiments[1:3]:
            clean = plant.respond(
                experiment.waveforms["u"],
                lambda _: 0.0,
                self._rest([effect], None),
                0.0,
                DT,
                experiment.n_samples,
            )
            records.append(experiment.record(dict(zip(self.outputs, clean.T, strict=True))))
        return largest_left(self.refit(records), self.noise)

    def _plant(self, effects: Sequence[Effect], values: Mapping[str, float]) -> Plant:
        structure = compose(self.linear.rig, effects)
        sizes = [characteristic_value(dimension, self.scales) for dimension in structure.state_dimensions]
        return Plant(structure, values, np.array(sizes))

    def _rest(self, effects: Sequence[Effect], rng: np.random.Generator | None) -> NDArray[np.float64]:
        """Return the states of the plant at rest; the phase of a periodic disturbance is random."""
        values = self.linear.values
        rig = self.linear.rig
        rest = evaluated(rig.motion.rest, values)
        structure = compose(self.linear.rig, effects)
        sensors = {s.symbol.name for e in effects if e.measured is not None for s in e.states}
        state = np.zeros(len(structure.states))
        state[0] = rest
        for i, (name, dimension) in enumerate(
            zip(structure.state_names, structure.state_dimensions, strict=True)
        ):
            if rig.follower is not None and name == rig.follower.symbol.name:
                state[i] = values["y_off"] + evaluated(rig.follower.static_gain, values) * rest
            elif name.rpartition(".")[2] in sensors:
                state[i] = rest
            elif dimension == "" and rng is not None:
                state[i] = rng.uniform(0.0, 2.0 * math.pi)
        return state

    def measure(
        self,
        effects: Sequence[Effect],
        values: Mapping[str, float],
        of_noise: np.random.Generator,
        of_disturbance: np.random.Generator,
    ) -> list[Record]:
        """Return every experiment's record, disturbed and noisy, and set the noise floor."""
        plant = self._plant(effects, values)
        force = self._disturbance_size(of_disturbance)
        force *= self._damped(plant, self._rest(effects, None), force)
        records, passed = [], []
        for experiment in self.experiments:
            disturbance = _draw_disturbance(experiment, force, of_disturbance)
            start = self._rest(effects, of_disturbance)
            clean = plant.respond(
                experiment.waveforms["u"], disturbance, start, -_REST_TIME, DT, experiment.n_samples
            )
            calm = plant.respond(
                experiment.waveforms["u"], lambda _: 0.0, start, -_REST_TIME, DT, experiment.n_samples
            )
            seen = {
                name: clean[:, i] + of_noise.normal(scale=self.noise[name], size=experiment.n_samples)
                for i, name in enumerate(self.outputs)
            }
            records.append(experiment.record(seen))
            passed.append(clean - calm)
        for i, name in enumerate(self.outputs):
            through = math.sqrt(float(np.mean(np.concatenate([p[:, i] for p in passed]) ** 2)))
            self.floor[name] = math.hypot(self.noise[name], through)
        return records

    def _damped(self, plant: Plant, rest: NDArray[np.float64], force: float) -> float:
        """Return the factor that keeps a disturbance below the sensor noise in the plant too.

        A disturbance that hardly moves the linear rig moves a loose or strongly hysteretic spring much more.
        """
        experiment = self.experiments[0]
        disturbance = _draw_disturbance(experiment, force, np.random.default_rng(0))
        disturbed, calm = (
            plant.respond(experiment.waveforms["u"], drive, rest, -_REST_TIME, DT, experiment.n_samples)
            for drive in (disturbance, lambda _: 0.0)
        )
        seen = math.sqrt(float(np.mean((disturbed[:, 0] - calm[:, 0]) ** 2)))
        return min(1.0, _MOST_DISTURBED * self.noise[self.outputs[0]] / max(seen, 1e-300))

    def _disturbance_size(self, rng: np.random.Generator) -> float:
        """Return the force whose way through the linear rig is seen as a part of the sensor noise."""
        unit = _draw_disturbance(self.experiments[0], 1.0, np.random.default_rng(0))
        seen = math.sqrt(float(np.mean(self._passed(unit, self.experiments[0])[:, 0] ** 2)))
        return float(rng.uniform(0.2, 0.5)) * self.noise[self.outputs[0]] / seen

    def _passed(self, disturbance: Disturbance, experiment: Run) -> NDArray[np.float64]:
        """Return what a disturbance does to the linear rig's outputs, shape (n_samples, n_outputs)."""
        t = DT * np.arange(experiment.n_samples, dtype=np.float64)
        record = replace(
            experiment.record(), signals={"u": disturbance.spline(t) / self.linear.drive_gain}, hold="foh"
        )
        rest = {name: 0.0 if name.endswith("_off") else v for name, v in self.linear.values.items()}
        response = simulate(self.structure, rest, record)
        return np.column_stack([response[name] for name in self.outputs])

    def refit(self, records: Sequence[Record]) -> FitResult:
        """Return the linear equations with the numbers that fit these records best."""
        return fitted(self.structure, records, self.scales, self.noise, self.linear.values, self._free)

    @property
    def _free(self) -> list[str]:
        # Beside a spring a constant force is a shifted rest position.
        return [p.name for p in self.linear.rig.parameters if p.name != "force_off"]

    def gap(self, records: Sequence[Record], refit: FitResult) -> float:
        """Return the error of the re-identified equations on the validation records, in units of the noise floor."""
        scored = fitted(self.structure, records, self.scales, self.noise, refit.values)
        return largest_left(scored, self.floor)

    def given(
        self, subject: Subject, seen: Sequence[Record], refit: FitResult, rng: np.random.Generator
    ) -> dict[str, float]:
        """Return the given simulation: fitted to one sweep, well fitted to all, or with numbers that are off."""
        sweeps = [r for r in seen if r.kind == "sweep" and r.role == "estimation"]
        one = sweeps[int(rng.integers(len(sweeps)))]
        off = off_by(self.linear.rig, _OFF, rng)
        if subject.kind == "none":
            found = {name: refit.values[name] for name in off}
        elif subject.kind == "parameters":
            found = {
                name: self.linear.values[name] * (1.0 if name.endswith("_off") else factor)
                for name, factor in off.items()
            }
        else:
            constants = {p.name: self.linear.values[p.name] for p in self.linear.rig.constants}
            found = linear_start(self.linear.rig, [one], constants, {})
        return as_given(found)


def _draw_disturbance(experiment: Run, size: float, rng: np.random.Generator) -> Disturbance:
    """Return a random force of this standard deviation, white up to a corner, from before the record to its end."""
    n_values = math.ceil((_REST_TIME + experiment.n_samples * DT) / _SPACING) + 4
    pole = math.exp(-_CORNER * _SPACING)
    settled = math.ceil(5.0 / (_CORNER * _SPACING))
    white = rng.normal(scale=size * math.sqrt(1.0 - pole**2), size=n_values + settled)
    return Disturbance(lfilter([1.0], [1.0, -pole], white)[settled:], -_REST_TIME, _SPACING)

"""Motion of a hand-written plant in the records of a trial, and the gap of the rig's equations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rigsight.identify import FitResult, characteristic_scales
from rigsight.records import Record
from rigsight.records.signals import typical_size
from rigsight.rigs import RIGS, Rig
from rigsight.simulate import compose
from rigsight_bench.trials.fitted import fitted, largest_left
from rigsight_bench.trials.handwritten.cells import Cell
from rigsight_bench.trials.handwritten.equations.plant import Response
from rigsight_bench.trials.handwritten.plan import between_samples
from rigsight_bench.trials.handwritten.plants import JOINT_LAWS, MOTIONS, respond
from rigsight_bench.trials.handwritten.shapes import Shape, Sizes
from rigsight_bench.trials.runs import Run
from rigsight_bench.trials.strength import Sized, sized


@dataclass(frozen=True)
class HandwrittenBench:
    """A rig with its numbers, its experiments and the noise of its sensors.

    Attributes
    ----------
    cell
        What is hidden.
    values
        Constants and parameters of the rig.
    plan
        All records to be measured.
    noise_shares
        Noise of each sensor in units of its reading's size.
    """

    cell: Cell
    values: Mapping[str, float]
    plan: Sequence[Run]
    noise_shares: Mapping[str, float]

    @property
    def rig(self) -> Rig:
        """The rig that the campaign names."""
        return RIGS[self.cell.rig]

    @cached_property
    def _fitted_to(self) -> list[Run]:
        return [recording for recording in self.plan if recording.role == "estimation"]

    @cached_property
    def _linear(self) -> list[tuple[Record, Response]]:
        moved = [self._moved(recording, None) for recording in self._fitted_to]
        return [(r.record(found.readings), found) for r, found in zip(self._fitted_to, moved, strict=True)]

    @property
    def linear(self) -> list[Record]:
        """Records for estimation of the rig without an effect and without noise."""
        return [record for record, _ in self._linear]

    @cached_property
    def scales(self) -> dict[str, float]:
        """Size of each base quantity in the records."""
        return characteristic_scales(self.rig, self.linear, self.values)

    @cached_property
    def readings(self) -> dict[str, float]:
        """Size of each reading without an effect."""
        return {s.name: typical_size([r[s.name] for r in self.linear]) for s in self.rig.outputs}

    @cached_property
    def noise(self) -> dict[str, float]:
        """Standard deviation of the noise of each sensor, all that lies between plant and record: the true noise floor."""
        return {name: self.noise_shares[name] * size for name, size in self.readings.items()}

    def _moved(self, recording: Run, own: Mapping[str, float] | None) -> Response:
        cell = self.cell
        effect = cell.effect if own is not None else ""
        # Without an effect the place says of which joint the motion is returned.
        place = cell.place if effect or cell.effect in JOINT_LAWS else ""
        return respond(
            cell.rig,
            self.values,
            between_samples(recording),
            recording.dt,
            recording.n_samples,
            effect,
            place,
            own,
        )

    def quiet(self, recording: Run, own: Mapping[str, float] | None) -> Record:
        """Return a record without noise.

        Parameters
        ----------
        recording
            The experiment.
        own
            Parameters of the hidden effect; None without it.
        """
        return recording.record(self._moved(recording, own).readings)

    def measured(self, own: Mapping[str, float] | None, rng: np.random.Generator) -> list[Record]:
        """Return all records with noise.

        Parameters
        ----------
        own
            Parameters of the hidden effect; None without one.
        rng
            Source of the noise.
        """
        records = []
        for recording in self.plan:
            clean = self.quiet(recording, own)
            noisy = {
                name: clean[name] + rng.normal(scale=size, size=clean.n_samples)
                for name, size in self.noise.items()
            }
            records.append(recording.record(noisy))
        return records

    @property
    def sizes(self) -> Sizes:
        """How far and how fast the rig moves without the effect where the effect is to act."""
        responses = [response for _, response in self._linear]
        x, v = (typical_size([getattr(r, name) for r in responses]) for name in ("x", "v"))
        if self.cell.rig not in MOTIONS:
            force = self.readings[self.rig.outputs[0].name]
            return Sizes(x, v, force, max(self.values["k"], force / x), force)
        motion = MOTIONS[self.cell.rig](self.values)
        joint = motion.joints.get(self.cell.place) or next(iter(motion.joints.values()))
        drives = list(motion.drives)
        acting = (
            drives.index(self.cell.place) if self.cell.place in drives else self._first_along(joint.pulls)
        )
        named = self.rig.mechanism.inputs[acting]
        driven = typical_size([record[named] for record, _ in self._linear])
        force = abs(motion.gains[acting]) * driven
        if self.cell.place not in drives and joint.stiffness:
            force = min(force, joint.stiffness * x)
        return Sizes(x, v, force, joint.stiffness or force / x, driven)

    def _first_along(self, pulls: Sequence[int]) -> int:
        """Return the drive that acts along a joint's motion, the only one where there is no other."""
        along = list(MOTIONS[self.cell.rig](self.values).drives.values())
        return next((i for i, coordinate in enumerate(along) if pulls[coordinate]), 0)

    def sized(self, shape: Shape, wished: float) -> Sized:
        """Return the effect of the strength at which it leaves a gap near the wished size.

        Parameters
        ----------
        shape
            Its parameters over the strength.
        wished
            Gap together with the noise, in units of the noise.

        Raises
        ------
        SimulationError
            If no strength leaves half of that.
        """

        def gap(own: Mapping[str, float]) -> float:
            quiet = [self.quiet(recording, own) for recording in self._fitted_to[:2]]
            return largest_left(self.refit(quiet), self.noise)

        return sized(self.cell.effect, shape.at, gap, wished)

    def refit(self, records: Sequence[Record]) -> FitResult:
        """Return the rig's equations with the numbers that fit these records best.

        Raises
        ------
        SimulationError
            If the fit fails.
        """
        return self._fitted(records, self.values, self.free)

    def scored(self, refit: FitResult, records: Sequence[Record]) -> FitResult:
        """Return the residuals of fitted equations on other records."""
        return self._fitted(records, refit.values, [])

    @property
    def free(self) -> list[str]:
        """Parameters that a fit moves: beside a spring with a rest position a constant force is none of them."""
        names = [p.name for p in self.rig.parameters]
        return [name for name in names if not (name == "force_off" and "x_off" in names)]

    def _fitted(
        self, records: Sequence[Record], start: Mapping[str, float], free: Sequence[str]
    ) -> FitResult:
        return fitted(compose(self.rig), records, self.scales, self.noise, start, free)

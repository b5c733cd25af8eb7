"""Evidence of a model with a disturbance force and noise of any spectrum.

A disturbance force excites the resonances of a rig, where the error is then large for every model: a model that only follows
these resonances gains little, one that explains the records gains over the whole spectrum. So the residual of a model is treated
as noise with the spectrum of the residual, which is smooth once the resonances of the linearized rig are divided out
(prewhitening). No noise floor is needed.

References
----------
P. Whittle, Ark. Mat. 2 (1953) 423, for the likelihood of a spectrum. R. B. Blackman and J. W. Tukey, *The Measurement of Power
Spectra* (Dover 1958), section B.15, for prewhitening. G. Schwarz, Ann. Statist. 6 (1978) 461, for the price of a number.
M. J. Bayarri et al., Stat. Theory Relat. Fields 3 (2019) 2, for the price of a number that only some of the samples tell of.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.optimize import minimize
from scipy.signal.windows import tukey
from scipy.special import entr

from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.pushes.probes import PUSH_SIZE, push, with_probes
from rigsight.diagnose.pushes.responses import orthonormal
from rigsight.errors import SimulationError
from rigsight.identify import answers_to_states
from rigsight.records.record import Floats
from rigsight.simulate import compose
from rigsight.simulate.linearization import Linearization, linearize

_SMOOTHED = 9
"""Lines over which a spectrum is averaged: 18 degrees of freedom, a scatter of a third."""
_TAPER = 0.1
"""Share of a record that is faded in and out: 10 percent is usual, so that slow errors do not leak into fast ones."""
_FEWEST = 4 * _SMOOTHED
"""Samples of a record below which its spectrum would be one average."""
_BESIDE = 1e-2
"""Share of the power at which the search starts for the sources beside the main one."""
_FAINT, _STRONG = 1e-12, 1e3
"""Bounds of a source's power, in units of the power that is left. The first keeps spectra regular as well."""


class Evidence:
    """Bayesian information criterion (Schwarz) of models of the same records."""

    # The resonances of the re-identified equations are divided out; the residual of the reference gives `powers`: the variance
    # per sample of each sensor's own noise and of a white force at each joint, as each sensor tells it, in SI units, shape
    # (n_outputs, 1 + n_joints).

    def __init__(self, context: FitContext, reidentified: FittedModel, reference: FittedModel) -> None:
        self._context = context
        self._responses = self._of_forces(reidentified)
        self._known: dict[tuple[int, float], Floats] = {}
        # Models are stored with the results, so that no other object can have the same identity.
        self._criteria: dict[int, tuple[FittedModel, float]] = {}
        self.powers = self._fitted_powers(self._remainders(reference))

    def criterion(self, model: FittedModel) -> float:
        """Return minus twice the log-likelihood plus the penalty for all parameters and initial states: the lower, the better."""
        if id(model) not in self._criteria:
            self._criteria[id(model)] = (model, self._criterion(model))
        return self._criteria[id(model)][1]

    def _criterion(self, model: FittedModel) -> float:
        reported, n_samples = 0.0, 0
        for remainder, dt in self._remainders(model):
            measured = np.all(np.isfinite(remainder), axis=0)
            lines = _lines(remainder[:, measured]) / np.sqrt(
                self._spectra(remainder.shape[0], dt)[:, measured]
            )
            crossed = lines[:, :, None] * lines[:, None, :].conj()
            smooth = uniform_filter1d(crossed.real, _SMOOTHED, axis=0) + 1j * uniform_filter1d(
                crossed.imag, _SMOOTHED, axis=0
            )
            # Two sensors may show the very same.
            smooth += _FAINT * np.mean(np.abs(lines) ** 2) * np.eye(lines.shape[1])
            reported += 2.0 * float(np.sum(np.linalg.slogdet(smooth)[1]))
            n_samples += remainder[:, measured].size
        n_free = len(model.fit.free)
        return reported + n_free * float(np.log(max(n_samples, 1))) + self._price_of_states(model)

    def gain(self, model: FittedModel, simpler: FittedModel) -> float:
        """Return the gain in log-likelihood of a model if the noise has the residual spectrum of a simpler one."""
        # An effect missing in the simpler model raises that spectrum. A model with this effect stays below it everywhere; a model
        # that replaces a slow error by a fast one loses.
        gained = 0.0
        for (remainder, dt), (least, _) in zip(
            self._remainders(simpler), self._remainders(model), strict=True
        ):
            measured = np.all(np.isfinite(remainder), axis=0)
            expected = np.sqrt(self._spectra(remainder.shape[0], dt)[:, measured])
            before, after = (np.abs(_lines(own[:, measured]) / expected) ** 2 for own in (remainder, least))
            smooth = uniform_filter1d(before, _SMOOTHED, axis=0) + _FAINT * np.mean(before)
            gained += float(np.sum((before - after) / smooth))
        return gained

    def _price_of_states(self, model: FittedModel) -> float:
        """Return the penalty of a model's initial states: for each, the logarithm of the number of samples that inform it."""
        # This is the entropy of their leverages, the same for all states with the same effect on the readings.
        found = self._context.on_all_records(model)
        responses = answers_to_states(self._context.problem(found.structure, self._context.records), found)
        leverages = [np.sum(orthonormal(own) ** 2, axis=1) for own in responses]
        return float(sum(np.sum(entr(own)) for own in leverages))

    def _remainders(self, model: FittedModel) -> list[tuple[Floats, float]]:
        """Return the residuals of a model on each record that is long enough, shape (n, n_outputs), with its sample time."""
        found = self._context.on_all_records(model).residuals
        records = self._context.records
        return [
            (remainder, record.dt)
            for remainder, record in zip(found, records, strict=True)
            if remainder.shape[0] >= _FEWEST and np.any(np.all(np.isfinite(remainder), axis=0))
        ]

    def _of_forces(self, reidentified: FittedModel) -> Linearization | None:
        """Return the responses of the sensors to forces at the joints; None where the equations cannot be linearized."""
        structure = compose(with_probes(self._context.rig), self._context.modelled)
        values = {**reidentified.fit.all_values, PUSH_SIZE: 1.0}
        try:
            return linearize(structure, values)
        except SimulationError:
            return None

    def _gains(self, n_samples: int, dt: float) -> Floats:
        """Return squared responses to the own noise and a force at each joint, shape (lines, outputs, 1 + joints)."""
        key = (n_samples, dt)
        if key not in self._known:
            omega = np.asarray(2.0 * np.pi * np.fft.rfftfreq(n_samples, dt)[1:], dtype=np.float64)
            n_outputs = len(self._context.rig.outputs)
            parts = [np.ones((omega.size, n_outputs, 1))]
            if self._responses is not None:
                joints = [push(joint.name) for joint in self._context.rig.mechanism.joints]
                columns = [self._responses.inputs.index(name) for name in joints]
                found = self._responses.frequency_response(omega)[:, :n_outputs, columns]
                parts.append(np.abs(found) ** 2)
            self._known[key] = np.concatenate(parts, axis=2)
        return self._known[key]

    def _spectra(self, n_samples: int, dt: float) -> Floats:
        """Return the expected spectrum of the residual, shape (lines, outputs)."""
        return np.asarray(np.einsum("kij,ij->ki", self._gains(n_samples, dt), self.powers))

    def _fitted_powers(self, remainders: Sequence[tuple[Floats, float]]) -> Floats:
        """Return the power of the noise and of the forces that moves each output most likely, shape (outputs, 1 + joints)."""
        n_outputs = len(self._context.rig.outputs)
        gains = [self._gains(remainder.shape[0], dt) for remainder, dt in remainders]
        powers = []
        for output in range(n_outputs):
            seen = [
                (np.abs(_lines(remainder[:, [output]])[:, 0]) ** 2, own[:, output])
                for (remainder, _), own in zip(remainders, gains, strict=True)
                if np.all(np.isfinite(remainder[:, output]))
            ]
            powers.append(_most_likely(seen) if seen else np.eye(1, self._n_sources)[0])
        return np.array(powers)

    @property
    def _n_sources(self) -> int:
        return 1 + (0 if self._responses is None else len(self._context.rig.mechanism.joints))


def _lines(remainder: Floats) -> NDArray[np.complex128]:
    """Return the lines of a spectrum but the mean, shape (lines, outputs)."""
    n = remainder.shape[0]
    return np.asarray(np.fft.rfft(remainder * tukey(n, _TAPER)[:, None], axis=0)[1:] / np.sqrt(n))


def _most_likely(seen: Sequence[tuple[Floats, Floats]]) -> Floats:
    """Return the powers of sources under which spectra are most likely; of each its lines (n,) and the gains (n, sources)."""
    power = np.concatenate([own for own, _ in seen])
    gains = np.concatenate([own for _, own in seen])
    size = float(np.mean(power)) or 1.0
    gain = np.mean(gains, axis=0)
    # A source that no reading shows has any power: it changes no spectrum.
    unit = np.divide(size, gain, out=np.zeros_like(gain), where=gain > 0.0)

    def cost(logarithms: Floats) -> tuple[float, Floats]:
        own = np.exp(logarithms) * unit
        expected = gains @ own
        slope = ((1.0 - power / expected) / expected) @ gains * own
        return float(np.sum(np.log(expected) + power / expected)), slope

    n_sources = gains.shape[1]
    bounds = [(np.log(_FAINT), np.log(_STRONG))] * n_sources
    # Of several valleys each has another source that is the main one.
    starts = np.log(_BESIDE) * (1.0 - np.eye(n_sources))
    ends = [minimize(cost, start, jac=True, method="L-BFGS-B", bounds=bounds) for start in starts]
    return np.asarray(np.exp(min(ends, key=lambda end: float(end.fun)).x) * unit)

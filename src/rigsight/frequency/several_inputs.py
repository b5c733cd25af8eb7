"""Responses of a signal to each of several inputs, from records in which they move together or one at a time.

Close to a frequency, for every record ``A(r) Y(k + r) = sum_i B_i(r) U_i(k + r) + T(r)``: the responses are common to all
records, the transient T differs. Inputs that are smooth multiples of each other there cannot be distinguished.

References
----------
R. Pintelon and J. Schoukens, *System Identification: A Frequency Domain Approach* (Wiley 2012), chapters 2 and 7. R. Pintelon,
J. Schoukens, G. Vandersteen and K. Barbe, "Estimation of nonparametric noise and FRF models for multivariable systems", Mech.
Syst. Signal Process. (2010).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.frequency.frequency_response import FrequencyResponse
from rigsight.frequency.local_model import SPARE, LocalFit
from rigsight.frequency.signal_pair import excited, hold_response, line_frequencies, pair_unit
from rigsight.records.record import Floats, Hold, Record
from rigsight.records.signals import mean_period, moves_beyond_noise

_OWN_SHARE = 1e-4
"""Share of an input's power not explained by other inputs, from which its response can be separated: -40 dB, as for silence."""
_MOSTLY = 0.5
"""Share of its frequencies at which an input must be distinguishable to get a response."""
_SHORT = 0.5
"""Duration over that of the longest record, below which a record would blur details that the longest one resolves."""
_MOST_FREQUENCIES = 400
"""As many as a plot can show; a resonance with a damping ratio of 1 % still contains several of them."""
_STANDS_OUT = 4.0
"""Power over variance from which a value determines a magnitude: at most half of it is error."""
_NEIGHBORS, _MOST_OF_THEM = 9, 0.8
"""By chance, one value exceeds the noise in twenty bands; eight of nine neighbors do not."""
_FEWEST = 8
"""Fewest values of a curve."""
_ONE_TONE = 0.9
"""Share of an input's power within one local band, from which it is a tone: a tone between two lines leaves 3 % outside of it."""
_STILL = 1e-12
_ORDER = 2
"""Degree of the polynomials in a local band."""
_CHUNK = 128


@dataclass(frozen=True, eq=False)
class ResponsesOfInputs:
    """Responses of some signals to some inputs."""

    # Responses by (source, response), without those that these records do not determine.
    found: Mapping[tuple[str, str], FrequencyResponse]
    # The reason for each missing one, a sentence by (source, response).
    problems: Mapping[tuple[str, str], str]
    # Inputs that change together in these records, so that their responses cannot be separated.
    together: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, eq=False)
class _Spectra:
    """Spectra of one record, scaled to equal noise in all records; inputs include their hold, and are zero if constant."""

    record: Record
    omega: Floats
    inputs: NDArray[np.complex128]
    moves: NDArray[np.bool_]
    excites: NDArray[np.bool_]
    scale: float
    has_transient: bool

    @property
    def line(self) -> float:
        return float(self.omega[0])

    def width(self, poles: int, resolution: float | None) -> int:
        """Return the number of lines of a local band: its unknowns and some more, or the resolution if that is wider."""
        unknowns = (_ORDER + 1) * (int(np.count_nonzero(self.moves)) + self.has_transient) + poles
        wished = 0 if resolution is None else round(resolution / self.line)
        return max(unknowns + SPARE, wished) | 1


def responses_of_inputs(
    records: Sequence[Record],
    sources: Sequence[str],
    responses: Sequence[str],
    *,
    poles: int = 2,
    resolution: float | None = None,
    smooth: Sequence[str] = (),
) -> ResponsesOfInputs:
    """Return the frequency responses of every signal to every input, from all records together.

    Parameters
    ----------
    records
        One or several inputs move in each; they may differ in length, sample time and in the signals they contain. Steps are left
        out. If the inputs are periodic, whole periods are averaged, without the first.
    sources, responses
        Names of the signals.
    poles
        Degree of the common denominator; 0 for a local polynomial model.
    resolution
        Width of a local band [rad/s]; None takes the narrowest of each record.
    smooth
        Measured sources, which have no content above the Nyquist frequency; all others have the record's hold.

    Raises
    ------
    InputError
        If a record is too short for `resolution`, or there are no inputs.
    """
    if not sources:
        raise InputError("There is no input, so there is no frequency response.")
    found: dict[tuple[str, str], FrequencyResponse] = {}
    problems: dict[tuple[str, str], str] = {}
    together: dict[tuple[str, ...], None] = {}
    spectra = [
        _spectra(r, sources, smooth)
        for r in records
        if r.kind != "step" and any(_moves(r, source) for source in sources)
    ]
    for response in responses:
        own = _long_enough(
            [s for s in spectra if response in s.record and s.width(poles, resolution) <= s.omega.size]
        )
        local = _LocalModels(own, response, poles, resolution) if own else None
        for index, source in enumerate(sources):
            if local is None or not any(s.moves[index] for s in own):
                problems[source, response] = _unmoved(source, response, records)
                continue
            curve, rivals = local.curve(index, sources)
            if curve is not None:
                found[source, response] = curve
            elif rivals:
                together[tuple(sorted((source, *rivals), key=list(sources).index))] = None
                problems[source, response] = _inseparable(source, rivals)
            else:
                problems[source, response] = local.tone(index, source) or _hidden(
                    source, response, [s.record for s in own], len(sources) > 1
                )
    return ResponsesOfInputs(found, problems, tuple(together))


def _unmoved(source: str, response: str, records: Sequence[Record]) -> str:
    if not any(response in record for record in records):
        return f"no record contains '{response}'."
    if any(r.kind == "step" and response in r and _moves(r, source) for r in records):
        return f"'{source}' only has steps, which give no frequency response. Record a sweep or a multisine of it."
    return f"'{source}' does not change in any record with '{response}'. Record one in which it does."


def _hidden(source: str, response: str, records: Sequence[Record], others_drive: bool) -> str:
    if others_drive or not any(moves_beyond_noise(record[response]) for record in records):
        return (
            f"the response of '{response}' to '{source}' does not exceed its noise. Excite '{source}' more strongly, or "
            f"for longer."
        )
    return (
        f"'{response}' moves far more than its noise, but not as a linear response to '{source}': more excitation does not "
        f"help. Check whether '{response}' wraps or is held, whether both signals are of one clock, and what else moves it."
    )


def _inseparable(source: str, rivals: Sequence[str]) -> str:
    others = " and ".join(f"'{rival}'" for rival in rivals)
    return (
        f"'{source}' changes together with {others}, so their responses cannot be separated. Record one in which '{source}' "
        f"changes alone, or with different phases."
    )


def _moves(record: Record, source: str) -> bool:
    samples = record[source]
    return float(np.ptp(samples)) > _STILL * float(np.max(np.abs(samples)))


def _spectra(record: Record, sources: Sequence[str], smooth: Sequence[str]) -> _Spectra:
    mean, n_periods = mean_period(record, [source for source in sources if _moves(record, source)])
    n = mean.n_samples
    omega = line_frequencies(n, mean.dt)
    # Averaging over periods lowers the noise by the square root of their number.
    scale = math.sqrt(max(n_periods, 1) * mean.dt / n)
    moving, inputs, excites = [_moves(record, source) for source in sources], [], []
    for source, moves in zip(sources, moving, strict=True):
        hold: Hold = "band_limited" if source in smooth else record.hold
        lines = np.fft.rfft(mean[source] - np.mean(mean[source]))[1 : omega.size + 1]
        inputs.append(scale * lines * hold_response(omega, mean.dt, hold) if moves else np.zeros_like(lines))
        width = min(2 * SPARE + 1, omega.size)
        power = np.convolve(np.abs(inputs[-1]) ** 2, np.full(width, 1.0 / width), mode="same")
        excites.append(excited(omega, power, None, "") if moves else np.zeros(omega.size, dtype=np.bool_))
    every = np.array(inputs), np.array(moving), np.array(excites)
    return _Spectra(mean, omega, *every, scale, n_periods == 0)


def _long_enough(spectra: Sequence[_Spectra]) -> list[_Spectra]:
    """Leave out records that would blur details that others resolve, unless an input moves only in them."""
    if not spectra:
        return []
    finest = min(s.line for s in spectra)
    kept = [s for s in spectra if _SHORT * s.line <= finest]
    seen = np.any([s.moves for s in kept], axis=0)
    return [s for s in spectra if s in kept or bool(np.any(s.moves & ~seen))]


class _LocalModels:
    """Local models of one signal at all frequencies that any input excites."""

    def __init__(
        self,
        spectra: Sequence[_Spectra],
        response: str,
        poles: int,
        resolution: float | None,
    ) -> None:
        self._spectra, self._response, self._poles = spectra, response, poles
        self._widths = [s.width(poles, resolution) for s in spectra]
        self._moving = np.flatnonzero(np.any([s.moves for s in spectra], axis=0))
        self._lines = [np.fft.rfft(s.record[response])[1 : s.omega.size + 1] * s.scale for s in spectra]
        self._omega = _frequencies(spectra)
        chunks = [self._omega[i : i + _CHUNK] for i in range(0, self._omega.size, _CHUNK)]
        parts = [self._solved(chunk) for chunk in chunks]
        self._values, self._variance, self._freedom, self._against, self._own = (
            np.concatenate(arrays) for arrays in zip(*parts, strict=True)
        )

    def curve(self, index: int, sources: Sequence[str]) -> tuple[FrequencyResponse | None, tuple[str, ...]]:
        """Return the response to one input, or the inputs that it moves together with; neither if it is below the noise."""
        column = int(np.flatnonzero(self._moving == index)[0])
        excites = np.any([_at_lines(s, s.excites[index], self._omega) for s in self._spectra], axis=0)
        apart = self._own[:, column] >= _OWN_SHARE
        if np.mean(apart[excites]) < _MOSTLY:
            others = [i for i in range(self._moving.size) if i != column]
            alone = [i for i in others if np.mean(self._against[excites, column, i] >= _OWN_SHARE) < _MOSTLY]
            return None, tuple(sources[self._moving[i]] for i in alone or others)
        values, variance = self._values[:, column], self._variance[:, column]
        stands_out = excites & apart & (np.abs(values) ** 2 > _STANDS_OUT * variance)
        if stands_out.size < _FEWEST:
            return None, ()
        # One value may exceed the noise by chance, but not its neighbors as well.
        neighbors = np.ones(min(_NEIGHBORS, stands_out.size))
        around = np.convolve(stands_out, neighbors, mode="same")
        present = np.convolve(np.ones(stands_out.size), neighbors, mode="same")
        kept = stands_out & (around >= _MOST_OF_THEM * present)
        if np.count_nonzero(kept) < _FEWEST:
            return None, ()
        names = tuple(s.record.name for s in self._spectra)
        kind = f"local {'rational' if self._poles else 'polynomial'}, order {_ORDER}"
        return FrequencyResponse(
            omega=self._omega[kept],
            values=values[kept],
            source=sources[index],
            response=self._response,
            unit=pair_unit(self._spectra[0].record, sources[index], self._response),
            variance=variance[kept],
            noise_freedom=float(np.min(self._freedom[kept])),
            shared_width=max(w * s.line for s, w in zip(self._spectra, self._widths, strict=True)),
            records=names,
            method=f"{kind}, {len(sources)} inputs, {len(names)} records together",
        ), ()

    def tone(self, index: int, source: str) -> str:
        """Return a sentence if an input is a single tone in all records; an empty one if it is not."""
        tones = []
        for s, width in zip(self._spectra, self._widths, strict=True):
            if not s.moves[index]:
                continue
            power = np.abs(s.inputs[index]) ** 2
            inside = np.convolve(power, np.ones(min(width, power.size)), mode="same")
            if np.max(inside) < _ONE_TONE * np.sum(power):
                return ""
            tones.append(float(s.omega[np.argmax(power)]))
        named = " and ".join(f"{tone:.4g}" for tone in sorted(set(tones)))
        return (
            f"'{source}' excites a single frequency, {named} rad/s, which gives no frequency response. Record a sweep or a "
            f"multisine of it."
        )

    def _solved(self, omega: Floats) -> tuple[NDArray[np.complex128], *tuple[Floats, ...]]:
        """Return values and variances of all inputs, degrees of freedom, and the share of each that others do not explain."""
        # Shapes (n_frequencies, n_moving), the third (n_frequencies,). The shares are those that each single other input, and all
        # others together, do not explain, shapes (n_frequencies, n_moving, n_moving) and (n_frequencies, n_moving).
        n_terms, n_inputs = _ORDER + 1, self._moving.size
        reach = max(0.5 * w * s.line for s, w in zip(self._spectra, self._widths, strict=True))
        collected: tuple[list[NDArray[np.complex128]], ...] = ([], [], [])
        absorbed = np.zeros(omega.size, dtype=np.intp)
        for s, width, lines in zip(self._spectra, self._widths, self._lines, strict=True):
            center = np.round(omega / s.line).astype(np.intp) - 1
            picked = np.clip(center - width // 2, 0, s.omega.size - width)[:, None] + np.arange(width)
            r = (s.omega[picked] - omega[:, None]) / reach
            powers = r[..., None] ** np.arange(max(n_terms, self._poles + 1))
            # A record has no information beyond its last line.
            has_line = (omega <= s.omega[-1])[:, None, None]
            near_inputs = np.moveaxis(s.inputs[self._moving][:, picked], 0, 2)
            near = np.where(has_line, lines[picked][..., None], 0.0)
            terms = near_inputs[..., None] * powers[..., None, :n_terms]
            own = [
                np.where(has_line, terms.reshape(*picked.shape, -1), 0.0),
                -powers[..., 1 : self._poles + 1] * near,
                near,
            ]
            absorbed += np.where(has_line[:, 0, 0], n_terms * s.has_transient, width)
            if s.has_transient:
                own = _without(powers[..., :n_terms], own)
            for parts, part in zip(collected, own, strict=True):
                parts.append(part)
        inputs, past, responses = (np.concatenate(parts, axis=1) for parts in collected)
        fit = LocalFit(np.concatenate([inputs, past], axis=2), responses[..., 0], absorbed)
        first = [n_terms * i for i in range(n_inputs)]
        values = np.stack([fit.coefficient(term) for term in first], axis=1)
        shares = np.stack([np.sum(np.abs(fit.shares(term)) ** 2, axis=1) for term in first], axis=1)
        return values, fit.noise[:, None] * shares, fit.freedom, *_own_shares(inputs, n_terms)


def _frequencies(spectra: Sequence[_Spectra]) -> Floats:
    """Return the lines that each input excites in its finest record; if too many, some at equal logarithmic distances."""
    lines = []
    for index in np.flatnonzero(np.any([s.moves for s in spectra], axis=0)):
        finest = min((s for s in spectra if s.moves[index]), key=lambda s: s.line)
        lines.append(finest.omega[finest.excites[index]])
    every = np.unique(np.concatenate(lines))
    if every.size <= _MOST_FREQUENCIES:
        return every
    wished = np.geomspace(every[0], every[-1], _MOST_FREQUENCIES)
    return np.unique(every[np.clip(np.searchsorted(every, wished), 0, every.size - 1)])


def _at_lines(s: _Spectra, flags: NDArray[np.bool_], omega: Floats) -> NDArray[np.bool_]:
    """Return the flags at the lines of a record next to some frequencies; false above its last line."""
    nearest = np.clip(np.round(omega / s.line).astype(np.intp) - 1, 0, s.omega.size - 1)
    return np.asarray(flags[nearest] & (omega <= s.omega[-1]))


def _without(powers: Floats, parts: Sequence[NDArray[np.complex128]]) -> list[NDArray[np.complex128]]:
    """Remove the transient from the equations of a record, by projecting out polynomials over each band."""
    basis = np.linalg.qr(powers)[0]
    return [part - basis @ (np.swapaxes(basis, 1, 2) @ part) for part in parts]


def _own_shares(inputs: NDArray[np.complex128], n_terms: int) -> tuple[Floats, Floats]:
    """Return the share of each input's power that one other, and that all others, leave unexplained."""
    n_bands, n_rows, n_columns = inputs.shape
    n = n_columns // n_terms
    blocks = inputs.reshape(n_bands, n_rows, n, n_terms)
    against, own = np.ones((n_bands, n, n)), np.ones((n_bands, n))
    for i in range(n):
        power = np.maximum(np.sum(np.abs(blocks[:, :, i, 0]) ** 2, axis=1), 1e-300)
        others = [j for j in range(n) if j != i]

        def unexplained(rivals: list[int], i: int = i) -> Floats:
            terms = blocks[:, :, rivals].reshape(n_bands, n_rows, -1)
            return np.asarray(LocalFit(terms, blocks[:, :, i, 0]).left_over)

        for j in others:
            against[:, i, j] = unexplained([j]) / power
        if others:
            own[:, i] = against[:, i, others[0]] if len(others) == 1 else unexplained(others) / power
    return against, own

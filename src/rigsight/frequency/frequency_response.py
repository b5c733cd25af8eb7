"""A frequency response: complex values over angular frequency, with their uncertainty and their origin."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.records.record import Floats


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """A measured or computed frequency response of one pair of signals.

    A response that lags its source has a negative phase: values are those of ``G(j omega)`` with ``response = G source``.

    Attributes
    ----------
    omega
        Angular frequencies [rad/s], increasing and not negative, shape (n_frequencies,).
    values
        Response over source, complex, in `unit`, shape (n_frequencies,).
    source, response
        Names of the driving signal and of the responding signal.
    unit
        Unit of the values, for example ``"rad/A"``.
    variance
        Total variance ``E |values - truth|^2`` of the complex values, shape (n_frequencies,), None if unknown. Real and
        imaginary part have half of it each.
    noise_variance
        The part of `variance` that disturbance and sensor noise cause, shape (n_frequencies,), None if not separated.
    coherence
        Coherence between source and response, 0 to 1, shape (n_frequencies,), None if not estimated.
    records
        Names of the records the values came from.
    method
        Name of the estimator.
    noise_shares, noise_lines
        Correlation of the errors of neighboring values, shape (n_frequencies, n_shares), None if they are independent or it is
        unknown: the error of value i is ``sum_j noise_shares[i, j] xi[noise_lines[i, j]]`` with independent circular xi of
        variance 1.
    line_noise
        Variance of the noise in the spectrum of the responding signal, as of a plain Fourier transform, shape (n_frequencies,),
        None if it was not estimated.
    bias
        Size of the systematic error of each value, part of `variance` and alike at neighboring values, shape (n_frequencies,),
        None if it was not estimated.
    noise_freedom
        Complex degrees of freedom from which each variance was estimated, infinite if it is known in another way.
    shared_width
        Width [rad/s] of the band from which a value was estimated, if `noise_lines` does not give it: values closer than this
        share data.

    Raises
    ------
    InputError
        If shapes differ, a value is not finite, frequencies do not increase, or a variance is negative.
    """

    omega: Floats
    values: NDArray[np.complex128]
    source: str
    response: str
    unit: str
    variance: Floats | None = None
    noise_variance: Floats | None = None
    coherence: Floats | None = None
    records: tuple[str, ...] = ()
    method: str = ""
    noise_shares: NDArray[np.complex128] | None = None
    noise_lines: NDArray[np.intp] | None = None
    line_noise: Floats | None = None
    bias: Floats | None = None
    noise_freedom: float = float("inf")
    shared_width: float = 0.0

    def __post_init__(self) -> None:
        omega = np.array(self.omega, dtype=np.float64)
        if omega.ndim != 1 or omega.size == 0:
            raise InputError(f"{self._what}: omega must have shape (n_frequencies,), got {omega.shape}.")
        arrays: dict[str, NDArray[Any]] = {
            "omega": omega,
            "values": np.array(self.values, dtype=np.complex128),
        }
        for field in ("variance", "noise_variance", "coherence"):
            given = getattr(self, field)
            if given is not None:
                arrays[field] = np.array(given, dtype=np.float64)
        for field, array in arrays.items():
            if array.shape != omega.shape:
                raise InputError(f"{self._what}: {field} must have shape {omega.shape}, got {array.shape}.")
            if not np.isfinite(array).all():
                worst = omega[~np.isfinite(array)][0]
                raise InputError(f"{self._what}: {field} is not finite at {worst:.4g} rad/s.")
            if field != "values" and (array < 0.0).any():
                raise InputError(f"{self._what}: {field} must not be negative, got {array.min():.4g}.")
            array.flags.writeable = False
            object.__setattr__(self, field, array)
        if self.noise_shares is not None and (
            self.noise_lines is None
            or self.noise_lines.shape != self.noise_shares.shape
            or self.noise_shares.shape[:1] != omega.shape
        ):
            raise InputError(
                f"{self._what}: noise_shares needs noise_lines, both of shape ({omega.size}, n_shares), got "
                f"{self.noise_shares.shape} and {None if self.noise_lines is None else self.noise_lines.shape}."
            )
        if (np.diff(omega) <= 0.0).any():
            raise InputError(
                f"{self._what}: angular frequencies must increase; sort them and drop repeated ones."
            )
        if "coherence" in arrays and arrays["coherence"].max() > 1.0 + 1e-9:
            raise InputError(
                f"{self._what}: coherence must be at most 1, got {arrays['coherence'].max():.6g}."
            )

    @property
    def _what(self) -> str:
        return f"Frequency response {self.source} -> {self.response}"

    @property
    def magnitude(self) -> Floats:
        """Magnitude in `unit`, shape (n_frequencies,)."""
        return np.abs(self.values)

    @property
    def magnitude_db(self) -> Floats:
        """Magnitude in dB of one `unit`, shape (n_frequencies,); -inf where the value is zero."""
        with np.errstate(divide="ignore"):
            return np.asarray(20.0 * np.log10(self.magnitude))

    @property
    def phase(self) -> Floats:
        """Phase [rad] unwrapped from the lowest frequency on, shape (n_frequencies,); negative for a lag."""
        return np.unwrap(np.angle(self.values))

    def phase_next_to(self, omega: Floats, phase: Floats) -> Floats:
        """Return the phase on the branch next to that of another curve: a turn of 2 pi is no difference.

        Parameters
        ----------
        omega, phase
            Frequencies [rad/s], ascending, and phase [rad] of the other curve, shape (n,) each.

        Returns
        -------
        Phase [rad], shape (n_frequencies,).
        """
        near = np.interp(self.omega, omega, phase)
        return near + (np.angle(self.values) - near + np.pi) % (2.0 * np.pi) - np.pi

    def band(self, lower: float, upper: float) -> Self:
        """Return the part from `lower` to `upper` [rad/s], both included.

        Raises
        ------
        InputError
            If no frequency lies between them.
        """
        return self.at((self.omega >= lower) & (self.omega <= upper), f"from {lower:g} to {upper:g} rad/s")

    def at(self, kept: NDArray[np.bool_], which: str = "as chosen") -> Self:
        """Return the frequencies where `kept`, shape (n_frequencies,), is true.

        Raises
        ------
        InputError
            If none is true; `which` describes the request in the message.
        """
        if not kept.any():
            raise InputError(
                f"{self._what}: no frequency {which}; it reaches from {self.omega[0]:.4g} to {self.omega[-1]:.4g} rad/s."
            )
        changed: dict[str, Any] = {
            field.name: getattr(self, field.name)[kept]
            for field in fields(self)
            if isinstance(getattr(self, field.name), np.ndarray)
        }
        return replace(self, **changed)

    def to_control(self) -> Any:
        """Return the values as a ``control.FrequencyResponseData`` with one input and one output."""
        import control

        return control.frd(
            self.values, self.omega, inputs=[self.source], outputs=[self.response], smooth=False
        )

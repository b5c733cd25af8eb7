"""Where a search begins: the first values of parameters and initial states, and the bounds of the states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigsight.identify.fit.coordinates import Coordinates
from rigsight.identify.fit.fit_data import FitData
from rigsight.identify.fit.settled_states import guessed_states, moving_or_at_rest
from rigsight.simulate import has_dry_friction

_STATE_RANGE = 20.0
"""Largest distance of an initial state from its first estimate, in units of its size."""


@dataclass(frozen=True)
class SearchStart:
    """Start of a search, dimensionless."""

    coordinates: Coordinates  # of the free parameters
    # Free parameters, then the initial states of each record, shape (n_free + n_records * n_states,).
    theta: NDArray[np.float64]
    # Initial states of each record in units of their sizes, each of shape (n_states,).
    places: list[NDArray[np.float64]]
    # Bounds of the initial states of each record, as `places`.
    lower: list[NDArray[np.float64]]
    upper: list[NDArray[np.float64]]

    @property
    def n_states(self) -> int:
        """Number of states of the structure."""
        return self.lower[0].size

    @classmethod
    def of(
        cls,
        data: FitData,
        scales: Mapping[str, float],
        values: Mapping[str, float],
        free: Sequence[str],
        initial_states: Sequence[NDArray[np.float64]] | None = None,
    ) -> SearchStart:
        """Return the start of a search."""
        coordinates = Coordinates.of(data.structure, free, values, scales)
        states = list(initial_states) if initial_states is not None else guessed_states(data, values)
        if has_dry_friction(data.structure):
            states = moving_or_at_rest(data, values, states)
        own = coordinates.from_values(values)
        sizes = data.state_sizes(coordinates.to_parameters(own)[:, None])[:, 0]
        limited = data.limited
        places = [np.where(limited, np.clip(s / sizes, -1.0, 1.0), s / sizes) for s in states]
        return cls(
            coordinates=coordinates,
            theta=np.concatenate([own, *places]),
            places=places,
            lower=[np.where(limited, -1.0, place - _STATE_RANGE) for place in places],
            upper=[np.where(limited, 1.0, place + _STATE_RANGE) for place in places],
        )

"""Motion of a random rig, by a separate integrator that shares neither code nor input samples with the simulation.

The eighth-order method of Dormand and Prince (scipy) with error control, restarted at every kink, when an internal state reaches
its limit, when friction sticks or slips, and when the input jumps. Each such moment is found as a root along the method's
interpolant.

References
----------
E. Hairer, S. P. Norsett and G. Wanner, *Solving Ordinary Differential Equations I* (Springer 1993), sections II.5 and II.6.
A. F. Filippov, *Differential Equations with Discontinuous Righthand Sides* (Kluwer 1988), for sticking as sliding along v = 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DOP853
from scipy.optimize import brentq

from rigsight.errors import SimulationError
from rigsight.simulate import Structure
from rigsight_bench.trials.standard.switches import SwitchedEquations, switched_equations
from rigsight_bench.trials.waveforms import Signal, Waveform

RELATIVE_TOLERANCE = 1e-8
_ABSOLUTE_TOLERANCE = 1e-9
"""Of each state, in units of its size."""
_LOOKS = np.arange(1, 11) / 10.0
"""Places along a step at which kinks are looked for: a sign may change twice within one step."""
_MOST_EVENTS = 100_000
_MOST_WITHOUT_PROGRESS = 50
_INSTANT = 1e-12
"""Time [s] within which two events count as one moment."""
_BEYOND = (0.0, 1e-13, 1e-12, 1e-11, 1e-10, 1e-9)
"""How far past a root [s] one looks for the side on which the condition is broken."""
_NUDGE = 1e-6
"""Share of a step after which a condition that began at zero must hold, or was broken from the begin."""
_INSIDE = 1e-12
"""How far inside its range a memory counts at least while it moves inwards, in units of the range."""
_PROBE = 1e-9
"""Time [s] after which a plant that has just been let go shows in which direction it moves."""
_NESTING = 3
"""Passes after which signs whose arguments hold other signs have settled."""


@dataclass
class _Mode:
    """What is frozen until the next event."""

    signs: list[int]
    held: list[int]
    """0 where a limited state is free, -1 or 1 at the end where it is held."""
    stuck: bool = False

    @property
    def free(self) -> list[int]:
        return [0 if end else 1 for end in self.held]


@dataclass
class _Samples:
    """States at given times, filled as the integration passes them."""

    times: NDArray[np.float64]
    states: NDArray[np.float64]
    filled: int = field(default=0)


class Plant:
    """A rig with its effects and numbers, ready to be driven.

    Parameters
    ----------
    structure
        Rig and effects; the rig must have an input that moves a mass.
    values
        Value of every parameter by name.
    sizes
        Size of each state, shape (n_states,): below a billionth of it an error does not count.
    """

    def __init__(self, structure: Structure, values: Mapping[str, float], sizes: NDArray[np.float64]) -> None:
        self.structure = structure
        self._equations = switched_equations(structure, values)
        self._sizes = sizes

    def respond(
        self,
        waveform: Waveform,
        disturbance: Signal,
        initial_state: NDArray[np.float64],
        start: float,
        dt: float,
        n_samples: int,
    ) -> NDArray[np.float64]:
        """Return the outputs at ``t = 0, dt, ...``, shape (n_samples, n_outputs), without sensor noise.

        Parameters
        ----------
        waveform
            The input.
        disturbance
            Torque (force) beside the drive at any time.
        initial_state
            Shape (n_states,), at the time `start`.
        start
            Time before t = 0 at which the plant is let go [s].
        dt
            Sample time [s].
        n_samples
            Number of samples.

        Raises
        ------
        SimulationError
            If the motion diverges, or events accumulate.
        """
        late = self._equations.reading_delay
        grid = dt * np.arange(n_samples, dtype=np.float64)
        n_states = initial_state.size
        wanted = [_Samples(grid, np.full((n_samples, n_states), np.nan))]
        if late != 0.0:
            wanted.append(_Samples(np.maximum(grid - late, start), np.full((n_samples, n_states), np.nan)))
        run = _Run(self._equations, self._sizes, waveform, disturbance)
        try:
            # A reading that is recorded early shows the motion after the end of the record.
            run.integrate(initial_state, start, float(grid[-1]) + max(-late, 0.0), wanted)
        except (OverflowError, ValueError, ZeroDivisionError) as error:
            raise SimulationError(f"The motion of {self.structure.rig.name} diverges: {error}.") from None
        outputs = self._outputs(wanted[0])
        if late != 0.0:
            outputs[:, 0] = self._outputs(wanted[1])[:, 0]
        if not np.all(np.isfinite(outputs)):
            raise SimulationError(f"The motion of {self.structure.rig.name} overflows.")
        return outputs

    def _outputs(self, reached: _Samples) -> NDArray[np.float64]:
        outputs = self._equations.outputs(reached.times, *reached.states.T)
        return np.column_stack([np.broadcast_to(output, reached.times.size) for output in outputs])


class _Run:
    """One integration from begin to end."""

    def __init__(
        self,
        equations: SwitchedEquations,
        sizes: NDArray[np.float64],
        waveform: Waveform,
        disturbance: Signal,
    ) -> None:
        self._equations = equations
        self._tolerances = _ABSOLUTE_TOLERANCE * sizes
        self._waveform = waveform
        self._disturbance = disturbance
        self._input = waveform.piece(0)
        self._mode = _Mode([1] * equations.n_signs, [0] * len(equations.limited))
        self._events = 0

    def integrate(
        self, state: NDArray[np.float64], start: float, stop: float, wanted: list[_Samples]
    ) -> None:
        breaks = [t + self._equations.delay for t in self._waveform.breaks]
        ends = [t for t in breaks if start < t < stop]
        first = len(breaks) - len([t for t in breaks if t > start])
        t = start
        self._input = self._waveform.piece(first)
        self._enter(t, state)
        for piece, end in enumerate([*ends, stop], start=first):
            self._input = self._waveform.piece(piece)
            state = self._piece(state.copy(), t, end, wanted)
            t = end

    def _piece(
        self, state: NDArray[np.float64], t: float, end: float, wanted: list[_Samples]
    ) -> NDArray[np.float64]:
        step: float | None = None
        idle = 0
        while t < end:
            solver = DOP853(
                self._rates, t, state, end, rtol=RELATIVE_TOLERANCE, atol=self._tolerances,  # type: ignore[arg-type]
                first_step=None if step is None else min(step, end - t),
            )  # fmt: skip
            begin = t
            event = None
            while solver.status == "running" and event is None:
                # A motion that leaves the range of numbers is told below, once.
                with np.errstate(over="ignore", invalid="ignore"):
                    message = solver.step()
                if message is not None or not np.all(np.isfinite(solver.y)):
                    raise SimulationError(f"The plant cannot be integrated past {solver.t:.4g} s: {message}")
                with np.errstate(over="ignore", invalid="ignore"):
                    path = solver.dense_output()
                event = self._first_event(path, solver.t_old, solver.t)
                t = solver.t if event is None else event[0]
                _fill(wanted, path, t)
                step = max(solver.t - solver.t_old, 1e-9)
            state = solver.y if event is None else path(t)
            if event is not None:
                idle = idle + 1 if t - begin < _INSTANT else 0
                self._events += 1
                if idle > _MOST_WITHOUT_PROGRESS or self._events > _MOST_EVENTS:
                    raise SimulationError(f"Events accumulate at {t:.6g} s: the plant chatters.")
                self._pass(event[1], t, state)
        return state

    def _arguments(self, t: float, state: NDArray[np.float64]) -> list[float]:
        return self._equations.arguments(*self._now(t, state), *self._mode.signs, *self._mode.free)

    def _driven(self, t: float, state: NDArray[np.float64]) -> list[float]:
        return self._equations.driven(*self._now(t, state), *self._mode.signs, *self._mode.free)

    def _now(self, t: float, state: NDArray[np.float64]) -> list[float]:
        return [t, self._input(t - self._equations.delay), self._disturbance(t), *state.tolist()]

    def _rates(self, t: float, state: NDArray[np.float64]) -> NDArray[np.float64]:
        rates = self._equations.rates(*self._now(t, state), *self._mode.signs, *self._mode.free)
        if self._mode.stuck:
            rates[self._equations.velocity] = 0.0
        return np.array(rates, dtype=np.float64)

    def _pushed(self, t: float, state: NDArray[np.float64]) -> tuple[float, float]:
        """Return the accelerations just above and just below standstill."""
        index = self._equations.velocity_sign
        assert index is not None
        both = []
        for sign in (1, -1):
            signs = [*self._mode.signs]
            signs[index] = sign
            rates = self._equations.rates(*self._now(t, state), *signs, *self._mode.free)
            both.append(rates[self._equations.velocity])
        return both[0], both[1]

    def _conditions(self, t: float, state: NDArray[np.float64]) -> list[float]:
        """Return what stays at or above zero until an event: one number per sign, per limited state, and two if stuck."""
        mode, equations = self._mode, self._equations
        conditions = [s * g for s, g in zip(mode.signs, self._arguments(t, state), strict=True)]
        if mode.held:
            driven = self._driven(t, state)
            for i, limit, end, rate in zip(
                equations.limited, equations.limits, mode.held, driven, strict=True
            ):
                # Just let go, a memory may stand a rounding error beyond its end; what moves inwards is free.
                inside = limit - abs(state[i])
                if state[i] * rate < 0.0:
                    inside = max(inside, _INSIDE * limit)
                conditions.append(end * rate if end else inside)
        if mode.stuck:
            above, below = self._pushed(t, state)
            conditions += [-above, below]
        return conditions

    def _first_event(self, path, begin: float, end: float) -> tuple[float, int] | None:  # type: ignore[no-untyped-def]
        """Return time and number of the first condition that is broken within a step, just after it broke."""
        if not self._mode.signs and not self._mode.held:
            return None
        intact = begin
        times = begin + _LOOKS * (end - begin)
        for t, state in zip(times.tolist(), path(times).T, strict=True):
            conditions = self._conditions(t, state)
            broken = [i for i, value in enumerate(conditions) if value < 0.0]
            if broken:
                return min((self._root(path, intact, t, i), i) for i in broken)
            intact = t
        return None

    def _root(self, path, intact: float, broken: float, index: int) -> float:  # type: ignore[no-untyped-def]
        """Return a time at which a condition is just broken: the signs after an event are then those of its state."""

        def condition(t: float) -> float:
            return self._conditions(t, path(t))[index]

        if condition(intact) == 0.0:
            intact += _NUDGE * (broken - intact)
        if condition(intact) <= 0.0:
            return intact
        root = float(brentq(condition, intact, broken, xtol=1e-13, rtol=1e-14))
        for beyond in _BEYOND:
            t = min(root + beyond, broken)
            if condition(t) < 0.0:
                return t
        return broken

    def _enter(self, t: float, state: NDArray[np.float64]) -> None:
        """Determine the current modes of a plant at the start."""
        index = self._equations.velocity_sign
        if index is not None and state[self._equations.velocity] == 0.0:
            above, below = self._pushed(t, state)
            self._mode.stuck = above <= 0.0 <= below
        self._settle(t, state + _PROBE * self._rates(t, state))

    def _pass(self, number: int, t: float, state: NDArray[np.float64]) -> None:
        """Change the mode after an event; `state` is put exactly where the event holds it."""
        equations, mode = self._equations, self._mode
        if number < equations.n_signs:
            if number == equations.velocity_sign:
                above, below = self._pushed(t, state)
                if above <= 0.0 <= below:
                    mode.stuck = True
                    state[equations.velocity] = 0.0
                    return
            self._settle(t, state)
            return
        place = number - equations.n_signs
        if place < len(mode.held):
            if mode.held[place]:
                self._settle(t, state)
                mode.held[place] = 0
            else:
                index = equations.limited[place]
                mode.held[place] = 1 if state[index] > 0.0 else -1
                state[index] = mode.held[place] * equations.limits[place]
            return
        mode.stuck = False
        assert equations.velocity_sign is not None
        mode.signs[equations.velocity_sign] = 1 if place == len(mode.held) else -1
        self._settle(t, state + _PROBE * self._rates(t, state))

    def _settle(self, t: float, state: NDArray[np.float64]) -> None:
        """Let every frozen sign follow its argument, and every memory go that is no longer driven against its end."""
        mode = self._mode
        for _ in range(_NESTING):
            for i, argument in enumerate(self._arguments(t, state)):
                if argument != 0.0 and not (mode.stuck and i == self._equations.velocity_sign):
                    mode.signs[i] = 1 if argument > 0.0 else -1
        if mode.held:
            driven = self._driven(t, state)
            mode.held = [end if end * rate >= 0.0 else 0 for end, rate in zip(mode.held, driven, strict=True)]


def _fill(wanted: list[_Samples], path, until: float) -> None:  # type: ignore[no-untyped-def]
    """Store the states at all wanted times up to `until`."""
    for samples in wanted:
        stop = int(np.searchsorted(samples.times, until + _INSTANT, side="right"))
        if stop > samples.filled:
            samples.states[samples.filled : stop] = path(samples.times[samples.filled : stop]).T
            samples.filled = stop

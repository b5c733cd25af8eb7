"""Solution of the equations by another integrator: scipy's DOP853, restarted at every sample and at every kink."""

from __future__ import annotations

import bisect
import itertools
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from scipy.integrate import DOP853
from scipy.optimize import brentq

from rigsight.simulate import Structure
from rigsight.simulate.equations.kinks import freeze
from rigsight.simulate.equations.structure import TIME, input_symbols
from rigsight.simulate.input_hold import HeldInput

Floats = NDArray[np.float64]
RTOL = 1e-11
_LOOKS = 12
"""Places within a step at which switches are looked at, so that a contact that opens and closes is seen without its slope."""
_MOST_EVENTS = 200


class Truth:
    """The equations of a structure with numbers, advanced by DOP853.

    Parameters
    ----------
    structure
        Rig and effects.
    p
        Parameters, shape (n_parameters,).
    held
        Input between its samples.
    sizes
        Size of each state, in which an absolute error is counted, shape (n_states,).
    longest
        Longest step [s]. A friction that rises over a tiny velocity acts for so short a time that long steps miss it.
    """

    def __init__(
        self, structure: Structure, p: Floats, held: HeldInput, sizes: Floats, longest: float = np.inf
    ) -> None:
        frozen = freeze(structure)
        numbers = dict(zip(structure.parameter_symbols, map(float, p), strict=True))
        states = list(structure.states)
        self._states = states
        signals = [*input_symbols(0), TIME]

        def compiled(expressions: Any, modes: bool) -> Any:
            arguments = [signals, states, list(frozen.modes)] if modes else [signals, states]
            bound = [sp.sympify(e).xreplace(numbers) for e in expressions]
            own = [{"positive_part": lambda x: max(x, 0.0), "sign": np.sign, "absolute": abs}, "math"]
            return sp.lambdify(arguments, bound, modules=own, cse=True)

        self._rates = compiled(frozen.rates, True)
        self._switches = compiled(frozen.switches, True)
        self._reading = compiled(structure.outputs[:1], False)
        self._limits = {
            i: float(e.limit.xreplace(numbers))
            for i, e in enumerate(structure.equations)
            if e.limit is not None
        }
        single = frozen.single_friction
        self._friction, self._velocity = None if single is None else single.mode, structure.velocity_index
        self._dependent = frozen.dependent_modes
        self._held = held
        self._atol = RTOL * np.maximum(sizes, 1e-290)
        self._delay = 0.0 if structure.delay is None else float(structure.delay.xreplace(numbers))
        late = structure.first_shown_late
        self._late = 0.0 if late is None else float(late.xreplace(numbers))
        self._longest = longest
        self._modes = [1.0] * len(frozen.modes)
        self._largest = np.zeros(len(frozen.modes) + (0 if self._friction is None else 2))
        self._holds = False

    def reading(self, state: Floats, n_samples: int) -> Floats:
        """Return the first output at each sample, shape (n_samples,), from the states at the start; NaN behind the record."""
        dt = self._held.interval * self._held.per_sample
        end = dt * (n_samples - 1)
        shift = self._delay
        n_pieces = self._held.n_pieces
        cuts = {self._held.interval * k for k in range(n_pieces + 1)}
        cuts |= {self._held.interval * k + shift for k in range(n_pieces + 1)}
        wanted = [k * dt - self._late for k in range(n_samples)]
        times = sorted({t for t in (*cuts, *wanted) if 0.0 <= t <= end + 1e-12 * dt})
        merged = [times[0]]
        for t in times[1:]:
            if t - merged[-1] > 1e-9 * dt:
                merged.append(t)
        # A model without states is begun with a stand-in for them.
        y = np.array(state[: len(self._states)], dtype=float)
        self._row = self._row_at(0.0)
        self._read_signs(0.0, y, jump=True)
        start_rate = self._rates(self._signals(0.0), y, self._modes)
        found = [self._read(0.0, y)]
        for begin, stop in itertools.pairwise(merged):
            self._row = self._row_at(0.5 * (begin + stop))
            if not self._held.continuous or begin == 0.0:
                self._read_signs(begin, y, jump=True)
            y = self._advance(begin, stop, y)
            found.append(self._read(stop, y))
        out = np.empty(n_samples)
        for k, t in enumerate(wanted):
            if t <= 0.0:
                # Before the record the motion went on as it started.
                out[k] = found[0] + (start_rate[0] * t if self._late else 0.0)
                continue
            if t > end + 1e-9 * dt:
                # An early reading shows what comes behind the record, of which the input says nothing.
                out[k] = np.nan
                continue
            place = min(bisect.bisect_left(merged, t - 1e-9 * dt), len(merged) - 1)
            out[k] = found[place]
        return out

    def _row_at(self, t: float) -> int:
        """Return the row of the input's coefficients that holds at a time."""
        return int(np.floor((t - self._delay) / self._held.interval)) + 1 if t >= self._delay else 0

    def _signals(self, t: float) -> tuple[float, float, float, float]:
        c = self._held.coefficients[min(self._row, self._held.n_pieces)]
        tau = t - self._delay - (self._row - 1) * self._held.interval if self._row else 0.0
        value = c[0] + tau * (c[1] + tau * (c[2] + tau * c[3]))
        return value, c[1] + tau * (2.0 * c[2] + 3.0 * tau * c[3]), 2.0 * c[2] + 6.0 * tau * c[3], t

    def _read(self, t: float, y: Floats) -> float:
        return float(self._reading(self._signals(t), y)[0])

    def _slopes(self, t: float, y: Floats) -> Floats:
        k = np.array(self._rates(self._signals(t), y, self._modes), dtype=float)
        if self._holds:
            k[self._velocity] = 0.0
        return k

    def _at_rest(self, t: float, y: Floats, sign: float) -> float:
        still, modes = y.copy(), list(self._modes)
        still[self._velocity] = 0.0
        modes[self._friction] = sign
        return float(self._rates(self._signals(t), still, modes)[self._velocity])

    def _crossed(self, t: float, y: Floats) -> NDArray[np.bool_]:
        """Tell which switches are crossed by more than rounding."""
        g = self._distances(t, y)
        self._largest = np.maximum(self._largest, np.abs(g))
        return g < -1e-14 * self._largest

    def _distances(self, t: float, y: Floats) -> Floats:
        g = np.array(self._switches(self._signals(t), y, self._modes), dtype=float) * self._modes
        if self._friction is None:
            return g
        watch = [1.0, 1.0]
        if self._holds:
            g[self._friction] = 1.0
            watch = [-self._at_rest(t, y, 1.0), self._at_rest(t, y, -1.0)]
        return np.append(g, watch)

    def _decide(self, t: float, y: Floats) -> None:
        forward, backward = self._at_rest(t, y, 1.0), self._at_rest(t, y, -1.0)
        self._holds = not (forward > 0.0 or backward < 0.0)
        self._modes[self._friction] = -1.0 if backward < 0.0 and not forward > 0.0 else 1.0

    def _read_signs(self, t: float, y: Floats, jump: bool) -> None:
        which = range(len(self._modes)) if jump else self._dependent
        for _ in which:
            g = self._switches(self._signals(t), y, self._modes)
            for i in which:
                if abs(g[i]) > 1e-14 * self._largest[i]:
                    self._modes[i] = -1.0 if g[i] < 0.0 else 1.0
        if jump and self._friction is not None and y[self._velocity] == 0.0:
            self._decide(t, y)

    def _advance(self, t: float, end: float, y: Floats) -> Floats:
        if not y.size:
            return y
        for _ in range(_MOST_EVENTS):
            if end - t <= 1e-13 * (end - t + 1.0) or end <= t:
                return y
            solver = DOP853(self._slopes, t, y, end, max_step=self._longest, rtol=RTOL, atol=self._atol)
            event = None
            while event is None and solver.status == "running":
                solver.step()
                if solver.status == "failed":
                    raise ArithmeticError("DOP853 failed")
                if self._modes:
                    event = self._first_crossing(solver)
            if event is None:
                return np.array(solver.y)
            t, y = event
            self._cross(t, y)
        raise ArithmeticError("too many events")

    def _first_crossing(self, solver: DOP853) -> tuple[float, Floats] | None:
        dense = solver.dense_output()
        before = solver.t_old
        for t in np.linspace(solver.t_old, solver.t, _LOOKS + 1)[1:]:
            crossed = np.flatnonzero(self._crossed(t, dense(t)))
            if crossed.size:
                times = []
                for i in crossed:
                    low = float(self._distances(before, dense(before))[i])
                    times.append(
                        before
                        if low <= 0.0
                        else brentq(
                            lambda s, i=i: self._distances(s, dense(s))[i], before, t, xtol=1e-16, rtol=1e-14
                        )
                    )
                at = max(min(times), solver.t_old)
                # Just behind, so that the switch is seen as crossed.
                nudge = max(1e-15 * abs(at), 1e-13 * (solver.t - solver.t_old))
                while not np.any(self._crossed(at, dense(at))) and at < t:
                    at = min(at + nudge, t)
                    nudge *= 2.0
                return at, np.array(dense(at))
            before = t
        return None

    def _cross(self, t: float, y: Floats) -> None:
        crossed = self._crossed(t, y)
        n = len(self._modes)
        watch = self._distances(t, y)[n:]
        for i in range(n):
            if crossed[i]:
                self._modes[i] = -self._modes[i]
        if self._limits:
            for i, limit in self._limits.items():
                y[i] = min(max(y[i], -limit), limit)
            self._read_signs(t, y, jump=False)
        if self._friction is not None:
            if crossed[n] or crossed[n + 1]:
                self._holds = False
                self._modes[self._friction] = 1.0 if watch[0] < 0.0 else -1.0
            elif crossed[self._friction]:
                y[self._velocity] = 0.0
                self._decide(t, y)

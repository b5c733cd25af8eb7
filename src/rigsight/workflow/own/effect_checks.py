"""Checks by simulation that an effect vanishes at null, stays finite, generates no energy and is recovered by a fit.

Each check returns a sentence that describes the error, or None.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np

from rigsight.effects import Effect, Energy, Place
from rigsight.errors import SimulationError
from rigsight.excitation import linear_sweep
from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.records import Floats, Record
from rigsight.rigs import joint_of
from rigsight.simulate import compose, simulate
from rigsight.units import characteristic_value
from rigsight.workflow.own.effect_benches import (
    AXIS_BENCH,
    ELEMENT_BENCH,
    RESONANCE,
    Bench,
    bench_of,
)

PER_PERIOD = 200
"""Samples per period of a sine test."""
FULL, SMALL = 1.0, 0.3
"""Amplitudes of sine tests."""
_NEAR_NULL = 1e-6
_CONTINUOUS = 1e-3
"""Largest change of the response that close to null, relative to the motion."""
_STEADY = 1e-3
_ENERGY = 5e-3
_NOISE = 1e-3
"""Noise relative to the motion: small enough for an effect to be seen, far above the error of the integrator."""
_LEVELS = (1.0, 50.0)
"""Drive levels of the sweeps; the second is for effects that show at large angles only."""
_WRONG = (1.2, 0.8, 1.3, 0.75)
"""Factors on the true values at which fits start, the next where a fit ended elsewhere: with play some do."""
_NOISE_ALONE = 0.05
_SIGMAS = 4.5
_SEEN = 0.3
"""Largest relative standard error of a parameter that counts as determined."""


def sine_record(
    amplitude: float, n_periods: int, omega: float = 0.25 * RESONANCE, bench: Bench = AXIS_BENCH
) -> Record:
    """Return the input of a sine test; by default so low that the third harmonic stays below the resonance."""
    dt = 2.0 * np.pi / omega / PER_PERIOD
    time = dt * np.arange(n_periods * PER_PERIOD + 1)
    source = bench.rig.inputs[0]
    return Record("sine", dt, {source.name: amplitude * np.sin(omega * time)}, {source.name: source.unit})


def sizes(bench: Bench, record: Record) -> dict[str, float]:
    """Return the size of each base quantity when the rig without the effect runs a record."""
    return characteristic_scales(
        bench.rig, [simulate(compose(bench.rig), bench.values, record)], bench.values
    )


def start_values(effect: Effect) -> list[dict[str, float]]:
    """Return the bench's values with all combinations of the effect's first two start values."""
    bench = bench_of(effect)
    scales = sizes(bench, sine_record(FULL, 3, bench=bench))
    choices = []
    for p in effect.parameters:
        size = characteristic_value(p.dimension, scales)
        starts = [start * size for start in p.starts[:2]] if p.starts else [p.default or 0.0]
        choices.append([(p.name, value) for value in starts])
    return [{**bench.values, **dict(choice)} for choice in itertools.product(*choices)]


def box_values(effect: Effect, rng: np.random.Generator) -> list[dict[str, float]]:
    """Return the bench's values with the corners of the search box and random points in it, as far as a search goes there."""
    bench = bench_of(effect)
    scales = sizes(bench, sine_record(FULL, 3, bench=bench))
    fitted = [p for p in effect.parameters if p.fitted]
    corners = list(itertools.product(*[p.search for p in fitted]))
    inside = [tuple(rng.uniform(*p.search) for p in fitted) for _ in range(5)]
    points = []
    for point in corners + inside:
        own = {
            p.name: c * characteristic_value(p.dimension, scales) for p, c in zip(fitted, point, strict=True)
        }
        held = [p for p in effect.parameters if not p.fitted]
        own |= {p.name: p.held_at(characteristic_value(p.dimension, scales)) for p in held}
        # A search varies sum and difference themselves. With a negative sum the internal state grows without bound; with the
        # steeper unloading branch a saturated loop returns only by rounding errors.
        if all(
            own[pair.first] + own[pair.second] >= 0.0
            and own[pair.first] - own[pair.second] >= min(pair.difference_range[0], 0.0)
            for pair in effect.searched_as
        ):
            points.append({**bench.values, **own})
    return points


def null_gives_the_rig(effect: Effect) -> str | None:
    """Check that its null values leave the rig exactly as it is."""
    null = effect.null_values()
    with_effect, plain = _with_and_without(effect, null)
    if np.array_equal(with_effect, plain):
        return None
    changed = _difference(with_effect, plain)
    return (
        f"with {_reported(null)} the simulation differs from that of the rig without the effect: {changed}."
    )


def _with_and_without(effect: Effect, values: dict[str, float]) -> tuple[Floats, Floats]:
    """Return the motion in a sine test with an effect that has these values, and without it."""
    bench = bench_of(effect)
    record = sine_record(FULL, 3, bench=bench)
    plain = simulate(compose(bench.rig), bench.values, record)
    run = simulate(compose(bench.rig, [effect]), {**start_values(effect)[0], **values}, record)
    return run[bench.output], plain[bench.output]


def vanishes_continuously(effect: Effect) -> str | None:
    """Check that close to its null values the response is close to that of the rig without the effect."""
    start = start_values(effect)[0]
    near = {
        name: null / 2.0 if abs(null) > 1e3 * abs(start[name]) else _close(null, start[name])
        for name, null in effect.null_values().items()
    }
    with_effect, plain = _with_and_without(effect, near)
    if np.max(np.abs(with_effect - plain)) <= _CONTINUOUS * np.max(np.abs(plain)):
        return None
    return (
        f"close to its null values ({_reported(near)}) the simulation is not close to that of the rig without the effect: "
        f"it differs {_difference(with_effect, plain)}. The effect must vanish continuously at its null values."
    )


def _close(null: float, start: float) -> float:
    return 1e-4 * start if null == 0.0 else null + _NEAR_NULL * (start - null)


def gives_no_energy(effect: Effect) -> str | None:
    """Check that in a steady cycle a dissipative effect dissipates energy, and a conservative one does no net work."""
    if effect.place is not Place.DYNAMICS or effect.energy is Energy.ACTIVE:
        return None
    for values, taken in energy_of_cycles(effect):
        if taken < -_ENERGY or (effect.energy is Energy.CONSERVATIVE and taken > _ENERGY):
            verb = "generates" if taken < 0.0 else "dissipates"
            return (
                f"it is declared {effect.energy.value}, but {verb} {abs(taken):.1%} of the work of a cycle "
                f"({_reported({p.name: values[p.name] for p in effect.parameters})}). Check the sign: a torque opposes motion."
            )
    return None


def energy_of_cycles(effect: Effect) -> list[tuple[dict[str, float], float]]:
    """Return what an effect takes of the work of each steady cycle below resonance; motions that do not settle are left out."""
    bench = bench_of(effect)
    # A position drive pushes by its stiffness times the goal: its spring does no net work, its damping does as the joint's.
    pushed = "force" if bench is ELEMENT_BENCH else bench.rig.inputs[0].name
    stiffness, damping = bench.values.get("k_p", 1.0), bench.values["d"] + bench.values.get("k_v", 0.0)
    found = []
    for omega in (0.4 * RESONANCE, 0.9 * RESONANCE):
        record = sine_record(SMALL, 40, omega, bench)
        for values in start_values(effect):
            run = simulate(compose(bench.rig, [effect]), values, record)
            x = run["x"]
            cycle, before = last_period(x), x[-2 * PER_PERIOD - 1 : -PER_PERIOD - 1]
            still = np.ptp(cycle) == 0.0
            if still or np.max(np.abs(cycle - before)) > _STEADY * np.ptp(cycle):
                continue
            step = np.diff(np.append(cycle, cycle[0]))
            force = stiffness * last_period(run[pushed])
            work = float(np.sum(0.5 * (force + np.roll(force, -1)) * step))
            damper = damping * float(np.sum(step**2)) / record.dt
            found.append((values, (work - damper) / (abs(work) + damper)))
    return found


def last_period(samples: Floats) -> Floats:
    """Return the last full period of a sine test, shape (PER_PERIOD,)."""
    return samples[-PER_PERIOD - 1 : -1]


def finite_where_searched(effect: Effect) -> str | None:
    """Check that the simulation stays finite in the whole search range."""
    bench = bench_of(effect)
    record = sine_record(FULL, 3, bench=bench)
    may_escape = effect.energy is Energy.CONSERVATIVE and any(
        p.null is not None and p.search[0] < p.null for p in effect.parameters
    )
    for values in box_values(effect, np.random.default_rng(11)):
        try:
            finite = bool(
                np.all(np.isfinite(simulate(compose(bench.rig, [effect]), values, record)[bench.output]))
            )
        except SimulationError:
            # A spring that softens to zero releases the mass: allowed only if the sign of the parameter is free.
            finite = may_escape
        if not finite:
            own = {p.name: values[p.name] for p in effect.parameters}
            return (
                f"it cannot be simulated at {_reported(own)}, which is inside its search ranges; narrow them."
            )
    return None


def is_found_again(effect: Effect) -> str | None:
    """Check that a fit to its own noisy simulation returns its parameters."""
    bench = bench_of(effect)
    failed = None
    for amplitude in _LEVELS:
        failed = _recovered(effect, bench, amplitude)
        if failed is None:
            return None
    return failed


def _recovered(effect: Effect, bench: Bench, amplitude: float) -> str | None:
    rng = np.random.default_rng(4)
    t = 0.01 * np.arange(1500, dtype=np.float64)
    source = bench.rig.inputs[0].name
    driven = [
        Record("sweep", 0.01, {source: linear_sweep(t, share * amplitude, 1.0, 30.0)}, {}, hold="zoh")
        for share in (0.4, 1.0)
    ]
    plain = [simulate(compose(bench.rig), bench.swept, record) for record in driven]
    scales = characteristic_scales(bench.rig, plain, bench.swept)
    structure = compose(bench.rig, [effect], effect.special_cases)
    size = {p.name: characteristic_value(p.dimension, scales) for p in effect.parameters}
    own = [p for p in effect.parameters if p.fitted and p.name not in effect.special_cases]
    truth = {
        **bench.swept,
        **{p.name: p.default for p in effect.parameters if p.default is not None},
        **{p.name: p.held_at(size[p.name]) for p in effect.parameters if not p.fitted},
        **{p.name: p.starts[0] * size[p.name] for p in own},
    }
    bases = ("x", "length") if bench.rig.is_driven else ("force",)
    noise = {s.name: _NOISE * scales[base] for s, base in zip(bench.rig.outputs, bases, strict=False)}
    records = []
    for record in driven:
        simulated = simulate(structure, truth, record)
        noisy = {
            name: simulated[name] + rng.normal(scale=s, size=record.n_samples) for name, s in noise.items()
        }
        records.append(simulated.with_signals(**noisy))
    joint = joint_of(bench.rig, effect)
    known = bench.rig.constant_forces_at(joint) if effect.holds_constant_force else frozenset()
    free = [*(name for name in bench.free if name not in known), *(p.name for p in own)]
    problem = GreyBoxFit(structure, records, scales, noise)
    for wrong in _WRONG:
        start = {name: value * (wrong if name in free else 1.0) for name, value in truth.items()}
        if effect.place is Place.DISTURBANCE:
            # A time-domain fit does not find a frequency that is off by more than one cycle over the record.
            for p in own:
                if p.dimension == "time^-1":
                    start[p.name] = truth[p.name] + 1.0 / float(t[-1])
        result = problem.fit(start, free)
        if abs(result.weighted_rms - 1.0) <= _NOISE_ALONE:
            break
    else:
        return (
            f"fits to its own simulation, with start values {_WRONG[0] - 1.0:.0%} off, have a residual of "
            f"{result.weighted_rms:.2f} times the noise; the equation is not smooth enough in its parameters, or starts and "
            "search are unsuitable."
        )
    for p in own:
        error = result.standard_errors[p.name]
        # The parts of a sum count in units of the largest: a small one need not be known as well.
        summed = effect.linear_parameters if p in effect.linear_parameters else ()
        alike = [abs(truth[q.name]) for q in (p, *summed) if q.dimension == p.dimension]
        if not error < _SEEN * (max(alike) or size[p.name]):
            return (
                f"records do not determine {p.name}: {truth[p.name]:.3g} is estimated with a standard error of {error:.2g}. "
                "Fix it (fitted=False with a default), or choose starts at which the effect is strong."
            )
    for name in free:
        error = result.standard_errors[name]
        if abs(result.values[name] - truth[name]) >= _SIGMAS * error:
            return (
                f"a fit to its own simulation returns {name} = {result.values[name]:.4g} +- {error:.2g} "
                f"instead of {truth[name]:.4g}."
            )
    return None


CHECKS: tuple[Callable[[Effect], str | None], ...] = (
    null_gives_the_rig,
    vanishes_continuously,
    gives_no_energy,
    finite_where_searched,
    is_found_again,
)
"""In the order in which their messages are most useful."""


def failed_checks(effect: Effect) -> tuple[str, ...]:
    """Return the failed checks of an effect with a valid declaration, one sentence each."""
    found: list[str] = []
    for check in CHECKS:
        try:
            failed = check(effect)
        except (ArithmeticError, np.linalg.LinAlgError) as error:
            failed = f"it cannot be simulated or fitted at its start values: {error}"
        if failed is not None:
            found.append(failed)
    return tuple(found)


def _reported(values: dict[str, float]) -> str:
    return ", ".join(f"{name} = {value:.4g}" for name, value in values.items())


def _difference(samples: Floats, plain: Floats) -> str:
    return f"by {float(np.max(np.abs(samples - plain)) / np.max(np.abs(plain))):.2g} of the motion"

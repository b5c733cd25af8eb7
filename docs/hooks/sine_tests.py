"""By which responses does an effect show itself beside the linear rig? Sine tests, loops and phases, simulated.

What is shown follows from the declaration: gain over frequency at three amplitudes where an effect changes with amplitude, else
gain and phase; the force loop where a bench can prescribe the motion; both paths of the running gear for what its sensor does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigsight.effects import Effect, GainTrend, Place
from rigsight.errors import SimulationError
from rigsight.records import Record
from rigsight.rigs import ELEMENT, RUNNING_GEAR
from rigsight.simulate import Structure, compose, simulate
from rigsight.units import INPUT_UNIT
from rigsight.workflow.own.effect_benches import GEAR_BENCH, Bench, bench_of
from rigsight.workflow.own.effect_checks import FULL, start_values

LEVELS = (0.3, 1.0, 3.0)
"""Amplitudes of the drive, in units of the one for which an effect's start values are scaled."""
LARGE_ANGLE = 20.0
"""Factor on the amplitudes of a pendulum: the axis of the tests turns through a hundredth of a radian only."""
HARDLY_DRIVEN = 0.1
"""Amplitude of the drive beside which a disturbance is seen."""
PER_PERIOD = 80
DECAY = 8.0
"""Time after which the rig of the tests has forgotten its start [s]."""
FREQUENCIES = np.geomspace(1.5, 50.0, 48)
"""Angular frequencies of the sine tests [rad/s]; the axis resonates at 10."""
SLOW = 2.5
SMALLEST = 2e-3
"""Share of the linear gain below which a rig counts as stuck, and nothing is drawn."""

Values = dict[str, float]


@dataclass(frozen=True)
class Line:
    """A curve: shape (n_points,) each; `level` counts the amplitudes, None for the linear rig."""

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    label: str
    level: int | None


@dataclass(frozen=True)
class Panel:
    """One picture: what is drawn over what."""

    title: str
    across: str
    up: str
    lines: tuple[Line, ...]
    logarithmic: tuple[bool, bool] = (False, False)


def panels(effect: Effect) -> tuple[Panel, Panel]:
    """Return the two pictures that show an effect."""
    if effect.place is Place.SENSOR:
        return _paths(effect)
    values, bench = _values(effect), bench_of(effect)
    levels = _levels(effect)
    steady = effect.signature.gain_trend is GainTrend.STEADY and not effect.signature.even_harmonics
    gain = _gain(effect, bench, values, levels[1:2] if steady else levels)
    if effect.place is Place.DISTURBANCE:
        return gain, _over_time(effect, bench, values, HARDLY_DRIVEN)
    if effect.lateral is not None or (
        (effect.drive is not None or effect.place is Place.CONTROLLER) and not steady
    ):
        return gain, _over_time(effect, bench, values, levels[1])
    if ELEMENT.offers(effect):
        return gain, _loop(effect, values, levels)
    return gain, _phase(effect, bench, values, levels[1])


def _levels(effect: Effect) -> tuple[float, ...]:
    factor = LARGE_ANGLE if effect.name == "gravity_pendulum" else 1.0
    return tuple(factor * level * FULL for level in LEVELS)


def _values(effect: Effect) -> Values:
    """Return the start values that show most, with the trend of the gain that the effect declares."""
    bench, levels = bench_of(effect), _levels(effect)
    linear = _first_harmonic(compose(bench.rig), bench, bench.values, levels[1], SLOW)
    structure = compose(bench.rig, [effect])
    best, farthest = None, -1.0
    for start in start_values(effect):
        values = {name: 0.0 if name.endswith("_off") else value for name, value in start.items()}
        if effect.name == "gravity_pendulum":
            # All of the stiffness is weight, as of anything that hangs freely.
            values["k_g"] = values["k"]
        small, full = (_first_harmonic(structure, bench, values, level, SLOW) for level in levels[:2])
        change = abs(full) / max(abs(small), 1e-30) - 1.0
        falls, rises = change < -1e-4, change > 1e-4
        trend = GainTrend.FALLS if falls else GainTrend.RISES if rises else GainTrend.STEADY
        distance = abs(full / linear - 1.0) if trend is GainTrend.STEADY else min(abs(change), 1.0)
        if trend is effect.signature.gain_trend and distance > farthest:
            best, farthest = values, distance
    return best or values


def _sine(bench: Bench, amplitude: float, omega: float, least: float = DECAY) -> Record:
    period = 2.0 * math.pi / omega
    dt = period / PER_PERIOD
    t = dt * np.arange((math.ceil(least / period) + 3) * PER_PERIOD)
    source = bench.rig.inputs[0]
    return Record("sine", dt, {source.name: amplitude * np.sin(omega * t)}, {source.name: source.unit})


def _response(
    structure: Structure, bench: Bench, values: Values, amplitude: float, over: str = ""
) -> NDArray[np.complex128]:
    """Return the first harmonic of an output over that of the input (or another output), shape (n_frequencies,)."""
    return np.array([_first_harmonic(structure, bench, values, amplitude, w, over) for w in FREQUENCIES])


def _first_harmonic(
    structure: Structure, bench: Bench, values: Values, amplitude: float, omega: float, over: str = ""
) -> complex:
    record = _sine(bench, amplitude, omega)
    try:
        moved = simulate(structure, values, record)
    except SimulationError:
        # Beyond the range in which the effect's equation makes sense.
        return complex(np.nan)
    below = moved[over] if over else record[bench.rig.inputs[0].name]
    response, source = (np.fft.rfft(signal[-2 * PER_PERIOD :])[2] for signal in (moved[bench.output], below))
    return complex(response / source)


def _gain(effect: Effect, bench: Bench, values: Values, levels: tuple[float, ...]) -> Panel:
    response = next(signal for signal in bench.rig.outputs if signal.name == bench.output)
    source = bench.rig.inputs[0]
    unit = f"{response.unit}/{'N' if source.unit == INPUT_UNIT else source.unit}"
    linear = np.abs(_response(compose(bench.rig), bench, values, FULL))
    structure = compose(bench.rig, [effect])
    lines = [Line(FREQUENCIES, linear, "linear rig", None)]
    for number, level in enumerate(levels):
        gain = np.abs(_response(structure, bench, values, level))
        shown = np.where(gain > SMALLEST * linear, gain, np.nan)
        lines.append(Line(FREQUENCIES, shown, _level_name(levels, number), number if len(levels) > 1 else 1))
    title = "Gain at three amplitudes" if len(levels) > 1 else "Gain"
    return Panel(title, "angular frequency [rad/s]", f"gain [{unit}]", tuple(lines), (True, True))


def _level_name(levels: tuple[float, ...], number: int) -> str:
    if len(levels) == 1:
        return "with the effect"
    return f"with the effect, amplitude {levels[number] / levels[1]:g}"


def _phase(effect: Effect, bench: Bench, values: Values, level: float) -> Panel:
    return Panel(
        "Phase",
        "angular frequency [rad/s]",
        "phase [degrees]",
        tuple(
            Line(FREQUENCIES, _degrees(_response(structure, bench, values, level)), label, number)
            for structure, label, number in _both(effect, bench)
        ),
        (True, False),
    )


def _both(effect: Effect, bench: Bench) -> tuple[tuple[Structure, str, int | None], ...]:
    return (compose(bench.rig), "linear rig", None), (compose(bench.rig, [effect]), "with the effect", 1)


def _degrees(response: NDArray[np.complex128]) -> NDArray[np.float64]:
    return np.degrees(np.unwrap(np.angle(response)))


def _paths(effect: Effect) -> tuple[Panel, Panel]:
    """Return the phases of what the sensor shows and of what follows from it, which tell a late sensor from a late drive."""
    values = {**_values(effect), **{n: v for n, v in GEAR_BENCH.values.items() if not n.endswith("_off")}}
    yaw = Bench(RUNNING_GEAR, values, "psi", values, ())
    lateral = Bench(RUNNING_GEAR, values, "y", values, ())
    pictures = []
    for bench, over, title in ((yaw, "", "Phase of psi over u"), (lateral, "psi", "Phase of y over psi")):
        lines = [
            Line(FREQUENCIES, _degrees(_response(structure, bench, values, FULL, over)), label, number)
            for structure, label, number in _both(effect, bench)
        ]
        across, up = "angular frequency [rad/s]", "phase [degrees]"
        pictures.append(Panel(title, across, up, tuple(lines), (True, False)))
    return pictures[0], pictures[1]


def _over_time(effect: Effect, bench: Bench, values: Values, level: float) -> Panel:
    record = _sine(bench, level, SLOW)
    shown = slice(-2 * PER_PERIOD, None)
    t = record.t[shown] - record.t[shown][0]
    lines = [
        Line(t, simulate(structure, values, record)[bench.output][shown], label, number)
        for structure, label, number in _both(effect, bench)
    ]
    title = f"Answer to a sine of amplitude {level / _levels(effect)[1]:g}"
    return Panel(title, "time [s]", f"{bench.output} [m]", tuple(lines))


def _loop(effect: Effect, values: Values, levels: tuple[float, ...]) -> Panel:
    """Return the force over two prescribed motions, of the size that the drive of the sine tests gives when it is slow."""
    own = {name: value for name, value in values.items() if name not in ("gain", "m", "x_off")}
    t = 2.0 * math.pi / SLOW / (4 * PER_PERIOD) * np.arange(12 * PER_PERIOD + 1)
    period = slice(-4 * PER_PERIOD - 1, None)
    lines = []
    for number, level in enumerate(levels[:2]):
        x = level / values["k"] * np.sin(SLOW * t)
        record = Record("loop", float(t[1]), {"x": x}, {"x": "m"})
        for structure, label, which in (
            (compose(ELEMENT), "linear element", None),
            (compose(ELEMENT, [effect]), _level_name(levels, number), number),
        ):
            force = simulate(structure, own, record)["force"]
            lines.append(Line(x[period], force[period], label, which))
    return Panel("Force over prescribed motion", "displacement [m]", "force [N]", tuple(lines))

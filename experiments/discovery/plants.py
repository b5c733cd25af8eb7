"""Six plants whose laws are known, integrated by scipy apart from rigsight's simulator, written as campaigns.

Each is swept at three amplitudes and stepped once; the sensors have noise of a thousandth of the motion. The laws of `saturating`
and `bump` are in no library of rigsight as they stand here.

Run with ``python experiments/discovery/plants.py [FOLDER]``, then ``side_by_side.py FOLDER/*``.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

M, D, K = 1.0, 3.0, 400.0
DT, SECONDS = 5e-3, 15.0
NOISE = 1e-3
SWEEPS = {"sweep_half": 0.5, "sweep_full": 1.0, "sweep_double": 2.0, "sweep_between": 1.4}
HELD_OUT = ("sweep_between", "step")
Rates = Callable[[np.ndarray, float], list[float]]


@dataclass(frozen=True)
class Plant:
    """States, displacements first, and their rates for an input."""

    rates: Rates
    n_states: int
    force: float  # amplitude of the input [N]
    rig: str
    outputs: tuple[str, ...] = ("x",)


def one_mass(law: Callable[[float, float, float], float]) -> Rates:
    return lambda s, u: [s[1], (u - D * s[1] - K * s[0] - law(s[0], s[1], u)) / M]


def duffing_with_drag(x: float, v: float, _: float) -> float:
    return 4e5 * x**3 + 12.0 * abs(v) * v


def saturating(x: float, *_: float) -> float:
    """Return a spring beside the linear one whose force saturates."""
    return 3.0 * np.tanh(x / 5e-3)


def bump(_: float, v: float, __: float) -> float:
    """Return a damper that is harder in one direction."""
    return 4.0 * max(v, 0.0)


def motor_by_position(x: float, _: float, u: float) -> float:
    return u * (1.0 - np.exp(-8.0 * x))


def loop(s: np.ndarray, u: float) -> list[float]:
    x, v, z = s
    return [
        v,
        (u - D * v - 0.3 * K * x - 0.7 * K * z) / M,
        v - 150.0 * abs(v) * z - 60.0 * v * abs(z),
    ]


def two_masses(s: np.ndarray, u: float) -> list[float]:
    x_1, x_2, v_1, v_2 = s
    between = 0.6 * (v_1 - v_2) + 700.0 * (x_1 - x_2) + 6e5 * (x_1 - x_2) ** 3
    return [
        v_1,
        v_2,
        (u - 2.0 * v_1 - 900.0 * x_1 - between) / 1.2,
        (between - 1.5 * v_2 - 500.0 * x_2 - 25.0 * abs(v_2) * v_2) / 0.8,
    ]


AXIS = '[rig]\nmodel = "axis"\n[rig.constants]\ngain = 1.0\n[rig.parameters]\n'
TWO_MASSES = """[rig]
file = "two_masses.toml"
[rig.parameters]
"""
RIG = """name = "two_masses"
summary = "Two masses between walls, the first one driven."
[inputs.u]
unit = "N"
[parameters]
m_1 = { unit = "kg", lower = 1e-3, log = true, default = 1.0 }
m_2 = { unit = "kg", lower = 1e-3, log = true, default = 1.0 }
k_1 = { unit = "N/m", lower = 1e-3, log = true, default = 800.0 }
d_1 = { unit = "N s/m", lower = 1e-3, log = true, default = 1.0 }
k_2 = { unit = "N/m", lower = 1e-3, log = true, default = 600.0 }
d_2 = { unit = "N s/m", lower = 1e-3, log = true, default = 1.0 }
k_12 = { unit = "N/m", lower = 1e-3, log = true, default = 600.0 }
d_12 = { unit = "N s/m", lower = 1e-3, log = true, default = 1.0 }
[coordinates]
q_1 = { unit = "m" }
q_2 = { unit = "m" }
[energy]
kinetic = "m_1*d(q_1)^2/2 + m_2*d(q_2)^2/2"
[joints]
left = { motion = "q_1", stiffness = "k_1", damping = "d_1" }
coupling = { motion = "q_1 - q_2", stiffness = "k_12", damping = "d_12" }
right = { motion = "q_2", stiffness = "k_2", damping = "d_2" }
[drives]
motor = { signal = "u", force = "motor", along = "q_1" }
[sensors]
x_1 = { reads = "q_1", unit = "m" }
x_2 = { reads = "q_2", unit = "m" }
"""
PLANTS = {
    "duffing_with_drag": Plant(one_mass(duffing_with_drag), 2, 2.0, AXIS),
    "saturating": Plant(one_mass(saturating), 2, 2.0, AXIS),
    "bump": Plant(one_mass(bump), 2, 2.0, AXIS),
    "motor_by_position": Plant(one_mass(motor_by_position), 2, 4.0, AXIS),
    "loop": Plant(loop, 3, 2.0, AXIS),
    "two_masses": Plant(two_masses, 4, 6.0, TWO_MASSES, ("x_1", "x_2")),
}


def inputs() -> dict[str, np.ndarray]:
    """Return the inputs of all records, of amplitude one for `sweep_full`."""
    t = DT * np.arange(round(SECONDS / DT))
    ratio = np.log(60.0)
    sweep = np.sin(SECONDS / ratio * (np.exp(ratio * t / SECONDS) - 1.0))
    found = {name: amplitude * sweep for name, amplitude in SWEEPS.items()}
    return found | {"step": np.where((t > 1.0) & (t < 8.0), 1.5, 0.0)}


def measured(plant: Plant, u: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return time, input and readings, shape (n_samples, 2 + n_outputs)."""
    t = DT * np.arange(u.size)

    def rates(time: float, state: np.ndarray) -> list[float]:
        return plant.rates(state, float(np.interp(time, t, u)))

    start = np.zeros(plant.n_states)
    solved = solve_ivp(rates, (0.0, t[-1]), start, "LSODA", t, rtol=1e-9, atol=1e-12, max_step=DT)
    shown = solved.y[: len(plant.outputs)].T
    return np.column_stack([t, u, shown + NOISE * np.std(shown) * rng.standard_normal(shown.shape)])


def main(folder: Path) -> None:
    """Write a folder for each plant."""
    for number, (name, plant) in enumerate(PLANTS.items()):
        rng, own = np.random.default_rng(number), folder / name
        own.mkdir(parents=True, exist_ok=True)
        (own / "two_masses.toml").write_text(RIG, encoding="utf-8")
        text = f'title = "{name}"\n{plant.rig}'
        for record, u in inputs().items():
            rows = measured(plant, plant.force * u, rng)
            header = ",".join(["t", "u", *plant.outputs])
            np.savetxt(own / f"{record}.csv", rows, fmt="%.10g", delimiter=",", header=header, comments="")
            role = "validation" if record in HELD_OUT else "estimation"
            kind = "step" if record == "step" else "sweep"
            amplitude = plant.force * float(np.max(u))
            text += f'[[records]]\nfile = "{record}.csv"\nrole = "{role}"\nkind = "{kind}"\namplitude = {amplitude:.3g}\n'
        (own / "campaign.toml").write_text(text, encoding="utf-8")
        print(own)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("out/discovery/plants"))

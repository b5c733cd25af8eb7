"""BAM's friction models M1 to M6 fitted to logs of a servo, by BAM's error, bounds and search (CMA-ES).

Runs in an environment of its own, with better-actuator-models, cmaes and numba. Models, bounds and names are the package's. Its
simulation of a log is written again as compiled code and compared with the package's own before each fit. Prints one JSON list.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np
from bam.actuators import actuators
from bam.model import Model, load_model, models
from bam.simulate import Simulator
from cmaes import CMA
from logs import DT, DUTY, LENGTH, MASS, MOST_CURRENT, VOLTS, Log, divided, file_of
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]

WIDE = (
    "kt", "R", "armature", "q_offset", "friction_viscous", "friction_base", "friction_stribeck",
    "load_friction_motor", "load_friction_external", "load_friction_motor_stribeck",
    "load_friction_external_stribeck", "load_friction_motor_quad", "load_friction_external_quad",
    "dtheta_stribeck", "alpha",
)  # fmt: skip
# With one coefficient for both sides a model is the same with two equal ones.
SHARED = {
    "load_friction_base": ("load_friction_motor", "load_friction_external"),
    "load_friction_stribeck": ("load_friction_motor_stribeck", "load_friction_external_stribeck"),
}
SETS, RESTARTS, MOST_GENERATIONS = 24, 3, 600
PATIENCE, WORTH = 50, 2e-6  # generations without a gain of so many rad end a search


@njit
def run(p, goal, on, first, speed, gain, out):  # type: ignore[no-untyped-def]
    """Fill in the angles of each log; goal, on and out of shape (n_samples, n_logs)."""
    kt, r, armature, offset, viscous, base, falls = p[:7]
    motor, external, motor_falls, external_falls, motor_square, external_square, w_s, alpha = p[7:]
    inertia = MASS * LENGTH**2 + armature
    for log in range(goal.shape[1]):
        q, dq = first[log], speed[log]
        for i in range(goal.shape[0]):
            out[i, log] = q
            middle, span = kt * dq / VOLTS, r * MOST_CURRENT / VOLTS
            duty = min(max((goal[i, log] - q) * gain[log] * DUTY, middle - span), middle + span)
            duty = min(max(duty, -1.0), 1.0)
            drive = kt / r * (VOLTS * duty - kt * dq) * on[i, log]
            weight = -MASS * 9.80665 * LENGTH * np.sin(q + offset)
            slow = np.exp(-(abs(dq / w_s) ** alpha))
            friction = base + abs(weight * external - drive * motor)
            friction += slow * (falls + abs(weight * external_falls - drive * motor_falls))
            if np.sign(weight) != np.sign(drive):
                if abs(weight) < abs(drive):
                    friction += slow * external_square * weight**2
                elif abs(weight) > abs(drive):
                    friction += slow * motor_square * drive**2
            net = drive + weight
            stop = inertia / DT * dq + net
            net -= np.sign(stop) * min(abs(stop), friction + viscous * abs(dq))
            dq = min(max(dq + net / inertia * DT, -100.0), 100.0)
            q += dq * DT + 0.5 * net / inertia * DT**2


class Logs:
    """Logs as arrays, a column for each."""

    def __init__(self, folder: Path, logs: list[Log]) -> None:
        read = [np.genfromtxt(folder / file_of(log), delimiter=",", names=True) for log in logs]
        n = min(map(len, read))

        def columns(name: str) -> Floats:
            return np.ascontiguousarray(np.array([one[name][:n] for one in read]).T)

        self.goal, self.angle, speed = columns("goal"), columns("angle"), columns("speed")
        self.on = np.where(columns("torque_on") > 0.5, 1.0, 0.0)
        self.speed, self.gain = speed[0].copy(), np.array([float(gain) for gain, _ in logs])
        self.out = np.empty_like(self.goal)

    def angles(self, values: dict[str, float]) -> Floats:
        """Return the simulated angles, shape (n_samples, n_logs)."""
        run(widened(values), self.goal, self.on, self.angle[0], self.speed, self.gain, self.out)
        return self.out

    def errors(self, values: dict[str, float]) -> Floats:
        """Return the mean absolute error of each log [rad]."""
        return np.asarray(np.mean(np.abs(self.angles(values) - self.angle), axis=0))

    def of_package(self) -> dict[str, object]:
        """Return the same logs as the package's simulation takes them."""
        n = len(self.gain)
        same = {"mass": MASS, "arm_mass": 0.0, "length": LENGTH, "vin": VOLTS}
        entries = [
            {
                "position": self.angle[i].copy(),
                "speed": self.speed.copy(),
                "goal_position": self.goal[i],
                "torque_enable": self.on[i],
            }
            for i in range(len(self.goal))
        ]
        return {
            **{k: np.full(n, v) for k, v in same.items()},
            "kp": self.gain,
            "dt": DT,
            "entries": entries,
        }


def widened(values: dict[str, float]) -> Floats:
    """Return the numbers of any model as those of M6."""
    wide = dict.fromkeys(WIDE, 0.0) | {"dtheta_stribeck": 1.0, "alpha": 1.0}
    for name, value in values.items():
        wide |= dict.fromkeys(SHARED.get(name, (name,)), value)
    return np.array([wide[name] for name in WIDE])


def of_servo(name: str) -> Model:
    """Return a model of the package with the numbers of its XL330."""
    model = models[name]()
    model.set_actuator(actuators["xl330"]())
    return model


def difference(logs: Logs, name: str) -> float:
    """Return the largest difference to the package's own simulation, in rad, with drawn numbers."""
    rng, model = np.random.default_rng(0), of_servo(name)
    for parameter in model.get_parameters().values():
        parameter.value = parameter.min + (parameter.max - parameter.min) * rng.uniform(0.1, 0.5)
    values = {key: parameter.value for key, parameter in model.get_parameters().items()}
    theirs = Simulator(model).rollout_log(logs.of_package(), simulate_control=True)[0]
    return float(np.max(np.abs(np.array(theirs) - logs.angles(values))))


def fitted(logs: Logs, name: str, simpler: dict[str, float] | None) -> dict[str, float]:
    """Return the numbers with the lowest mean error; one of the searches begins at those of a simpler model."""
    parameters = of_servo(name).get_parameters()
    low = np.array([p.min for p in parameters.values()])
    width = np.array([p.max for p in parameters.values()]) - low
    lowest, best = np.inf, {}

    def values(place: Floats) -> dict[str, float]:
        return dict(zip(parameters, map(float, low + place * width), strict=True))

    for restart in range(RESTARTS):
        middle, spread = np.full(low.size, 0.5), 1 / 6
        if restart == 0 and simpler:
            begin = [simpler.get(key, _without(key, p.min, p.value)) for key, p in parameters.items()]
            middle, spread = np.clip((np.array(begin) - low) / width, 0.02, 0.98), 0.1
        bounds = np.tile([0.0, 1.0], (low.size, 1))
        search = CMA(mean=middle, sigma=spread, bounds=bounds, population_size=SETS, seed=restart)
        reached: list[float] = []
        while len(reached) < MOST_GENERATIONS and not search.should_stop():
            places = [search.ask() for _ in range(SETS)]
            errors = [float(np.mean(logs.errors(values(place)))) for place in places]
            search.tell(list(zip(places, errors, strict=True)))
            reached.append(min(errors))
            if reached[-1] < lowest:
                lowest, best = reached[-1], values(places[int(np.argmin(errors))])
            if len(reached) > 80 and min(reached[:-PATIENCE]) - min(reached) < WORTH:
                break
    return best


def _without(name: str, least: float, usual: float) -> float:
    return least if name.startswith(("load", "friction_stribeck")) else usual


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("logs", type=Path, help="folder of the logs")
    parser.add_argument("--split", required=True)
    choice = parser.parse_args()
    fit, held = (Logs(choice.logs, logs) for logs in divided(choice.split))
    rows, simpler = [], None
    for name in models:
        assert difference(fit, name) < 1e-12, f"{name} does not move as the package's own."
        began = time.process_time()
        simpler = fitted(fit, name, simpler)
        seconds = time.process_time() - began
        published = load_model(motor_name="xl330", model=name)
        given = {key: float(p.value) for key, p in published.get_parameters().items()}
        rows.append(
            {
                "model": name.upper(),
                "numbers": simpler,
                "fitted": fit.errors(simpler).tolist(),
                "held_out": held.errors(simpler).tolist(),
                "published": [*fit.errors(given).tolist(), *held.errors(given).tolist()],
                "seconds": seconds,
            }
        )
        print(f"  {name}: {seconds:.0f} s", file=sys.stderr, flush=True)
    print(json.dumps(rows))


if __name__ == "__main__":
    main()

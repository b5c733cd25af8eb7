"""Do the intervals of `rigsight discover` hold? Draws of the noise on plants whose equations are known.

Each draw measures a plant again, with sensor noise and, if asked for, with a disturbance of its force, and discovers on it as the
command does. Counted is how often each true coefficient lies within two of its standard errors, of the draws in which the terms
are right.

Run with ``python experiments/discovery/intervals.py PLANT [--draws N] [--disturbance SHARE]``; PLANT is one of those below, SHARE
the RMS of the disturbance in units of that of the input.
"""

from __future__ import annotations

import argparse
from collections import defaultdict

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.signal import lfilter

from rigsight.campaign import Campaign
from rigsight.discover.discovery import discover
from rigsight.discover.records import DiscoveryData
from rigsight.discover.terms import known_terms
from rigsight.excitation import log_sweep, multisine, multisine_lines
from rigsight.records import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate

DT, SECONDS = 5e-3, 10.0
NOISE = 2e-5
"""Of the displacement [m], which moves by some millimeters."""
LINEAR = {"gain": 1.0, "m": 0.5, "d": 1.5, "k": 120.0, "x_off": 0.0, "force_off": 0.0}
PLANTS: dict[str, tuple[tuple[str, ...], dict[str, float]]] = {
    "cubic": (("cubic_stiffness",), {"k_3": 4e5}),
    "friction": (("coulomb_friction",), {"T_c": 0.06}),
    "drag": (("quadratic_damping",), {"c_2": 12.0}),
    "loop": (
        ("bouc_wen_hysteresis",),
        {"k": 300.0, "a": 0.25, "A": 1.0, "beta": 1200.0, "gamma": 500.0, "n": 1.0},
    ),
}
SLOW = 0.9
"""Memory of the disturbance from one sample to the next."""


def measured(plant: str, seed: int, disturbance: float) -> DiscoveryData:
    """Return sweeps at three amplitudes and a held-out multisine."""
    rng = np.random.default_rng(seed)
    effects, own = PLANTS[plant]
    structure = compose(AXIS, [known_terms()[name] for name in effects])
    t = DT * np.arange(round(SECONDS / DT))
    inputs = [log_sweep(t, amplitude, 1.0, 60.0) for amplitude in (0.3, 0.6, 1.0)]
    lines = multisine_lines(t.size, DT, 1.0, 60.0)
    inputs.append(multisine(t.size, DT, lines, 0.45, rng).samples)
    records = []
    for number, u in enumerate(inputs):
        white = lfilter([1.0], [1.0, -SLOW], rng.standard_normal(u.size))
        force = disturbance * np.std(u) * white / np.std(white)
        role = "validation" if number == len(inputs) - 1 else "estimation"
        driven = Record(f"run {number}", DT, {"u": u + force}, {}, role=role)
        run = simulate(structure, {**LINEAR, **own}, driven)
        x = run["x"] + rng.normal(scale=NOISE, size=u.size)
        records.append(run.with_signals(u=u, x=x))
    campaign = Campaign(plant, AXIS, {"gain": LINEAR["gain"]}, {}, tuple(records))
    return DiscoveryData(campaign, {"x": NOISE})


def main() -> None:
    """Draw, discover, count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("plant", choices=PLANTS)
    parser.add_argument("--draws", type=int, default=40)
    parser.add_argument("--disturbance", type=float, default=0.0)
    asked = parser.parse_args()
    effects, own = PLANTS[asked.plant]
    truth = {**LINEAR, **own}
    scores, right = defaultdict[str, list[float]](list), 0
    for seed in range(asked.draws):
        found = discover(measured(asked.plant, seed, asked.disturbance))
        if {term.name for term in found.kept} != {*effects}:
            continue
        right += 1
        numbers = dict(found.rig_parameters)
        for term in found.kept:
            numbers |= term.coefficients
        for name, number in numbers.items():
            scores[name].append((number.value - truth[name]) / number.std)
    table = Table("coefficient", "within 2 standard errors", "spread of the errors in standard errors")
    for name, own_scores in scores.items():
        z = np.array(own_scores)
        table.add_row(name, f"{np.mean(np.abs(z) <= 2.0):.0%}", f"{np.sqrt(np.mean(z**2)):.2f}")
    console = Console(width=100)
    console.print(f"{asked.plant}: terms right in {right} of {asked.draws} draws.")
    console.print(table)


if __name__ == "__main__":
    main()

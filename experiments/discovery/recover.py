"""The equations that `rigsight discover` finds on a running gear with known equations, and the errors of the coefficients.

Measures a gear with Bouc-Wen hysteresis (its own numbers, or the sets R, B, P of the thesis) with four sweeps and a multisine,
writes the campaign and discovers on it as the command does: what is given are files with u, psi and y, and nothing else.

Run with ``python experiments/discovery/recover.py CASE [noise of psi in rad] [seed]``; the campaign and the results stay in
out/discovery.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from rich.console import Console

from rigsight.effects import effect_named
from rigsight.excitation import log_sweep, multisine, multisine_lines
from rigsight.records import Record
from rigsight.report.terminal import discovery_summary
from rigsight.rigs import RUNNING_GEAR
from rigsight.rigs.published import published_sets
from rigsight.simulate import compose, simulate
from rigsight.workflow.discover import run_discover

OUT = Path("out/discovery")
DT = 0.005
"""Sample time [s]."""
DURATION = 30.0
"""Of a sweep and of the multisine [s]."""
BAND = (1.0, 80.0)
"""Angular frequencies of both [rad/s]."""
REST = 2.0
"""Before and after a sweep [s]."""
VALIDATION = 0.35
"""Root mean square of the multisine's current [A]: between the sweeps."""
Y_NOISE = 2e-5
"""Of the lateral displacement [m]."""
LOOP = "bouc_wen_hysteresis"
GEAR = {
    "v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27,
    "J_z": 0.56, "k_c": 500.0, "k_d": 2.0, "psi_off": 1e-3, "l_0": 0.25, "c_y": 0.98, "y_off": 0.0,
    "A": 1.0, "a": 0.2, "beta": 1100.0, "gamma": 600.0, "n": 1.0,
}  # fmt: skip
"""A loop that is not stiff: beta + gamma = 1700."""


@dataclass(frozen=True)
class Case:
    """A gear and the sweeps it is driven with [A]."""

    values: dict[str, float]
    effects: tuple[str, ...] = (LOOP,)
    amplitudes: tuple[float, ...] = (0.25, 0.5, 0.75, 1.0)


CASES = {
    "gear": Case(GEAR),
    "one_amplitude": Case(GEAR, amplitudes=(0.5,)),
    "linear": Case(GEAR, effects=()),
    **{
        name: Case(published_sets()[name].values())
        for name in ("hysteresis_r", "hysteresis_b", "hysteresis_p")
    },
}


def measured(case: Case, noise: float, seed: int) -> list[Record]:
    """Return the records of a case with white noise: sweeps for estimation, a multisine for validation."""
    rng = np.random.default_rng(seed)
    structure = compose(RUNNING_GEAR, [effect_named(name) for name in case.effects])
    t = DT * np.arange(round(DURATION / DT))
    rest = np.zeros(round(REST / DT))
    driven = [
        Record(
            name=f"sweep_{amplitude:.2f}",
            dt=DT,
            signals={"u": np.concatenate([rest, log_sweep(t, amplitude, *BAND), rest])},
            units={},
            role="estimation",
            amplitude=amplitude,
        )
        for amplitude in case.amplitudes
    ]
    lines = multisine_lines(t.size, DT, *BAND)
    period = multisine(t.size, DT, lines, VALIDATION, rng).samples
    driven.append(Record(name="multisine", dt=DT, signals={"u": period}, units={}, role="validation"))
    records = []
    for record in driven:
        clean = simulate(structure, case.values, record)
        noisy = {
            name: clean[name] + rng.normal(scale=std, size=record.n_samples)
            for name, std in (("psi", noise), ("y", Y_NOISE))
        }
        records.append(replace(clean, signals={**clean.signals, **noisy}))
    return records


def written(title: str, constants: dict[str, float], records: list[Record], folder: Path) -> Path:
    """Write a campaign: one file per record, and nothing about the gear but its constants."""
    folder.mkdir(parents=True, exist_ok=True)
    text = [f'title = "{title}"', "[rig]", 'model = "running_gear"', "[rig.constants]"]
    text += [f"{name} = {value}" for name, value in constants.items()]
    text.append("[rig.parameters]")
    for record in records:
        table = np.column_stack([record.t, record["u"], record["psi"], record["y"]])
        np.savetxt(
            folder / f"{record.name}.csv", table, fmt="%.10g", delimiter=",", header="t,u,psi,y", comments=""
        )
        kind = "multisine" if record.name == "multisine" else "sweep"
        text += [
            "[[records]]",
            f'file = "{record.name}.csv"',
            f'role = "{record.role}"',
            f'kind = "{kind}"',
        ]
        text += [f"amplitude = {record.amplitude}"] if record.amplitude is not None else []
    (folder / "campaign.toml").write_text("\n".join(text) + "\n", encoding="utf-8")
    return folder


def with_unit_gain(values: dict[str, float]) -> dict[str, float]:
    """Return the same gear with A = 1: motion and input know only the product of A and the loop's share of the stiffness."""
    if "A" not in values:
        return values
    gain, share = values["A"], values["a"]
    stiffness = values["k_c"] * (share + (1.0 - share) * gain)
    power = gain ** (values["n"] - 1.0)
    return {
        **values,
        "A": 1.0,
        "k_c": stiffness,
        "a": share * values["k_c"] / stiffness,
        "beta": values["beta"] * power,
        "gamma": values["gamma"] * power,
    }


def main(name: str, noise: float, seed: int) -> None:
    case = CASES[name]
    folder = OUT / f"{name}_{noise:g}_{seed}"
    constants = {p.name: case.values[p.name] for p in RUNNING_GEAR.constants}
    campaign = written(f"{name}, noise {noise:g} rad", constants, measured(case, noise, seed), folder)
    started = time.perf_counter(), time.process_time()
    found = run_discover(campaign, folder / "discovered", n_jobs=1)
    passed = time.perf_counter() - started[0], time.process_time() - started[1]
    console = Console(highlight=False, width=150)
    console.print(discovery_summary(found))
    print(
        f"\n| {name}, noise {noise:g} rad, seed {seed} | true | found | error | standard error |\n|---|---|---|---|---|"
    )
    coefficients, truth = dict(found.rig_parameters), with_unit_gain(case.values)
    for term in found.kept:
        coefficients |= term.coefficients
    for parameter, c in coefficients.items():
        true = truth.get(parameter, 0.0)
        error = f"{100.0 * (c.value / true - 1.0):+.2f} %" if true else f"{c.value:+.2g}"
        size = f"{100.0 * c.std / abs(true):.2f} %" if true else f"{c.std:.2g}"
        print(f"| {parameter} | {true:.6g} | {c.value:.6g} | {error} | {size} |")
    print(f"terms: {[term.name for term in found.kept]}, {passed[0]:.0f} s, processor {passed[1]:.0f} s")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("case", choices=CASES)
    parser.add_argument("noise", nargs="?", type=float, default=1e-5, help="of psi [rad], default 1e-5")
    parser.add_argument("seed", nargs="?", type=int, default=0)
    asked = parser.parse_args()
    main(asked.case, asked.noise, asked.seed)

"""Five robot models: difference of the rig file to MuJoCo, time to read, compile and run it, and of the model written back."""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import mujoco
import numpy as np

from rigsight.records import Record
from rigsight.robots import free_run, load_model, write_back
from rigsight.robots.draft import draft_rig
from rigsight.simulate import compose, simulate
from rigsight.simulate.model import Model

MODELS = Path(__file__).parent / "models"
NAMES = ("cart_pole", "two_link_arm", "three_joint_arm", "six_joint_arm", "gearbox")
SECONDS, DT = 2.0, 0.002


def seconds(function, repeats: int = 1) -> tuple[float, object]:
    start = time.perf_counter()
    for _ in range(repeats):
        result = function()
    return (time.perf_counter() - start) / repeats, result


def row(name: str) -> str:
    path = MODELS / f"{name}.xml"
    model = load_model(path)
    draft = draft_rig(model, name)
    read, rig = seconds(lambda: draft.rig)
    made, structure = seconds(lambda: compose(rig, []))
    n = int(SECONDS / DT)
    inputs = {signal.name: np.full(n, 0.1) for signal in rig.inputs}
    record = Record("run", DT, inputs, {signal.name: signal.unit for signal in rig.inputs}, hold="zoh")
    values = {p.name: p.default for p in (*rig.constants, *rig.parameters)}
    start = np.zeros(len(structure.states))
    compiled, _ = seconds(lambda: simulate(structure, values, record, start))
    again, _ = seconds(lambda: simulate(structure, values, record, start), 5)
    data, own = mujoco.MjData(model), model
    own.opt.timestep = 0.001
    theirs, _ = seconds(lambda: mujoco.mj_step(own, data, int(SECONDS / 0.001)))
    before = free_run(load_model(path), draft)
    written = write_back(Model(structure, values, "zoh"), path)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / path.name
        file.write_text(written.text, encoding="utf-8")
        back = load_model(file)
        after = free_run(back, draft_rig(back, name))
    left = "; ".join(draft.left_out) or "nothing"
    return (
        f"| {name} | {before.worst:.0e} | {after.worst:.0e} | {read + made:.1f} | {compiled:.1f} | "
        f"{1e3 * again / SECONDS:.1f} | {1e3 * theirs / SECONDS:.1f} | {left} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=NAMES)
    print(
        "| model | difference to MuJoCo | the same, written back | reading and deriving, s | compiling, s | "
        "run, ms per s | MuJoCo's run at 1 ms, ms per s | not taken over |"
    )
    print("|---|---:|---:|---:|---:|---:|---:|---|")
    for name in parser.parse_args().names:
        print(row(name), flush=True)


if __name__ == "__main__":
    main()

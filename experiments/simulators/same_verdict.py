"""One rig simulated by its own equations, MuJoCo, an FMU and a Python function: verdicts and times."""

from __future__ import annotations

import argparse
import importlib.util
import tempfile
import time
from pathlib import Path

import numpy as np

from rigsight.effects import Effect, effect_named, placed
from rigsight.records import Record
from rigsight.rigs import read_rig_file
from rigsight.simulate import compose, simulate
from rigsight.simulators import give_function
from rigsight.workflow.diagnose import run_diagnose

_FILE = Path(__file__).parents[2] / "tests" / "simulators" / "cart_pendulum.py"
_SPEC = importlib.util.spec_from_file_location("cart_pendulum", _FILE)
assert _SPEC is not None
assert _SPEC.loader is not None
cart = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(cart)

DT, SECONDS = 0.005, 6.0
GIVEN = {"m_p": 0.2, "k_u": 2.0, "d_c": 4.0, "k_c": 150.0, "d_p": 0.02}
"""The simulation in question; the plant's numbers are up to a tenth beside."""
HIDDEN = {
    "coulomb_friction@track": {"T_c": (0.1, 0.3)},
    "input_delay@motor": {"T_d": (0.012, 0.03)},
    "cubic_stiffness@track": {"k_3": (20000.0, 60000.0)},
}
"""What is hidden, and the range that its number is drawn from."""
FMUS = {
    "fmu": ("2.0", "ModelExchange"),
    "co-simulation": ("2.0", "CoSimulation"),
    "co-simulation 3": ("3.0", "CoSimulation"),
}
"""Ways that are FMUs: version of FMI and kind."""
FEW = ("coulomb_friction", "quadratic_damping", "input_delay", "cubic_stiffness", "actuator_lag")


def written_rig(way: str, folder: Path) -> Path:
    """Write the rig file of a way, with what it names."""
    file = folder / f"{way}.toml"
    text = {"native": cart.NATIVE, "mujoco": cart.MUJOCO, "python": cart.PYTHON}.get(way, cart.FMU)
    if way == "mujoco":
        (folder / "cart.xml").write_text(cart.MJCF, encoding="utf-8")
        text = text.replace("FILE", "cart.xml")
    if way in FMUS:
        text = text.replace("FILE", cart.written_fmu(folder / "cart.fmu", *FMUS[way]).name)
    if way == "python":
        give_function("cart", cart.accelerations)
    file.write_text(cart.RIG + text, encoding="utf-8")
    return file


def write_campaign(way: str, seed: int, folder: Path) -> tuple[str, dict[str, float]]:
    """Draw numbers and an effect, write records and the campaign, and return what was hidden."""
    rng = np.random.default_rng(seed)
    rig = read_rig_file(written_rig("native", folder))
    true = {name: value * float(rng.uniform(0.9, 1.1)) for name, value in GIVEN.items()}
    name = list(HIDDEN)[seed % len(HIDDEN)]
    kind = name.partition("@")[0]
    effect = placed(effect_named(kind), name.partition("@")[2])
    number = {own: float(rng.uniform(*ends)) for own, ends in HIDDEN[name].items()}
    t = DT * np.arange(round(SECONDS / DT))
    text = [f'[rig]\nfile = "{way}.toml"\n']
    text += [] if way == "native" else [f'simulator = "{"fmu" if way in FMUS else way}"\n']
    text += ["[rig.parameters]\n", *(f"{key} = {value}\n" for key, value in GIVEN.items())]
    for i, role in enumerate(("estimation", "estimation", "validation")):
        u = (
            (2.0, 4.0, 3.0)[i]
            * np.sin(2 * np.pi * (0.3 * t + 1.7 * t**2 / (2 * SECONDS)) + i)
            * np.clip(t / 0.3, 0.0, 1.0)
        )
        run = Record(f"run_{i}", DT, {"u": u}, {"u": "V"}, hold="zoh")
        out = simulate(compose(rig, [effect]), {**true, **number}, run, accuracy=1e-8)
        columns = [t, u, *(out[s] + rng.normal(scale=2e-4, size=t.size) for s in ("cart", "angle"))]
        np.savetxt(
            folder / f"run_{i}.csv",
            np.column_stack(columns),
            delimiter=",",
            header="t,u,cart,angle",
            comments="",
        )
        text.append(f'[[records]]\nfile = "run_{i}.csv"\nrole = "{role}"\nhold = "zoh"\n')
    written_rig(way, folder)
    (folder / "campaign.toml").write_text("".join(text), encoding="utf-8")
    return name, {**true, **number}


def seconds_per_run(way: str, folder: Path) -> float:
    """Return how long a simulation of one record takes."""
    structure = compose(read_rig_file(folder / f"{way}.toml"))
    t = DT * np.arange(round(SECONDS / DT))
    run = Record("run", DT, {"u": 3.0 * np.sin(8.0 * t)}, {"u": "V"}, hold="zoh")
    values = {p.name: p.default for p in structure.parameters if p.default is not None}
    simulate(structure, values, run)
    begun = time.perf_counter()
    simulate(structure, values, run)
    return time.perf_counter() - begun


def row(way: str, seed: int, effects: list[Effect] | None) -> str:
    """Diagnose a drawn campaign by one way."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        hidden, true = write_campaign(way, seed, folder)
        per_run = seconds_per_run(way, folder)
        begun = time.process_time()
        diagnosis = run_diagnose(folder, folder / "results", effects=effects, seed=0, n_jobs=1)
        spent = time.process_time() - begun
    best = diagnosis.candidates[0]
    told = {key: value for key, value in best.parameters.items() if key in true and key not in GIVEN}
    numbers = ", ".join(f"{key} = {value.value:.4g} ({true[key]:.4g})" for key, value in told.items())
    return (
        f"| {hidden} | {way} | {', '.join(diagnosis.effects) or diagnosis.verdict} | {best.probability:.2f} | {numbers} | "
        f"{best.error_over_noise:.2f} | {1e3 * per_run:.2g} | {spent:.0f} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("ways", nargs="*", default=("native", "mujoco", *FMUS, "python"))
    parser.add_argument("--seeds", type=int, nargs="+", default=(0, 1, 2))
    parser.add_argument("--few", action="store_true", help=f"try {', '.join(FEW)} alone")
    choice = parser.parse_args()
    effects = [effect_named(name) for name in FEW] if choice.few else None
    print(
        "| hidden | moved by | verdict | probability | its number (true) | noise floors left | one run, ms | diagnosis, s |\n"
        "|---|---|---|---:|---|---:|---:|---:|"
    )
    for seed in choice.seeds:
        for way in choice.ways:
            print(row(way, seed, effects), flush=True)


if __name__ == "__main__":
    main()

"""How often the true place of an effect is among those that a diagnosis fits first.

    python experiments/places/run.py --draws 80

A draw is a drive train with parameters of its own, one effect of the catalogue at one of its places, and four records of 20 s at
200 Hz with 0.5 % of noise. Writes results.md beside this file.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rigsight.diagnose.fit_context import FitContext, candidates_on
from rigsight.diagnose.search.single_effects import reidentify
from rigsight.diagnose.search.starts import start_values
from rigsight.diagnose.search.worth_fitting import search_places
from rigsight.effects import CATALOGUE, Effect
from rigsight.errors import RigsightError
from rigsight.identify import characteristic_scales
from rigsight.records.record import Record
from rigsight.rigs import RIGS
from rigsight.simulate import compose, simulate

RIG = RIGS["drive_train"]
K_T = 0.05
DT, N = 5e-3, 4000
T = DT * np.arange(N)
NOISE = 5e-3

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Draw:
    """What one draw gave: the effect, the gap in noise floors, and the places in their order."""

    effect: str
    gap: float
    places: tuple[tuple[str, float, bool], ...]

    @property
    def place(self) -> str:
        return self.effect.split("@")[1]

    @property
    def is_first(self) -> bool:
        return self.places[0][0] == self.place

    @property
    def is_looked_at(self) -> bool:
        return any(name == self.place and examined for name, _, examined in self.places)


def values(rng: np.random.Generator) -> tuple[dict[str, float], float]:
    """Return parameters of a drive train, and the frequency [Hz] at which its load swings."""
    motor = 10.0 ** rng.uniform(-4.5, -3.5)
    load = motor * 10.0 ** rng.uniform(-0.5, 0.8)
    fast, slow = 2.0 * np.pi * rng.uniform(4.0, 15.0), 2.0 * np.pi * rng.uniform(0.8, 2.0)
    between, both = motor * load / (motor + load), motor + load
    damping = 2.0 * rng.uniform(0.02, 0.08, 3)
    found = {
        "k_t": K_T, "J_m": motor, "J_l": load, "k_s": between * fast**2, "k_l": both * slow**2,
        "d_s": damping[0] * between * fast, "d_m": 0.5 * damping[1] * both * slow, "d_l": 0.5 * damping[2] * both * slow,
    }  # fmt: skip
    return found, slow / (2.0 * np.pi)


def inputs(rng: np.random.Generator, slow: float) -> list[Floats]:
    """Return two multisines, a sweep and steps [A]."""
    lines = np.fft.rfftfreq(N, DT)
    band = np.flatnonzero((lines > 0.2 * slow) & (lines < 12.0 * slow))

    def multisine(amplitude: float) -> Floats:
        chosen = rng.choice(band, min(60, band.size), replace=False)
        wave = np.sum(
            [np.cos(2.0 * np.pi * lines[i] * T + rng.uniform(0.0, 2.0 * np.pi)) for i in chosen], axis=0
        )
        return np.asarray(amplitude * wave / np.max(np.abs(wave)))

    sweep = 0.6 * np.sin(2.0 * np.pi * slow * (0.2 * T + 3.9 * T**2 / T[-1]))
    return [multisine(1.0), multisine(0.3), sweep, np.repeat(rng.uniform(-0.8, 0.8, 8), N // 8)]


def records(
    effects: Sequence[Effect], numbers: dict[str, float], drives: Sequence[Floats], rng: np.random.Generator
) -> tuple[tuple[Record, ...], dict[str, float]]:
    """Return noisy records and the noise of each angle."""
    structure = compose(RIG, effects)
    clean = [
        simulate(structure, numbers, Record(f"record {i}", DT, {"u": drive}, {}))
        for i, drive in enumerate(drives)
    ]
    noise = {s.name: NOISE * float(np.std(np.concatenate([r[s.name] for r in clean]))) for s in RIG.outputs}
    noisy = [
        r.with_signals(**{n: r[n] + size * rng.standard_normal(N) for n, size in noise.items()})
        for r in clean
    ]
    return tuple(noisy), noise


def draw(seed: int) -> Draw | None:
    """Return what one draw gives; None where its motion has no bounds."""
    rng = np.random.default_rng(seed)
    numbers, slow = values(rng)
    candidates = [effect for effect in candidates_on(RIG, CATALOGUE) if effect.pulsation is None]
    kinds = sorted({effect.name.split("@")[0] for effect in candidates})
    alike = [effect for effect in candidates if effect.name.split("@")[0] == kinds[seed % len(kinds)]]
    effect = alike[int(rng.integers(len(alike)))]
    drives = inputs(rng, slow)
    try:
        without, noise = records((), numbers, drives, rng)
        scales = characteristic_scales(RIG, without, numbers)
        bench = FitContext(RIG, without, without, without, scales, noise, frozenset(), numbers)
        structure = compose(RIG, (effect,))
        starts = list(start_values(bench, structure, effect, reidentify(bench, numbers).fit, {}))
        hidden = {**starts[int(rng.integers(len(starts)))], **numbers}
        for parameter in effect.parameters:
            if parameter.null == 0.0:
                hidden[structure.parameter_name(effect, parameter.name)] *= rng.uniform(0.3, 3.0)
        measured, noise = records((effect,), hidden, drives, rng)
        scales = characteristic_scales(RIG, measured, numbers)
        bench = FitContext(RIG, measured, measured, measured, scales, noise, frozenset(), numbers)
        linear = reidentify(bench, numbers)
        found = search_places(bench, linear, candidates)
    except RigsightError:
        return None
    return Draw(
        effect.name, linear.error_over_noise, tuple((p.name, p.share, p.examined) for p in found.places)
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--draws", type=int, default=80)
    asked = parser.parse_args()
    lines, drawn = [], []
    for seed in range(asked.draws):
        found = draw(seed)
        if found is None:
            continue
        drawn.append(found)
        told = ", ".join(f"{name} {share:.2f}" for name, share, _ in found.places[:3])
        lines.append(
            f"| {seed} | {found.effect} | {found.gap:.3g} | {told} | {'yes' if found.is_first else 'no'} | "
            f"{'yes' if found.is_looked_at else '**no**'} |"
        )
        print(lines[-1], flush=True)
    large = [d for d in drawn if d.gap >= 10.0]
    summary = [
        f"- {name}: the true place came first in {sum(d.is_first for d in part)} of {len(part)}, and was looked at first in "
        f"{sum(d.is_looked_at for d in part)}."
        for name, part in (("All gaps", drawn), ("Gaps of 10 noise floors and more", large))
    ]
    head = ["| seed | hidden | gap [floors] | shares | first | looked at |", "|---|---|---|---|---|---|"]
    text = "\n".join([f"Written by `run.py --draws {asked.draws}`.", "", *summary, "", *head, *lines, ""])
    Path(__file__).with_name("results.md").write_text(text, encoding="utf-8")
    print("\n".join(summary))


if __name__ == "__main__":
    main()

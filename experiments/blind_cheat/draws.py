"""Check that the draws do not reveal the hidden effect to a cheat who knows their source code: rig, seed, random numbers."""

from __future__ import annotations

import itertools
import math
import time
from collections import Counter
from unittest.mock import patch

import numpy as np
from campaigns import REST, SEED, Campaign
from scipy.stats import chi2_contingency

from rigsight.rigs import AXIS, RUNNING_GEAR, Rig
from rigsight_bench.trials import draw_trial, n_trials
from rigsight_bench.trials.standard import trial
from rigsight_bench.trials.standard.campaign import LinearRig, draw_rig
from rigsight_bench.trials.standard.subjects import (
    Subject,
    hidden_effects,
    needs_running_gear,
    standard_subject_of,
)

SEEDS_OF_RIGS = range(10, 110)
"""Of the rigs that are drawn without being simulated."""
SEEDS_SEARCHED = range(100)


def rig(_: list[Campaign]) -> None:
    """Print what the rig tells about what is hidden: the design says which effects need which rig."""
    hidden, rigs, numbers = [], [], []
    for candidate in itertools.product(SEEDS_OF_RIGS, range(n_trials("standard"))):
        subject = standard_subject_of(*candidate)
        gear = any(needs_running_gear(effect) for effect in hidden_effects(subject))
        wide = "gravity_pendulum" in subject.effects
        drawn = draw_rig(stream(*candidate), RUNNING_GEAR if gear else None, wide)
        hidden.append("pair" if subject.kind == "pair" else " ".join(subject.effects) or subject.kind)
        rigs.append(drawn.rig.name)
        numbers.append({**numbers_of(drawn), "swings wide for the pendulum": float(wide)})
    both = [
        f"{name}{' wide' if own.get('size', 0.0) > 0.7 else ''}"
        for name, own in zip(rigs, numbers, strict=True)
    ]
    n = len(hidden)
    print(
        f"\n{n} rigs; guessing the most frequent subject is right in {max(Counter(hidden).values()) / n:.1%}"
    )
    for name, seen in (("the rig", rigs), ("the rig and the size of its motion", both)):
        among = [Counter(h for h, s in zip(hidden, seen, strict=True) if s == one) for one in set(seen)]
        right = sum(max(counter.values()) for counter in among)
        print(
            f"  knowing {name}: {right / n:.1%}; {information(hidden, seen):.3f} of {entropy(hidden):.2f} bit"
        )
    for one in sorted(set(both)):
        counter = Counter(h for h, s in zip(hidden, both, strict=True) if s == one)
        most = ", ".join(f"{name} {count / counter.total():.1%}" for name, count in counter.most_common(4))
        print(f"  {one}: {counter.total() / n:.1%} of all; {most}")
    print("p-value that a parameter of the rig is independent of the hidden effect, without pendulums:")
    for kind in sorted(set(rigs)):
        chosen = [
            (h, own) for h, r, own in zip(hidden, rigs, numbers, strict=True)
            if r == kind and not own["swings wide for the pendulum"]
        ]  # fmt: skip
        subjects, classes = np.unique([h for h, _ in chosen], return_inverse=True)
        for name in chosen[0][1]:
            values = np.array([own[name] for _, own in chosen])
            if np.ptp(values) > 0.0:
                tenths = np.searchsorted(np.quantile(values, np.arange(1, 10) / 10), values)
                table = np.zeros((subjects.size, 10))
                np.add.at(table, (classes, tenths), 1)
                print(f"  {kind} {name}: {chi2_contingency(table).pvalue:.3f}")


def numbers_of(drawn: LinearRig) -> dict[str, float]:
    """Return what is drawn of a rig, each number by itself."""
    v, omega = drawn.values, drawn.omega
    if drawn.rig is RUNNING_GEAR:
        own = {name: v[name] for name in ("J_z", "psi_off", "l_0", "c_y", "y_off")}
        return {**own, "omega": omega, "damping": v["k_d"] / (2.0 * v["J_z"] * omega)}
    size = v["gain"] / (v["d"] * omega)
    return {
        "m": v["m"],
        "omega": omega,
        "damping": v["d"] / (2.0 * v["m"] * omega),
        "size": size,
        "x_off": v["x_off"] / size,
    }


def entropy(values: list[str]) -> float:
    shares = np.array(list(Counter(values).values())) / len(values)
    return float(-np.sum(shares * np.log2(shares)))


def information(first: list[str], second: list[str]) -> float:
    """Return the mutual information [bit]."""
    joint = [f"{a}|{b}" for a, b in zip(first, second, strict=True)]
    return entropy(first) + entropy(second) - entropy(joint)


def stream(seed: int, number: int) -> np.random.Generator:
    """Return the random numbers from which a trial's rig is drawn, as the source of the draw says."""
    return np.random.default_rng(np.random.SeedSequence([seed, number, 0]).spawn(6)[0])


def seed(trials: list[Campaign]) -> None:
    """Print in how many campaigns the first sweep alone gives away seed and number, and with them what is hidden."""
    start = time.perf_counter()
    times = np.array([2.0, 4.0, 6.0])
    ways: list[tuple[Rig, bool]] = [(RUNNING_GEAR, False), (AXIS, False), (AXIS, True)]
    tried, inputs = [], []
    for candidate in itertools.product(SEEDS_SEARCHED, range(n_trials("standard"))):
        for kind, wide in ways:
            rng = stream(*candidate)
            omega = draw_rig(rng, kind, wide).omega
            first, last = (share * omega * math.exp(rng.uniform(-0.1, 0.1)) for share in (0.08, 6.0))
            growth = math.log(last / first) / 40.0
            inputs.append(0.25 * np.sin(first / growth * np.expm1(growth * times)))
            tried.append(candidate)
    seconds = time.perf_counter() - start
    table = np.array(inputs)
    found = right = 0
    for campaign in trials:
        seen = campaign.cells(1)[np.round(times / 5e-3).astype(int), 1].astype(float)
        matches = {tried[i] for i in np.flatnonzero(np.max(np.abs(table - seen), axis=1) < 1e-8)}
        found += len(matches) == 1
        right += matches == {(SEED, campaign.number)}
    print(
        f"\n{len(tried) // 3} seeds and numbers tried in {seconds:.0f} s: {found} of {len(trials)} campaigns found again, "
        f"{right} of them correctly"
    )


def random(_: list[Campaign]) -> None:
    """Print whether a trial's random numbers depend on what is hidden."""
    drawn = []
    for effect in ("cubic_stiffness", "position_dependent_damping"):
        with patch.object(
            trial, "standard_subject_of", lambda *_, e=effect: Subject("single", (e,), "clear", "low")
        ):
            drawn.append(draw_trial("standard", SEED, 0))
    alike = all(
        np.array_equal(a["u"], b["u"]) for a, b in zip(drawn[0].records, drawn[1].records, strict=True)
    )
    output = drawn[0].rig.outputs[0].name
    quiet = [np.diff(one.records[3][output][:REST], 2) for one in drawn]
    print(
        f"\none trial with two different effects: inputs the same: {alike}, rigs the same: "
        f"{drawn[0].values == drawn[1].values}, correlation of the noise {np.corrcoef(*quiet)[0, 1]:.4f}"
    )

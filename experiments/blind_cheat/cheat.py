"""Does anything in what a diagnosis gets tell what is hidden, other than the physics?

Draws 108 trials of the small design (seed 6: the first 100 and all others without an effect), unless `out/blind-cheat` holds
them, and looks at their campaigns as a cheat would, who knows the source of the draws but not the keys.

Run with ``python experiments/blind_cheat/cheat.py [part ...]``; parts: same, tests, noise, rig, seed, random, cache, process.
"""

from __future__ import annotations

import itertools
import json
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, chi2_contingency, norm
from sklearn.metrics import balanced_accuracy_score
from sklearn.model_selection import StratifiedKFold
from sklearn.tree import DecisionTreeClassifier

from rigsight.blind import draw, draw_trial, n_trials, subject_of
from rigsight.blind.campaign import LinearRig, draw_rig
from rigsight.blind.subjects import Subject, hidden_effects, needs_running_gear
from rigsight.rigs import AXIS, RUNNING_GEAR, Rig
from rigsight.workflow.blind_files import BenchFolder, trial_name
from rigsight.workflow.blind_trial import diagnose_trial, make_trial

Array = NDArray[np.float64]

SEED = 6
FIRST = 100
FOLDER = Path("out/blind-cheat")
NUMBER = rb"-?\d\.\d{9}e[+-]\d\d"
REST = 1000
"""Samples of the step's record before the step."""
PERMUTATIONS = 500
PLANTED = 0.4
SEEDS_OF_RIGS = range(10, 110)
"""Of the rigs that are drawn without being simulated."""
SEEDS_SEARCHED = range(100)
SPY = """
import json, os, sys
os.makedirs("results")
found = sorted(os.path.join(folder, name) for folder, _, names in os.walk(".") for name in names)
modes = [oct(os.stat(name).st_mode) for name in found]
parent = f"/proc/{os.getppid()}/cmdline"
reached = open(parent).read().replace(chr(0), " ") if os.path.exists(parent) else ""
seen = {"environment": dict(os.environ), "arguments": sys.argv, "files": found, "modes": modes, "order": os.listdir("campaign")}
json.dump({**seen, "parent": reached}, open("results/seen.json", "w"))
"""


@dataclass(frozen=True)
class Campaign:
    """What one diagnosis gets, and what was hidden from it.

    Attributes
    ----------
    number
        Number of the trial.
    key
        Its key.
    folder
        What the diagnosis gets.
    text
        Its campaign.toml.
    content
        The same, read.
    """

    number: int
    key: dict[str, Any]
    folder: Path
    text: str
    content: dict[str, Any]

    @property
    def rig(self) -> str:
        return str(self.content["rig"]["model"])

    def cells(self, record: int) -> NDArray[np.bytes_]:
        """Return the texts of a record's numbers, shape (n_samples, n_columns)."""
        header, body = (self.folder / f"record_{record}.csv").read_bytes().split(b"\n", 1)
        texts = np.array(body.replace(b"\n", b",").rstrip(b",").split(b","))
        return texts.reshape(-1, header.count(b",") + 1)


def campaigns() -> list[Campaign]:
    bench = BenchFolder(FOLDER)
    bench.settle("small", SEED)
    controls = ("none", "parameters")
    numbers = [
        n for n in range(n_trials("small")) if n < FIRST or subject_of("small", SEED, n).kind in controls
    ]
    found = []
    for number in numbers:
        make_trial(bench, "small", SEED, number)
        folder = bench.campaign(trial_name(number))
        text = (folder / "campaign.toml").read_text()
        key = bench.read_key(trial_name(number))
        found.append(Campaign(number, key, folder, text, tomllib.loads(text)))
    return found


def same(trials: list[Campaign]) -> None:
    """Print in how many variants each thing comes that ought to be the same for all trials on one rig."""
    print("\n| what | variants: axis | running gear |\n|---|---:|---:|")
    seen: dict[str, dict[str, set[Any]]] = {}
    for trial in trials:
        files = sorted(trial.folder.iterdir(), key=lambda file: file.stat().st_mtime_ns)
        records = [trial.cells(i) for i in range(1, 7)]
        things = {
            "file names": tuple(sorted(file.name for file in files)),
            "order in which files were written": tuple(file.name for file in files),
            "access rights of files": tuple(file.stat().st_mode for file in files),
            "`campaign.toml` without its numbers": re.sub(r"(?<![\w])-?\d[\d.e+-]*", "#", trial.text),
            "heads of records": tuple(
                (trial.folder / f"record_{i}.csv").read_bytes().split(b"\n")[0] for i in range(1, 7)
            ),
            "rows and columns of records": tuple(record.shape for record in records),
            "form of every number in records": tuple(
                re.fullmatch(rb"(?:" + NUMBER + rb",)*", b",".join(record.ravel()) + b",") is not None
                for record in records
            ),
            "sizes of records but for minus signs": tuple(
                (trial.folder / f"record_{i}.csv").stat().st_size - int(np.sum(np.char.startswith(record, b"-")))
                for i, record in enumerate(records, 1)
            ),
            "times of samples": tuple(b",".join(record[:, 0]) for record in records),
            "input of the step": b",".join(records[3][:, 1]),
            "amplitudes but the multisine's": tuple(r["amplitude"] for r in trial.content["records"][:5]),
        }  # fmt: skip
        if trial.rig == RUNNING_GEAR.name:
            things["constants of the running gear"] = tuple(trial.content["rig"]["constants"].values())
        for name, thing in things.items():
            seen.setdefault(name, {}).setdefault(trial.rig, set()).add(thing)
    for name, by_rig in seen.items():
        print(f"| {name} | {len(by_rig.get('axis', ())) or '-'} | {len(by_rig['running_gear'])} |")


def labels(trials: list[Campaign]) -> dict[str, list[str]]:
    """Return what may be told about each trial, in classes that are not too small."""
    places = []
    for trial in trials:
        where = [place.removeprefix("yaw_") for place in trial.key["where"]]
        one = where[0] if len(where) == 1 else "several" if where else "nothing"
        places.append(one if one in ("dynamics", "actuator", "nothing") else "elsewhere")
    kinds = ["nothing" if t.key["kind"] in ("none", "parameters") else t.key["kind"] for t in trials]
    return {"kind": kinds, "place": places, "strength": [str(t.key["aimed_tier"]) for t in trials]}


def features(trials: list[Campaign]) -> dict[str, Array]:
    """Return what a cheat may look at, by group; each of shape (n_trials, n_features)."""
    rows: dict[str, list[list[float]]] = {}
    rng = np.random.default_rng(0)
    kinds = [sorted({*labels(trials)["kind"]}).index(kind) for kind in labels(trials)["kind"]]
    # A leak of the size that these tests are meant to find.
    planted = np.where(rng.random(len(trials)) < PLANTED, kinds, rng.permutation(kinds))
    for trial, tells in zip(trials, planted, strict=True):
        records = [trial.cells(i) for i in range(1, 7)]
        outputs = np.concatenate([record[:, 2:].ravel() for record in records])
        last = [np.array([text[i] for text in outputs.tolist()]) - ord("0") for i in (-5, -6)]
        stats = [
            (trial.folder / name).stat()
            for name in ("campaign.toml", *(f"record_{i}.csv" for i in range(1, 7)))
        ]
        given = [float(value) for value in trial.content["rig"]["parameters"].values()]
        digits = [len(f"{value!r}".split("e")[0].strip("-0.").replace(".", "")) for value in given]
        constants = list(trial.content["rig"]["constants"].values())
        quiet = np.diff(records[3][:REST, 2].astype(float), 2)
        groups = {
            "times at which files were written (distances, parts of a second)": [
                *np.diff([s.st_mtime_ns for s in stats]), *(s.st_mtime_ns % 1e9 for s in stats)],
            "last two digits of outputs (histograms)": np.concatenate([np.bincount(x, minlength=10) for x in last]),
            "multisine's amplitude": [trial.content["records"][5]["amplitude"]],
            "constants": [*constants, *[0.0] * (4 - len(constants))],
            "number of digits of given parameters": [*digits, *[0] * (7 - len(digits))],
            "size of the noise at rest": [math.log(float(np.std(quiet)))],
            "sizes of records (minus signs)": [s.st_size for s in stats[1:]],
            "given parameters": [*given, *[0.0] * (7 - len(given))],
            f"planted: a number that tells the kind of {PLANTED:.0%} of the trials": [tells],
        }  # fmt: skip
        for name, values in groups.items():
            rows.setdefault(name, []).append([float(trial.rig == "axis"), *(float(v) for v in values)])
    return {name: np.array(values) for name, values in rows.items()}


def tests(trials: list[Campaign]) -> None:
    """Print how well a decision tree tells labels from features, and labels that are shuffled within each rig."""
    rigs = np.array([trial.rig for trial in trials])
    print(
        "\n| features | label | balanced accuracy | 95 % of shuffled labels within | p |\n|---|---|---:|---:|---:|"
    )
    # Parts of equal shares of both rigs: with shares of the labels the true ones would be split otherwise than the shuffled.
    parts = list(StratifiedKFold(5, shuffle=True, random_state=0).split(rigs, rigs))
    told = {name: np.array(values) for name, values in labels(trials).items()}
    for name, values in told.items():
        print(f"<!-- {name}: {dict(Counter(values.tolist()))} -->")
    for (group, x), (name, y) in itertools.product(features(trials).items(), told.items()):
        rng = np.random.default_rng(0)
        score = told_apart(x, y, parts)
        shuffled = [told_apart(x, shuffled_within(rigs, y, rng), parts) for _ in range(PERMUTATIONS)]
        low, high = np.quantile(shuffled, (0.025, 0.975))
        p = (1 + sum(one >= score for one in shuffled)) / (1 + PERMUTATIONS)
        print(f"| {group} | {name} | {score:.2f} | {low:.2f} to {high:.2f} | {p:.3f} |", flush=True)


def told_apart(x: Array, y: Any, parts: list[Any]) -> float:
    """Return the balanced accuracy of a tree on trials that it was not grown on."""
    tree = DecisionTreeClassifier(max_depth=4, min_samples_leaf=3, class_weight="balanced", random_state=0)
    predicted = np.empty_like(y)
    for known, new in parts:
        predicted[new] = tree.fit(x[known], y[known]).predict(x[new])
    return float(balanced_accuracy_score(y, predicted))


def shuffled_within(rigs: Any, y: Any, rng: np.random.Generator) -> Any:
    shuffled = y.copy()
    for one in np.unique(rigs):
        shuffled[rigs == one] = rng.permutation(y[rigs == one])
    return shuffled


def noise(trials: list[Campaign]) -> None:
    """Print whether last digits are spread evenly, and whether the noise of any two records has anything in common."""
    counts = np.zeros(10)
    statistics = []
    quiet = []
    for trial in trials:
        own = np.zeros(10)
        for i in range(1, 7):
            for text in trial.cells(i)[:, 2:].ravel().tolist():
                own[text[-5] - ord("0")] += 1
        counts += own
        statistics.append(float(np.sum((own - own.mean()) ** 2) / own.mean()))
        quiet += [np.diff(column.astype(float), 2) for column in trial.cells(4)[:REST, 2:].T]
    p_values = chi2.sf(statistics, 9)
    pooled = float(np.sum((counts - counts.mean()) ** 2) / counts.mean())
    print(
        f"\nlast digits: {counts.sum():.0f} numbers, p = {chi2.sf(pooled, 9):.2f} that all are equally frequent; "
        f"trials with p < 0.05: {np.mean(p_values < 0.05):.1%}"
    )
    spectra = [np.fft.rfft((q - q.mean()) / np.linalg.norm(q), 2 * REST) for q in quiet]
    peaks = [
        float(np.max(np.abs(np.fft.irfft(a * np.conj(b))))) for a, b in itertools.combinations(spectra, 2)
    ]
    # The second difference of white noise is colored: its own correlation widens that of two.
    r = np.array([1.0, -4.0 / 6.0, 1.0 / 6.0])
    spread = math.sqrt((1.0 + 2.0 * float(np.sum(r[1:] ** 2))) / REST)
    n_shifts = len(peaks) * (2 * REST - 1)
    print(
        f"noise at rest: {len(quiet)} signals, {len(peaks)} pairs at all shifts; largest correlation {max(peaks):.3f}, "
        f"of independent noise {spread * norm.isf(0.5 / n_shifts):.3f} expected; the same noise would give 1"
    )


def rig(_: list[Campaign]) -> None:
    """Print what the rig tells about what is hidden: the design says which effects need which rig."""
    hidden, rigs, numbers = [], [], []
    for candidate in itertools.product(SEEDS_OF_RIGS, range(n_trials("small"))):
        subject = subject_of("small", *candidate)
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
    print("p that a number of the rig does not depend on what is hidden, pendulums left out:")
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
    for candidate in itertools.product(SEEDS_SEARCHED, range(n_trials("small"))):
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
    for trial in trials:
        seen = trial.cells(1)[np.round(times / 5e-3).astype(int), 1].astype(float)
        matches = {tried[i] for i in np.flatnonzero(np.max(np.abs(table - seen), axis=1) < 1e-8)}
        found += len(matches) == 1
        right += matches == {(SEED, trial.number)}
    print(
        f"\n{len(tried) // 3} seeds and numbers tried in {seconds:.0f} s: {found} of {len(trials)} campaigns found again, "
        f"{right} of them rightly"
    )


def random(_: list[Campaign]) -> None:
    """Print whether a trial's random numbers depend on what is hidden."""
    drawn = []
    for effect in ("cubic_stiffness", "position_dependent_damping"):
        with patch.object(draw, "subject_of", lambda *_, e=effect: Subject("single", (e,), "clear", "low")):
            drawn.append(draw_trial("small", SEED, 0))
    alike = all(
        np.array_equal(a["u"], b["u"]) for a, b in zip(drawn[0].records, drawn[1].records, strict=True)
    )
    output = drawn[0].linear.rig.outputs[0].name
    quiet = [np.diff(one.records[3][output][:REST], 2) for one in drawn]
    print(
        f"\none trial with two different effects: inputs the same: {alike}, rigs the same: "
        f"{drawn[0].linear.values == drawn[1].linear.values}, correlation of the noise {np.corrcoef(*quiet)[0, 1]:.4f}"
    )


DRAWS = """
import os, pathlib, sys
from unittest.mock import patch
from rigsight.blind import draw, draw_trial
from rigsight.blind.subjects import Subject
cache = pathlib.Path(os.environ["RIGSIGHT_CACHE_DIR"])
for effect in ("cubic_stiffness", "position_dependent_damping"):
    with patch.object(draw, "subject_of", lambda *_: Subject("single", (effect,), "clear", "low")):
        draw_trial("small", 6, 0)
    print(effect, len([file for file in cache.rglob("*") if file.is_file()]))
"""


def cache(_: list[Campaign]) -> None:
    """Print whether drawing leaves anything of the hidden effect in the cache that diagnoses share."""
    with tempfile.TemporaryDirectory() as place:
        environment = {**os.environ, "RIGSIGHT_CACHE_DIR": place}
        ran = subprocess.run(
            [sys.executable, "-c", DRAWS], env=environment, check=True, capture_output=True, text=True
        )
    print(
        "\nfiles in the kernel cache after drawing one effect, then another:",
        ", ".join(ran.stdout.splitlines()),
    )


def process(trials: list[Campaign]) -> None:
    """Print whether the surroundings of a diagnosing process differ between trials, and what it could reach if it tried."""
    seen = []
    with tempfile.TemporaryDirectory() as name:
        bench = BenchFolder(Path(name))
        for kind in ("single", "pair", "outside", "none", "parameters"):
            trial = next(t for t in trials if t.key["kind"] == kind)
            shutil.copytree(trial.folder, bench.campaign(trial_name(trial.number)))
            diagnose_trial(bench, trial_name(trial.number), start=("-c", SPY))
            seen.append(json.loads((bench.result(trial_name(trial.number)) / "seen.json").read_text()))
    for what in ("environment", "arguments", "files", "modes", "order"):
        variants = {json.dumps(one[what], sort_keys=True) for one in seen}
        print(f"{what} of the process: {len(variants)} variant(s) in five trials")
    print("variables:", ", ".join(sorted(seen[0]["environment"])))
    print("a hostile process could read its parent's command line:", bool(seen[0]["parent"]))


PARTS = {
    "same": same,
    "tests": tests,
    "noise": noise,
    "rig": rig,
    "seed": seed,
    "random": random,
    "cache": cache,
    "process": process,
}


def main() -> None:
    wanted = sys.argv[1:] or list(PARTS)
    if not set(wanted) <= set(PARTS):
        sys.exit(f"Parts are {', '.join(PARTS)}; got {', '.join(wanted)}.")
    trials = campaigns()
    print(
        f"{len(trials)} trials: {dict(Counter(t.key['kind'] for t in trials))}, {dict(Counter(t.rig for t in trials))}"
    )
    for part in wanted:
        PARTS[part](trials)


if __name__ == "__main__":
    main()

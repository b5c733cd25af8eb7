"""Check that the contents of the campaigns do not reveal the hidden effect: format, sizes, digits, values, noise."""

from __future__ import annotations

import itertools
import math
import re
from collections import Counter
from typing import Any

import numpy as np
from campaigns import REST, Campaign
from numpy.typing import NDArray
from scipy.stats import chi2, norm
from sklearn.metrics import balanced_accuracy_score
from sklearn.model_selection import StratifiedKFold
from sklearn.tree import DecisionTreeClassifier

from rigsight.rigs import RUNNING_GEAR

Array = NDArray[np.float64]

NUMBER = rb"-?\d\.\d{9}e[+-]\d\d"
PERMUTATIONS = 500
PLANTED = 0.4


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
        score = split_distinguishable(x, y, parts)
        shuffled = [
            split_distinguishable(x, shuffled_within(rigs, y, rng), parts) for _ in range(PERMUTATIONS)
        ]
        low, high = np.quantile(shuffled, (0.025, 0.975))
        p = (1 + sum(one >= score for one in shuffled)) / (1 + PERMUTATIONS)
        print(f"| {group} | {name} | {score:.2f} | {low:.2f} to {high:.2f} | {p:.3f} |", flush=True)


def split_distinguishable(x: Array, y: Any, parts: list[Any]) -> float:
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

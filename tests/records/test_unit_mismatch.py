"""A record in another unit stands out by its gain; amplitude, band and a nonlinear rig do not."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from rigsight.effects import effect_named
from rigsight.excitation import log_sweep
from rigsight.records import Record
from rigsight.rigs import AXIS, RIGS
from rigsight.simulate import compose, simulate
from rigsight.workflow.campaign.record_notes import record_notes, unit_mismatch

DT = 4e-3
VALUES = {"gain": 1.0, "m": 1.0, "d": 1.5, "k": 400.0, "x_off": 0.0, "force_off": 0.0, "T_c": 0.6}


def sweep(name: str, amplitude: float, lowest: float, highest: float) -> Record:
    """Return a sweep of a stage with dry friction, which sticks through much of the smaller ones."""
    u = log_sweep(DT * np.arange(5000), amplitude, lowest, highest)
    bare = Record(name, DT, {"u": u}, {"u": "N"}, kind="sweep")
    moved = simulate(compose(AXIS, [effect_named("coulomb_friction")]), VALUES, bare)
    return moved.with_signals(x=moved["x"] + np.random.default_rng(1).normal(scale=1e-5, size=u.size))


def test_amplitude_and_band_are_no_unit() -> None:
    records = [
        sweep("slow", 1.0, 2.0, 15.0),
        sweep("resonance", 6.0, 10.0, 40.0),
        sweep("fast", 3.0, 30.0, 200.0),
    ]
    assert unit_mismatch(records, "u", "x") is None


@pytest.mark.parametrize("factor", [1000.0, 180.0 / np.pi, 1e-3])
def test_a_signal_in_another_unit_is_found(factor: float) -> None:
    records = [sweep("first", 3.0, 3.0, 90.0), sweep("second", 6.0, 3.0, 90.0)]
    records[1] = records[1].with_signals(x=factor * records[1]["x"])
    found = unit_mismatch(records, "u", "x")
    assert found is not None
    larger, smaller, ratio = found
    assert (larger.name, smaller.name) == (("second", "first") if factor > 1.0 else ("first", "second"))
    assert ratio == pytest.approx(max(factor, 1.0 / factor), rel=0.5)


def test_records_that_rest_or_lack_the_signal_are_passed_over() -> None:
    moved = sweep("first", 3.0, 3.0, 90.0)
    rest = moved.with_signals(u=np.zeros(moved.n_samples))
    without = Record("input", DT, {"u": moved["u"]}, {"u": "N"})
    assert unit_mismatch([moved, rest, without], "u", "x") is None


def test_the_gain_of_one_of_several_inputs_that_step_together_is_not_compared() -> None:
    arm = RIGS["two_link_arm"]
    sources, seen = [signal.name for signal in arm.inputs], [signal.name for signal in arm.outputs]
    rng = np.random.default_rng(0)
    shape = np.repeat(rng.choice([-1.0, 1.0], 100), 20)

    def moved(name: str, *sizes: float) -> Record:
        drives = {source: size * shape for source, size in zip(sources, sizes, strict=True)}
        answer = np.cumsum(sum(sizes) * shape) * DT
        return Record(name, DT, {**drives, **dict.fromkeys(seen, answer)}, {})

    def asked(records: Sequence[Record]) -> bool:
        return any("another unit" in note for note in record_notes("arm.toml", arm, records))

    assert not asked([moved("one", 1.0, 0.0), moved("both", 1.0, 99.0)])
    alone = moved("one", 1.0, 0.0)
    assert asked([alone, alone.with_signals(**{sources[0]: 100.0 * shape})])

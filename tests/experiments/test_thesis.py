"""The virtual rig still shows what the thesis published: its study runs, and the engine has not moved its numbers."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from rigsight.rigs.published import published_sets

STUDY = Path(__file__).parents[2] / "experiments/thesis"


@pytest.fixture
def fit_tables(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The study of the model behind the tables, as its own folder imports it."""
    monkeypatch.syspath_prepend(str(STUDY))
    import fit_tables

    yield fit_tables
    del sys.modules["fit_tables"]


def test_one_set_gives_the_published_responses_and_the_resonance_turns_upward(fit_tables: ModuleType) -> None:
    published = published_sets()["iwan_tables"]
    structure = fit_tables.structure_with(tuple(published.effects))
    values = published.values()
    sets = [values, {**values, "T_a": 1e-3}, {**values, "k_3": 0.0}]
    found = fit_tables.Sweeps(structure).evaluate(
        np.concatenate([fit_tables.vectors(structure, own) for own in sets], axis=1)
    )
    whole, without_lag, without_cubic = found.total
    assert whole == pytest.approx(1.12, abs=0.01)
    assert without_lag > 2.0 * whole
    assert without_cubic == pytest.approx(whole, abs=0.02)
    resonances = np.array([found.peaks[amplitude] for amplitude in sorted(found.peaks)])
    np.testing.assert_allclose(resonances[:, 0], [36.7, 22.8, 16.2, 11.3, 12.8, 15.2], atol=0.1)
    assert np.all(np.diff(resonances[:, 2]) < 0.0)

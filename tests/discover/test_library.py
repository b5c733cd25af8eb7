"""A column of the library is its term along the motion, in the units of the rig."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from rigsight.discover import RegressionData
from rigsight.discover.library import candidates
from rigsight.discover.motion import motion_of
from rigsight.discover.regression import Regressed
from rigsight.effects import effect_named
from rigsight.identify import characteristic_scales


@pytest.mark.parametrize(
    ("name", "term"),
    [
        ("gravity_pendulum", lambda x, _v: np.sin(x) - x),
        ("cubic_stiffness", lambda x, _v: x**3),
        ("quadratic_damping", lambda _x, v: v * np.abs(v)),
    ],
)
def test_a_column_is_the_term_along_the_motion(
    name: str,
    term: Callable[[np.ndarray, np.ndarray], np.ndarray],
    make_data: Callable[..., tuple[dict[str, float], RegressionData]],
) -> None:
    values, data = make_data("cubic", 2e-5, amplitudes=(0.6,), validation=False)
    motion = motion_of(data.rig, data.records[0], values, 2e-5)
    scales = characteristic_scales(data.rig, data.records, values)
    regressed = Regressed.of(data.rig, True, [motion], scales)
    (found,) = candidates([effect_named(name)], regressed)
    # A force that resists: it takes acceleration away.
    np.testing.assert_allclose(
        found.column, -regressed.rows.of(term(motion.x, motion.v), motion.dt), rtol=1e-6, atol=1e-15
    )

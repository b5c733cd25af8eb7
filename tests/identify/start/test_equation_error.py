from __future__ import annotations

import numpy as np

from rigsight.identify.start.linear_start import solve_in_frequency, spectra_of
from rigsight.records import Record


def test_a_term_that_is_zero_in_all_records_gets_no_coefficient_and_leaves_the_others() -> None:
    rng = np.random.default_rng(1)
    response = np.cumsum(np.cumsum(rng.normal(size=400))) * 1e-4
    record = Record(name="r", dt=0.01, signals={"u": rng.normal(size=400), "x": response}, units={})
    spectra = spectra_of(record, "u", "x")
    plain = [(2, spectra.response), (1, spectra.response)]
    target = 3.0 * (1j * spectra.omega) ** 2 * spectra.response + 2.0 * 1j * spectra.omega * spectra.response

    found = solve_in_frequency([spectra], [[*plain, (0, np.zeros_like(target))]], [target])

    # A stop that is never reached pushes nowhere: it must neither end the regression nor change what it finds.
    np.testing.assert_allclose(found, [3.0, 2.0, 0.0], rtol=1e-6, atol=1e-12)

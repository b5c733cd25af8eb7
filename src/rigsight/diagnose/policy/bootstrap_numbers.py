"""Number of bootstrap draws for standard errors."""

from __future__ import annotations

from dataclasses import dataclass

from rigsight.diagnose.policy.number import number


@dataclass(frozen=True)
class BootstrapNumbers:
    """Number of bootstrap draws for standard errors. Each field carries its reason."""

    replicates: int = number(
        60,
        "budget",
        "Draws of a bootstrap: the relative error of the standard errors is 1 / sqrt(2 n), 9 percent.",
    )
    fewest_replicates: int = number(
        24,
        "budget",
        "Draws for long records: the relative error of the standard errors is 14 percent.",
    )
    replicate_steps: int = number(
        3_500_000,
        "budget",
        (
            "Budget of integration steps for all draws, 2 to 3 s: slow models get fewer draws. A number of steps instead of a "
            "time, so that results do not depend on the computer."
        ),
    )
    most_replicate_steps: int = number(
        2_000_000,
        "budget",
        "Integration steps of one draw above which the covariance of the fit is used instead: a stiff model takes thousands per "
        "sample.",
    )

"""How many draws does a standard error rest on?"""

from __future__ import annotations

from dataclasses import dataclass

from rigsight.diagnose.policy.number import number


@dataclass(frozen=True)
class BootstrapNumbers:
    """How many draws does a standard error rest on? Each field carries its reason."""

    replicates: int = number(
        60,
        "budget",
        "Draws of a bootstrap: standard errors scatter by 1 / sqrt(2 n), 9 percent.",
    )
    fewest_replicates: int = number(
        24,
        "budget",
        "Draws along long records: standard errors scatter by 14 percent.",
    )
    replicate_steps: int = number(
        3_500_000,
        "budget",
        (
            "Steps of integration in which more draws than these are simulated: 2 to 3 s. A number of "
            "steps: draws depend on no clock."
        ),
    )
    most_replicate_steps: int = number(
        2_000_000,
        "budget",
        "Steps of one draw from which the formula has to do: a stiff model takes thousands in a sample.",
    )

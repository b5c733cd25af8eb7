"""How much does what a family explains say of it, where no law is exact?"""

from __future__ import annotations

from dataclasses import dataclass

from rigsight.diagnose.policy.number import number


@dataclass(frozen=True)
class FamilyNumbers:
    """How much does what a family explains say of it, where no law is exact? Each field carries its reason."""

    per_simulation: float = number(
        2.0,
        "assumption",
        (
            "Power of the share of the squared gap that a family leaves in a simulation: half the number of independent pieces "
            "of evidence that law errors leave in records."
        ),
    )
    per_motion: float = number(
        5.3,
        "measured",
        "The same for the share of the squared force that a family leaves along the measured motion; less where few independent "
        "rows leave much to chance.",
        set_by="experiments/missing_force: known causes in measured records. Optimistic: the same forces along the same motion "
        "made these trials",
    )
    other_causes: float = number(
        4.8,
        "measured",
        "Weight of a cause of no family of the catalogue, or of one that the motion does not judge; a family that explains "
        "nothing has the weight one.",
        set_by="the same trials",
    )
    failing: float = number(
        0.03,
        "measured",
        "Odds that the evidence itself fails, whatever it says: a fit ended elsewhere, or a form is unlike the true law at this "
        "place. They limit every probability.",
        set_by="experiments/missing_force: 99 known causes in measured records, the largest likelihood; 0.018 to 0.032 by seed",
    )
    least_rank: float = number(
        0.1,
        "assumption",
        "Share of the ranking that a family keeps at least: where no law is exact, held-out errors exclude none.",
        set_by="seen on two measured rigs only (a pendulum, an electronic oscillator), not validated",
    )
    probable: float = number(
        0.5,
        "convention",
        "Probability from which the motion names a family, or a model a further one: it is more probable than not.",
    )
    listed: float = number(
        0.01,
        "convention",
        "Smallest probability of a family that is listed although no named effect belongs to it.",
    )
    limits: tuple[float, float] = number(
        (0.025, 0.975),
        "convention",
        "Quantiles of the resamplings that bound a share: 95 % of them lie between.",
    )

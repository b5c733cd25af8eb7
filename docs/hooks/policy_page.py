"""What does the page of a diagnosis' numbers say? Everything on it comes from the policy."""

from __future__ import annotations

from rigsight.diagnose.policy import POLICY
from rigsight.diagnose.policy.number import Stated, stated

_SECTIONS = (
    ("What decides a verdict and its probability", POLICY.verdict),
    ("Notes about records and parameters", POLICY.notes),
    ("Length of the comparison", POLICY.horizon),
    ("The extent of the search", POLICY.search),
    ("The resolution of gap maps", POLICY.maps),
    ("Can the parameters be trusted?", POLICY.trust),
    ("Draws of the bootstrap", POLICY.bootstrap),
)


def policy_page() -> str:
    """Return the page that states every number of a diagnosis."""
    parts = [
        "# The thresholds of a diagnosis\n",
        "All thresholds of a diagnosis, each with its reason. They are fields of one frozen object, "
        "`rigsight.diagnose.policy.POLICY`, from which this page is generated; other constants in the code are numerical "
        "tolerances. [How the verdict is reached](verdict.md) says where each threshold is used.\n",
        "A *convention* is a line that has to be drawn somewhere. An **assumption** was suggested by a few rigs and may not hold "
        "for yours. *Measured* values were set by a study. A *budget* limits computation: it may lose a right model, but it "
        "does not favor a wrong one.\n",
    ]
    for title, group in _SECTIONS:
        numbers = stated(group)
        parts += [
            f"## {title}\n",
            f"{len(numbers)} thresholds.\n",
            "| threshold | value | kind | reason |",
            "|---|---|---|---|",
        ]
        parts += [_row(number) for number in numbers]
        parts.append("")
    return "\n".join(parts)


def _row(number: Stated) -> str:
    kind = f"**{number.kind}**" if number.kind == "assumption" else number.kind
    why = f"{number.reason} Set by: {number.set_by}." if number.set_by else number.reason
    return f"| `{number.name}` | {_told(number.value)} | {kind} | {why} |"


def _told(value: float | tuple[float, ...]) -> str:
    return ", ".join(f"{one:.3g}" for one in value) if isinstance(value, tuple) else f"{value:.4g}"

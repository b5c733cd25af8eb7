"""What does the page of a diagnosis' numbers say? Everything on it comes from the policy."""

from __future__ import annotations

from rigsight.diagnose.policy import POLICY
from rigsight.diagnose.policy.number import Stated, stated

_SECTIONS = (
    ("What decides a verdict and its probability", POLICY.verdict),
    ("What is told about records and numbers", POLICY.notes),
    ("Over which stretch a model is compared", POLICY.horizon),
    ("How far is searched", POLICY.search),
    ("How finely the gap is mapped", POLICY.maps),
    ("Can the numbers be trusted?", POLICY.trust),
    ("How many draws a standard error rests on", POLICY.bootstrap),
)


def policy_page() -> str:
    """Return the page that states every number of a diagnosis."""
    parts = [
        "# The numbers of a diagnosis\n",
        "Every number that decides, tells, searches or maps something, with its reason. All stand in one frozen object, "
        "`rigsight.diagnose.policy.POLICY`, from which this page is made; what stands elsewhere in the code is numerical "
        "tolerance. [How the verdict is reached](verdict.md) says where each is used.\n",
        "A *convention* is a line that somebody has to draw. An **assumption** is what a few rigs suggested, and what yours may "
        "break. *Measured* is what a study set. A *budget* bounds work: a right model may be lost by it, a wrong one does "
        "not gain.\n",
    ]
    for title, group in _SECTIONS:
        numbers = stated(group)
        parts += [
            f"## {title}\n",
            f"{len(numbers)} numbers.\n",
            "| number | value | kind | why |",
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

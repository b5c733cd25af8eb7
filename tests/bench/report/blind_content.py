"""The content of a `blind.json`, as pages, terminal and text get it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from rigsight_bench.scoring import Outcome, summary


def content_of(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Return the score of these trials."""
    benches = Counter((o.design, o.seed) for o in outcomes)
    return {
        "made": "2026-11-21T18:30:00+00:00",
        "command": "rigsight blind --design standard --seed 1",
        "versions": {"rigsight": "1.0", "numpy": "2.0"},
        "n_trials": len(outcomes),
        "benches": [{"design": d, "seed": s, "n_trials": n} for (d, s), n in benches.items()],
        **summary(outcomes),
        "wrong": [
            {
                **o.to_json(),
                "report": f"results/{o.trial}/report.html",
                "again": f"rigsight blind --trial {o.trial}",
            }
            for o in outcomes
            if not o.right
        ],
    }

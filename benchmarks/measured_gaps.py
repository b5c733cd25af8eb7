"""Verdict and time of a diagnosis of measured gaps with all effects: python benchmarks/measured_gaps.py CAMPAIGN...

The tests let only a few effects compete on measured records; this is the whole catalogue.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

from rigsight.workflow.diagnose import run_diagnose


def main(campaigns: list[str]) -> None:
    for campaign in campaigns:
        begun, processor = time.perf_counter(), time.process_time()
        diagnosis = run_diagnose(Path(campaign))
        took, worked = time.perf_counter() - begun, time.process_time() - processor
        print(
            f"{campaign}: {diagnosis.verdict} {' and '.join(diagnosis.effects)}, {took:.0f} s ({worked:.0f} s of processor time)"
        )
        for rivals in diagnosis.ambiguous_with:
            print(f"    not distinguished from {' and '.join(rivals)}")
        for candidate in diagnosis.candidates[:4]:
            name = " and ".join(candidate.effects) or "no effect"
            print(
                f"    {name}: {candidate.error_over_noise:.3g} x floor, probability {candidate.probability:.3g}"
            )


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(sys.argv[1:])

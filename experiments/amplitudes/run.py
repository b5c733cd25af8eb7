"""Validity of models fitted at one amplitude, at several amplitudes and with more noise; the whole study in one command.

run.py                    everything; finished stages are kept, so that it can be stopped and called again
run.py --only joint       these configs only
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path

from joblib import Parallel, delayed
from rich.console import Console
from rich.markdown import Markdown
from stages import calibrated_structure, discovery_exists, evaluation_stage, run_chain
from study import HERE, Config, Study, read_configs, read_study
from summary import summary_text

from rigsight.errors import RigsightError
from rigsight.rigs import RUNNING_GEAR
from rigsight.simulate import compose
from rigsight.workflow.demo import VirtualRig
from rigsight.workflow.run.kernels import checked_jobs, prepare_kernels

OUT = HERE.parents[1] / "out/amplitudes"


def run_study(study: Study, configs: Mapping[str, Config], out: Path, n_jobs: int | None = None) -> list[str]:
    """Run the missing stages, write `summary.md`, and return what was done."""
    jobs = checked_jobs(n_jobs)
    prepare_kernels([VirtualRig().structure, compose(RUNNING_GEAR), calibrated_structure(study)], jobs)
    told = ["evaluation: measured"] if evaluation_stage(study, out).ensure() else []
    # Processes: fits hold the interpreter between kernels. Long chains first, so that none is left over at the end.
    longest = sorted(configs.items(), key=lambda item: -len(item[1].estimation))
    parallel = Parallel(n_jobs=min(jobs, max(1, len(configs))), return_as="generator_unordered", batch_size=1)
    for lines in parallel(delayed(run_chain)(study, name, config, out) for name, config in longest):
        told += lines
        for line in lines:
            print(line, flush=True)
    (out / "summary.md").write_text(summary_text(out), encoding="utf-8")
    return told


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", metavar="CONFIG", default=[], help="names of files in configs/")
    parser.add_argument("--jobs", type=int, default=None, help="number of configs processed in parallel")
    parser.add_argument("--out", type=Path, default=OUT, help=f"default {OUT}")
    asked = parser.parse_args(arguments)
    try:
        study, configs = read_study(), read_configs()
        unknown = [name for name in asked.only if name not in configs]
        if unknown:
            raise SystemExit(f"Unknown: {', '.join(unknown)}. There are: {', '.join(configs)}.")
        if not discovery_exists():
            print("This version of rigsight has no command 'discover': its columns are left out.")
        chosen = {name: config for name, config in configs.items() if not asked.only or name in asked.only}
        run_study(study, chosen, asked.out, asked.jobs)
    except RigsightError as error:
        raise SystemExit(str(error)) from None
    Console(width=150).print(Markdown((asked.out / "summary.md").read_text(encoding="utf-8")))
    print(f"rigsight {version('rigsight')}; results in {asked.out}")


if __name__ == "__main__":
    main()

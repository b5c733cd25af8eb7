"""Fuzz one target in this process, guided by coverage: one_target.py NAME FOLDER [libFuzzer options]."""

from __future__ import annotations

import random
import resource
import sys
from importlib import import_module
from pathlib import Path

import atheris

# Where coverage is looked at; a package stands for all its modules.
_INSTRUMENTED = [
    "rigsight.records",
    "rigsight.parameters",
    "rigsight_bench.running.external",
    "rigsight.workflow.campaign",
    "rigsight.workflow.inspect",
    "rigsight.workflow.own.effect_declaration",
    "rigsight.workflow.own.own_effects",
    "rigsight.workflow.campaign.model_file",
]
if sys.argv[1] == "campaign.toml":
    _INSTRUMENTED.append("tomllib")

with atheris.instrument_imports(include=_INSTRUMENTED):
    import oracle
    import targets

    from rigsight.records.formats import channel_file
    from rigsight.records.formats.known import BY_SUFFIX, FORMATS, reader_of

    for _format in FORMATS:
        reader_of(_format.key)

# A library in C shows no coverage, and to instrument asammdf takes minutes.
_read = BY_SUFFIX.get(targets.TARGETS[sys.argv[1]].suffix)
if _read is not None and _read.package is not None and not _read.isolated:
    with atheris.instrument_imports(include=[_read.package]):
        import_module(_read.package)


def main(name: str, folder: Path, options: list[str]) -> None:
    """Fuzz until libFuzzer's options end it."""
    target = targets.TARGETS[name]
    corpus = folder / "corpus"
    if not corpus.is_dir():
        corpus.mkdir(parents=True)
        for i, seed in enumerate(target.start()):
            (corpus / f"seed{i}").write_bytes(seed)
    judge = oracle.Oracle.resumed(folder)
    if target.in_child:
        targets.read_in_this_process()
        # As the process that reads apart does, but for the processor time.
        judge.most_growth = channel_file.LEAST_MEMORY
        resource.setrlimit(resource.RLIMIT_DATA, (judge.most_growth, judge.most_growth))

    def try_it(data: bytes) -> None:
        judge.judge(data, target.try_it)

    def mutator(data: bytes, max_size: int, seed: int) -> bytes:
        assert target.mutate is not None
        changed = target.mutate(
            data, random.Random(seed), lambda part, size: atheris.Mutate(part, min(size, max_size))
        )
        return changed[:max_size]

    given = {"custom_mutator": mutator} if target.mutate is not None else {}
    atheris.Setup([sys.argv[0], *options, f"-artifact_prefix={folder}/", str(corpus)], try_it, **given)
    atheris.Fuzz()


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), sys.argv[3:])

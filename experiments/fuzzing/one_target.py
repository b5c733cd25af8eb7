"""Fuzz one target in this process, guided by coverage: one_target.py NAME FOLDER [libFuzzer options]."""

from __future__ import annotations

import random
import sys
from pathlib import Path

import atheris

# Where coverage is looked at. Libraries in C show none, and to instrument asammdf takes minutes.
_INSTRUMENTED = [
    "rigsight.records",
    "rigsight.parameters",
    *(
        f"rigsight.workflow.{name}"
        for name in (
            "campaign", "campaign_file", "json_file", "model_file", "blind_external", "own_effects", "effect_declaration",
            "inspect", "record_proposal", "signal_guesses",
        )
    ),
]  # fmt: skip
_LIBRARIES = {"TDMS": ["nptdms"], "UFF": ["pyuff"], "campaign.toml": ["tomllib"]}

with atheris.instrument_imports(include=[*_INSTRUMENTED, *_LIBRARIES.get(sys.argv[1], [])]):
    import oracle
    import targets

    from rigsight.records.formats import isolated_reader, reader_process

    for _reader in ("hdf5", "matlab", "matlab_hdf5", "mdf", "parquet", "tdms", "uff"):
        __import__(f"rigsight.records.read_{_reader}")
    for _library in _LIBRARIES.get(sys.argv[1], []):
        __import__(_library)


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
        # As the process that reads apart does.
        judge.most_growth = isolated_reader.LEAST_MEMORY
        reader_process.limit_memory(judge.most_growth)

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

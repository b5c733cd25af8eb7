"""The readers of external data, and how the fuzzer calls them."""

from __future__ import annotations

import json
import random
import struct
import tempfile
import tomllib
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import mutations
import seeds
from declarations import DECLARATIONS, effect_of

from rigsight.errors import InputError
from rigsight.records import ReadingOptions, read_record
from rigsight.records.formats import channel_file
from rigsight.records.formats.known import BY_SUFFIX, reader_of
from rigsight.rigs import RIGS
from rigsight.workflow.campaign.model_file import read_model
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.inspect import run_inspect
from rigsight.workflow.own import own_effects, own_rigs
from rigsight.workflow.run.results import json_text
from rigsight_bench.running.external import ExternalBench

Plain = Callable[[bytes, int], bytes]
"""libFuzzer's own mutation of bytes up to a size."""
Mutate = Callable[[bytes, random.Random, Plain], bytes]


@dataclass(frozen=True)
class Target:
    """Something that reads.

    Attributes
    ----------
    suffix
        Of the file that it reads.
    start
        Returns the seeds.
    try_it
        Reads one input; ends with a value or an `InputError`.
    mutate
        Changes an input where plain bytes would reach nothing; None for plain bytes.
    in_child
        True if the program reads this in a process of its own: a crash there is told, and no breach.
    """

    suffix: str
    start: Callable[[], list[bytes]]
    try_it: Callable[[bytes], object]
    mutate: Mutate | None = None
    in_child: bool = False


@cache
def _folder() -> Path:
    """A folder in memory, so that no disk is worn by thousands of files."""
    memory = Path("/dev/shm")
    return Path(tempfile.mkdtemp(prefix="fuzz-", dir=memory if memory.is_dir() else None))


def inspected(suffix: str) -> Callable[[bytes], object]:
    """Return what `rigsight inspect` does with the bytes of a file."""

    def try_it(data: bytes) -> object:
        path = _folder() / f"run{suffix}"
        path.write_bytes(data)
        return run_inspect(path)

    return try_it


def _measurement(suffix: str) -> Callable[[bytes], object]:
    rig = RIGS["running_gear"]
    unmapped = (None, {"t": 1, "u": 2, "psi": 3})

    def try_it(data: bytes) -> object:
        path = _folder() / f"run{suffix}"
        path.write_bytes(data)
        from rigsight.records import ColumnMapping

        found = run_inspect(path)
        json_text(found.to_json()).encode()
        tomllib.loads(found.proposal)
        for name in (*(one.name for one in found.channels), *(one.name for one in found.refused)):
            name.encode()
        told, failure = 0, InputError("")
        for columns in unmapped:
            mapped = None if columns is None else {s: ColumnMapping(n) for s, n in columns.items()}
            try:
                read_record(path, rig.inputs, rig.outputs, ReadingOptions(columns=mapped))
            except InputError as error:
                # What this raises in the end, the oracle looks at as well.
                failure = error
                told += 1
        if told == len(unmapped):
            raise failure
        return None

    return try_it


def read_in_this_process() -> None:
    """Let the libraries that the program keeps in a process of their own read here, where coverage is seen."""

    channel_file.open_isolated = lambda known, path: reader_of(known.key)(path)


def _samples(name: str) -> Callable[[], list[bytes]]:
    def start() -> list[bytes]:
        with tempfile.TemporaryDirectory() as folder:
            return [path.read_bytes() for path in seeds.write_samples(name, Path(folder))]

    return start


def _campaign(data: bytes) -> object:
    folder = _folder() / "campaign"
    if not folder.is_dir():
        folder.mkdir()
        (folder / "sweep.csv").write_text(seeds.comma_text(), encoding="utf-8")
    (folder / "campaign.toml").write_bytes(data)
    return read_campaign(folder)


def _model(data: bytes) -> object:
    path = _folder() / "model.json"
    path.write_bytes(data)
    return json_text(read_model(path).to_json()).encode()


def _key(data: bytes) -> object:
    folder = _folder() / "bench"
    campaign = folder / "campaigns" / "one"
    if not campaign.is_dir():
        campaign.mkdir(parents=True)
        (folder / "keys").mkdir()
        (campaign / "campaign.toml").write_text(seeds.CAMPAIGN, encoding="utf-8")
        (folder / "keys" / "step.csv").write_text(seeds.comma_text(), encoding="utf-8")
    (folder / "keys" / "one.json").write_bytes(data)
    return ExternalBench(folder, folder / "campaigns", folder / "keys").read_key("one")


def _effect_text(data: bytes) -> object:
    """Read a file of effects up to where it would be run: what the fuzzer wrote is never run."""
    own_rigs.exec = lambda *_: None  # type: ignore[attr-defined]
    path = _folder() / "mine.py"
    path.write_bytes(data)
    return own_effects.own_effects([path], check=False)


def _declaration(data: bytes) -> object:
    """Check an effect that a file might declare."""
    try:
        effect = effect_of(json.loads(data))
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError, IndexError, ArithmeticError):
        # No effect could be made: what a file raises while it runs is told with its line.
        raise InputError("no declaration") from None
    own_effects._loaded = lambda _: [own_effects.OwnEffect(effect, "mine.py, line 3")]
    found = own_effects.own_effects(["mine.py"], check=False)
    return [own_effects.equation_text(one).encode() for one in found]


def _tree(read: Callable[[bytes], Any], write: Callable[[Any], str], words: list[str]) -> Mutate:
    def mutate(data: bytes, rng: random.Random, plain: Plain) -> bytes:
        try:
            if rng.random() < 0.15:
                return plain(data, 20_000)
            return write(mutations.mutated(read(data), rng, words)).encode("utf-8", errors="surrogatepass")
        except (ValueError, RecursionError, TypeError):
            return plain(data, 20_000)

    return mutate


def _toml(data: bytes) -> Any:
    return tomllib.loads(data.decode())


_NUMBERS = [
    "",
    "nan",
    "inf",
    "-inf",
    "1e308",
    "-1e308",
    "1e-320",
    "1e999",
    "0",
    "1,5",
    "1.5",
    "x",
    '"',
    '"a\nb"',
    "0x1",
    "1_0",
    "٣",
]


def _mutate_text(data: bytes, rng: random.Random, plain: Plain) -> bytes:
    """Change cells and lines of a table half of the time."""
    if rng.random() < 0.5:
        return plain(data, 20_000)
    lines = data.split(b"\n")
    for _ in range(rng.randint(1, 5)):
        i = rng.randrange(len(lines))
        separator = rng.choice((b",", b";", b"\t", b" "))
        cells = lines[i].split(separator)
        manner = rng.randrange(6)
        if manner == 0:
            cells[rng.randrange(len(cells))] = rng.choice(_NUMBERS).encode()
            lines[i] = separator.join(cells)
        elif manner == 1:
            lines[i] = lines[rng.randrange(len(lines))]
        elif manner == 2:
            del lines[i]
            lines = lines or [b""]
        elif manner == 3:
            column, value = rng.randrange(len(cells)), rng.choice(_NUMBERS).encode()
            lines = [_with_cell(line, separator, column, value) for line in lines]
        elif manner == 4:
            lines = [line.replace(b",", rng.choice((b";", b"\t", b"|", b" "))) for line in lines]
        else:
            lines.insert(i, rng.choice((b"# t,u,psi,y", b"s,A,rad,m", b"", b"//", b'"')))
    return b"\n".join(lines)


def _with_cell(line: bytes, separator: bytes, column: int, value: bytes) -> bytes:
    cells = line.split(separator)
    if column < len(cells) and line[:1] not in b"t#%":
        cells[column] = value
    return separator.join(cells)


def _mutate_packed_matlab(data: bytes, rng: random.Random, plain: Plain) -> bytes:
    """Change what is inside compressed variables, and pack it again."""
    if rng.random() < 0.2 or len(data) < 136:
        return plain(data, 40_000)
    out, position = [data[:128]], 128
    while position + 8 <= len(data):
        kind, size = struct.unpack_from("<II", data, position)
        content = data[position + 8 : position + 8 + size]
        position += 8 + size
        if kind == 15:
            try:
                content = zlib.compress(plain(zlib.decompressobj().decompress(content, 200_000), 40_000), 1)
            except zlib.error:
                content = plain(content, 40_000)
        out.append(struct.pack("<II", kind, len(content)) + content)
    return b"".join(out)


_MUTATED_INSIDE = {"MATLAB 7": _mutate_packed_matlab}
"""Formats whose content is packed, so that plain bytes reach nothing."""


def _formats() -> dict[str, Target]:
    """Return delimited text and every format for which the tests have a writer."""
    text = Target(".dat", _samples("CSV"), _measurement(".dat"), _mutate_text)
    return {"CSV, TSV": text} | {
        name: Target(
            suffix,
            _samples(name),
            _measurement(suffix),
            _MUTATED_INSIDE.get(name),
            in_child=BY_SUFFIX[suffix].isolated,
        )
        for name, (suffix, _) in seeds.formats().FORMATS.items()
    }


_CAMPAIGN_WORDS = [
    "title", "rig", "records", "model", "effects", "constants", "parameters", "file", "name", "role", "kind", "amplitude", "hold",
    "dt", "resample", "columns", "separator", "decimal", "header", "comment", "scale", "offset", "unit", "axis", "element",
    "running_gear", "backlash", "gain", "m", "d", "k", "T_c", "delta_0", "c_y",
]  # fmt: skip
_MODEL_WORDS = [
    "schema_version", "rig", "hold", "constants", "parameters", "effects", "effect_parameters", "units", "axis", "element",
    "backlash", "input_delay", "T_d", "free_play", "flexible_mode", "iwan_hysteresis", "creep_saturation", "k_c", "J_z",
]  # fmt: skip
_KEY_WORDS = [
    "kind",
    "single",
    "pair",
    "none",
    "parameters",
    "outside",
    "effects",
    "where",
    "noise",
    "gap",
    "withheld",
    "backlash",
]
_EFFECT_WORDS = [
    "name", "place", "summary", "parameters", "energy", "torque", "spring", "drive", "delay", "lateral", "measured", "states",
    "symbol", "rate", "limit", "starts", "searched_as", "special_cases", "post_yield_stiffness_ratio", "pulsation",
    "x", "v", "t", "k", "m", "dynamics", "actuator", "sensor", "null", "default", "search", "dimension", "lower", "upper",
    "fitted", "Abs", "exp", "sign",
]  # fmt: skip

TARGETS: dict[str, Target] = {
    **_formats(),
    "campaign.toml": Target(
        ".toml",
        lambda: [text.encode() for text in (seeds.CAMPAIGN, seeds.AXIS_CAMPAIGN)],
        _campaign,
        _tree(_toml, mutations.toml_text, _CAMPAIGN_WORDS),
    ),
    "model.json": Target(
        ".json",
        lambda: [text.encode() for text in seeds.model_texts()],
        _model,
        _tree(json.loads, mutations.json_text, _MODEL_WORDS),
    ),
    "blind key": Target(
        ".json",
        lambda: [json.dumps(key).encode() for key in seeds.KEYS],
        _key,
        _tree(json.loads, mutations.json_text, _KEY_WORDS + _CAMPAIGN_WORDS),
    ),
    "effect file, text": Target(
        ".py",
        lambda: [b"from rigsight.effects import Effect\nX = Effect(name='x')\n", b"\xef\xbb\xbfa = 1\n"],
        _effect_text,
    ),
    "effect file, declaration": Target(
        ".json",
        lambda: [json.dumps(one).encode() for one in DECLARATIONS],
        _declaration,
        _tree(json.loads, mutations.json_text, _EFFECT_WORDS),
    ),
}
"""In the order of the table."""

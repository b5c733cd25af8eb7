"""What does a MATLAB file of version 5 to 7 declare, and is it safe to read?

scipy allocates what a file declares before it looks whether the data is there. The declarations are therefore walked through
first, without reading any numbers (MAT-File Format, MathWorks, R2023a, chapter 1).
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

from rigsight.errors import InputError
from rigsight.records.channel import MOST_SAMPLES, check_count
from rigsight.records.matlab_names import NUMERIC

_MATRIX, _COMPRESSED = 14, 15
_CLASSES = dict(enumerate(("cell", "struct", "object", "char", "sparse", *NUMERIC, "function", "opaque"), 1))
_COMPLEX, _LOGICAL = 0x0800, 0x0200
_HEADER = 128
_DEEPEST = 16
# A variable that needs more once unpacked holds more samples than are read.
_LARGEST_VARIABLE = 16 * MOST_SAMPLES


class DamagedError(ValueError):
    """A declaration that contradicts itself or the size of the file."""


@dataclass(frozen=True)
class Variable:
    """A declared variable, or a field of one.

    Attributes
    ----------
    name
        Its name.
    kind
        MATLAB class; ``"complex"`` and ``"logical"`` for numbers that are.
    shape
        Declared dimensions.
    fields
        Of a struct of one element, in order.
    """

    name: str
    kind: str
    shape: tuple[int, ...]
    fields: tuple[Variable, ...] = ()


def declared_variables(data: bytes, file: str) -> Iterator[Variable]:
    """Yield the variables that the contents of a MATLAB file declare.

    Raises
    ------
    DamagedError
        If the declarations contradict themselves or the file is cut short.
    InputError
        If a variable is larger than what is read.
    """
    order = "<" if data[126:128] == b"IM" else ">"
    position, count = _HEADER, 0
    while position < len(data):
        kind, start, end, position = _element(data, position, len(data), order)
        count += 1
        check_count(file, count)
        if kind == _COMPRESSED:
            # Compressed variables are not padded to whole words.
            position = end
            unpacker = zlib.decompressobj()
            inside = unpacker.decompress(data[start:end], _LARGEST_VARIABLE)
            if unpacker.unconsumed_tail:
                raise InputError(
                    f"{file}: a variable unpacks to more than {_LARGEST_VARIABLE / 1e6:g} MB, the most that is read. "
                    "Split the record, or reduce the sample rate."
                )
            kind, start, end, _ = _element(inside, 0, len(inside), order)
        else:
            inside = data
        if kind != _MATRIX:
            raise DamagedError(f"an element of type {kind} stands where a variable should")
        yield _matrix(inside, start, end, order, 0)


def _element(data: bytes, position: int, stop: int, order: str) -> tuple[int, int, int, int]:
    """Return type, start and end of an element's data, and where the next element begins."""
    if position + 8 > stop:
        raise DamagedError("an element is cut short")
    first, size = struct.unpack_from(order + "II", data, position)
    start = position + 8
    if first >> 16:
        first, size, start = first & 0xFFFF, first >> 16, position + 4
        following = position + 8
    else:
        following = start + size + (-size % 8)
    if (first >> 16 == 0 and start + size > stop) or (start == position + 4 and size > 4):
        raise DamagedError("an element reaches beyond its end")
    return first, start, start + size, min(following, stop)


def _matrix(data: bytes, position: int, stop: int, order: str, depth: int) -> Variable:
    if depth > _DEEPEST:
        raise DamagedError(f"variables are nested more than {_DEEPEST} deep")
    if position == stop:
        return Variable("", "double", (0, 0))
    _, start, end, position = _element(data, position, stop, order)
    if end - start < 4:
        raise DamagedError("a variable has no class")
    flags = struct.unpack_from(order + "I", data, start)[0]
    kind = _CLASSES.get(flags & 0xFF)
    if kind is None:
        raise DamagedError(f"a variable is of class {flags & 0xFF}, which is unknown")
    shape: tuple[int, ...] = (1, 1)
    if kind != "opaque":
        _, start, end, position = _element(data, position, stop, order)
        shape = struct.unpack_from(f"{order}{(end - start) // 4}i", data, start)
        if len(shape) < 2 or len(shape) > 32 or min(shape) < 0:
            raise DamagedError(f"a variable has the dimensions {shape}")
    _, start, end, position = _element(data, position, stop, order)
    name = data[start:end].decode("latin-1")
    size = math.prod(shape)
    if kind in ("struct", "object", "cell"):
        return _container(data, position, stop, order, depth, Variable(name, kind, shape), size)
    if size > MOST_SAMPLES and kind not in ("opaque", "sparse"):
        raise InputError(
            f"variable '{name}' holds {size} numbers, more than the {MOST_SAMPLES} that are read. "
            "Split the record, or reduce the sample rate."
        )
    if kind not in ("opaque", "function", "char"):
        kind = "complex" if flags & _COMPLEX else "logical" if flags & _LOGICAL else kind
    return Variable(name, kind, shape)


def _container(
    data: bytes, position: int, stop: int, order: str, depth: int, declared: Variable, size: int
) -> Variable:
    """Walk through the contents of a cell array or structs, of which each takes at least an element's head."""
    names = [""]
    if declared.kind != "cell":
        if declared.kind == "object":
            *_, position = _element(data, position, stop, order)
        _, start, end, position = _element(data, position, stop, order)
        length = struct.unpack_from(order + "i", data, start)[0] if end - start >= 4 else 0
        _, start, end, position = _element(data, position, stop, order)
        if length <= 0 or (end - start) % length:
            raise DamagedError("a struct has no field names")
        packed = [data[i : i + length] for i in range(start, end, length)]
        names = [text.split(b"\0")[0].decode("latin-1") for text in packed]
    if size * len(names) * 8 > stop - position:
        raise DamagedError(f"'{declared.name}' has {size} elements, more than there is data")
    fields = []
    for i in range(size * len(names)):
        kind, start, end, position = _element(data, position, stop, order)
        if kind != _MATRIX:
            raise DamagedError("a field is no variable")
        inside = _matrix(data, start, end, order, depth + 1)
        fields.append(Variable(names[i % len(names)], inside.kind, inside.shape, inside.fields))
    return Variable(
        declared.name, declared.kind, declared.shape, tuple(fields) if declared.kind == "struct" else ()
    )

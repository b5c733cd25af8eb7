"""What does a MATLAB file of version 5 to 7 declare, and is it safe to read?

scipy allocates what a file declares before it checks whether the data is present, and crashes on invalid types. The declarations
are therefore checked first, without reading any numbers (MAT-File Format, MathWorks, R2023a, chapter 1).
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

from rigsight.errors import InputError
from rigsight.records.formats.channel import MOST_SAMPLES, check_count
from rigsight.records.formats.matlab_names import DEEPEST, NUMERIC

_INT8, _INT32, _UINT32, _MATRIX, _COMPRESSED = 1, 5, 6, 14, 15
_BYTES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8}
"""Type of element -> bytes of a number."""
_TEXT = (1, 2, 4, 16, 17, 18)
_CLASSES = dict(enumerate(("cell", "struct", "object", "char", "sparse", *NUMERIC, "function", "opaque"), 1))
_COMPLEX, _LOGICAL = 0x0800, 0x0200
HEADER = 128
# A variable that needs more once unpacked holds more samples than are read.
_LARGEST_VARIABLE = 16 * MOST_SAMPLES
# As many bytes as the largest file may have that is not packed.
_MOST_UNPACKED = 2_000_000_000


class DamagedError(ValueError):
    """A declaration that contradicts itself or the size of the file."""


@dataclass(frozen=True)
class Variable:
    """A declared variable, or a field of one."""

    name: str
    kind: str  # MATLAB class; ``"complex"`` and ``"logical"`` for numbers that are
    shape: tuple[int, ...]  # declared dimensions
    # Of a struct, in order; of an array of structs those of all elements, one after the other, in the order
    # of columns.
    fields: tuple[Variable, ...] = ()


def declared_variables(data: bytes, file: str) -> Iterator[Variable]:
    """Yield the variables that the contents of a MATLAB file declare."""
    order = _order(data)
    position, count, unpacked = HEADER, 0, 0
    while position < len(data):
        kind, start, end, position = _element(data, position, len(data), order)
        count += 1
        check_count(file, count)
        if kind == _COMPRESSED:
            # Compressed variables are not padded to whole words.
            position = end
            inside = _unpacked(memoryview(data)[start:end], order, file)
            unpacked += len(inside)
            if unpacked > _MOST_UNPACKED:
                raise InputError(
                    f"{file}: its variables unpack to more than {_MOST_UNPACKED / 1e6:g} MB together, the most that is read. "
                    "Split the record, or save only the variables that are needed."
                )
            kind, start, end, _ = _element(inside, 0, len(inside), order)
        else:
            inside = data
        if kind != _MATRIX:
            raise DamagedError(f"an element of type {kind} was found where a variable was expected")
        yield _matrix(inside, start, end, order, 0)


def begins_with_variable(head: bytes) -> bool:
    """Return whether the first element, of which the head of a file holds type and size, is a variable."""
    return struct.unpack_from(_order(head) + "I", head, HEADER)[0] in (_MATRIX, _COMPRESSED)


def _order(data: bytes) -> str:
    return "<" if data[126:128] == b"IM" else ">"


def _unpacked(packed: memoryview, order: str, file: str) -> bytes:
    """Return the one element inside a compressed one; no more is unpacked than it declares."""
    unpacker = zlib.decompressobj()
    head = unpacker.decompress(packed, 8)
    if len(head) < 8:
        raise DamagedError("a compressed variable is truncated")
    first, size = struct.unpack(order + "II", head)
    size = 0 if first >> 16 else size
    if size > _LARGEST_VARIABLE:
        raise InputError(
            f"{file}: a variable unpacks to more than {_LARGEST_VARIABLE / 1e6:g} MB, the most that is read. "
            "Split the record, or reduce the sample rate."
        )
    # A few bytes to spare, which tell whether there is more; a limit of 0 would mean none.
    inside = head + unpacker.decompress(unpacker.unconsumed_tail, size + 8)
    if len(inside) > 8 + size + 7:
        raise DamagedError("a compressed variable contains more data than it declares")
    return inside


def _element(data: bytes, position: int, stop: int, order: str) -> tuple[int, int, int, int]:
    """Return type, start and end of an element's data, and where the next element begins."""
    if position + 8 > stop:
        raise DamagedError("an element is truncated")
    first, size = struct.unpack_from(order + "II", data, position)
    start = position + 8
    if first >> 16:
        first, size, start = first & 0xFFFF, first >> 16, position + 4
        following = position + 8
    else:
        following = start + size + (-size % 8)
    if (first >> 16 == 0 and start + size > stop) or (start == position + 4 and size > 4):
        raise DamagedError("an element extends beyond the end of its container")
    return first, start, start + size, min(following, stop)


def _part(data: bytes, position: int, stop: int, order: str, allowed: int) -> tuple[int, int, int]:
    """Return start and end of an element of a known type, and where the next begins."""
    kind, start, end, following = _element(data, position, stop, order)
    if kind != allowed:
        raise DamagedError(f"an element is of type {kind} instead of {allowed}")
    return start, end, following


def _matrix(data: bytes, position: int, stop: int, order: str, depth: int) -> Variable:
    if depth > DEEPEST:
        raise DamagedError(f"variables are nested more than {DEEPEST} deep")
    if position == stop:
        return Variable("", "double", (0, 0))
    start, end, position = _part(data, position, stop, order, _UINT32)
    if end - start != 8:
        raise DamagedError("a variable has no class")
    flags = struct.unpack_from(order + "I", data, start)[0]
    kind = _CLASSES.get(flags & 0xFF)
    if kind is None:
        raise DamagedError(f"a variable is of class {flags & 0xFF}, which is unknown")
    shape: tuple[int, ...] = (1, 1)
    if kind != "opaque":
        start, end, position = _part(data, position, stop, order, _INT32)
        shape = struct.unpack_from(f"{order}{(end - start) // 4}i", data, start)
        if len(shape) < 2 or len(shape) > 32 or min(shape) < 0:
            raise DamagedError(f"a variable has the dimensions {shape}")
    start, end, position = _part(data, position, stop, order, _INT8)
    name = data[start:end].decode("latin-1")
    size = math.prod(shape)
    if kind in ("struct", "object", "cell"):
        return _container(data, position, stop, order, depth, Variable(name, kind, shape), size)
    if size > MOST_SAMPLES and kind not in ("opaque", "sparse"):
        raise InputError(
            f"variable '{name}' holds {size} numbers, more than the {MOST_SAMPLES} that are read. "
            "Split the record, or reduce the sample rate."
        )
    if kind in ("opaque", "function"):
        _check_object(data, position, stop, order, depth)
        return Variable(name, kind, shape)
    is_complex = bool(flags & _COMPLEX)
    _check_data(data, position, stop, order, kind, is_complex, None if kind in ("char", "sparse") else size)
    if kind != "char":
        kind = "complex" if is_complex else "logical" if flags & _LOGICAL else kind
    return Variable(name, kind, shape)


def _check_data(
    data: bytes, position: int, stop: int, order: str, kind: str, is_complex: bool, size: int | None
) -> None:
    """Check the elements that hold the numbers of a variable: real, perhaps imaginary, of a sparse one the indices.

    For one that is missing scipy would take what stands behind the variable.
    """
    missing = (3 if kind == "sparse" else 1) + (is_complex and kind != "char")
    while position < stop:
        missing -= 1
        stored, start, end, position = _element(data, position, stop, order)
        if stored not in (_TEXT if kind == "char" else _BYTES):
            raise DamagedError(f"data has the invalid type {stored}")
        if size is not None and end - start != size * _BYTES[stored]:
            raise DamagedError(f"{size} numbers are declared, but {end - start} bytes are present")
    if missing:
        raise DamagedError(f"a variable of class {kind} lacks parts that it declares")


def _check_object(data: bytes, position: int, stop: int, order: str, depth: int) -> None:
    while position < stop:
        stored, start, end, position = _element(data, position, stop, order)
        if stored == _MATRIX:
            _matrix(data, start, end, order, depth + 1)
        elif stored != _INT8:
            raise DamagedError(f"an object holds an element of type {stored}")


def _container(
    data: bytes, position: int, stop: int, order: str, depth: int, declared: Variable, size: int
) -> Variable:
    """Walk through the contents of a cell array or structs, of which each takes at least an element's head."""
    names = [""]
    if declared.kind != "cell":
        if declared.kind == "object":
            *_, position = _part(data, position, stop, order, _INT8)
        start, end, position = _part(data, position, stop, order, _INT32)
        length = struct.unpack_from(order + "i", data, start)[0] if end - start == 4 else 0
        start, end, position = _part(data, position, stop, order, _INT8)
        if length <= 0 or (end - start) % length:
            raise DamagedError("a struct has no field names")
        packed = [data[i : i + length] for i in range(start, end, length)]
        names = [text.split(b"\0")[0].decode("latin-1") for text in packed]
    if size * max(len(names), 1) * 8 > max(stop - position, 8):
        raise DamagedError(f"'{declared.name}' has {size} elements, more than there is data")
    fields = []
    for i in range(size * len(names)):
        start, end, position = _part(data, position, stop, order, _MATRIX)
        inside = _matrix(data, start, end, order, depth + 1)
        fields.append(Variable(names[i % len(names)], inside.kind, inside.shape, inside.fields))
    contents = tuple(fields) if declared.kind == "struct" else ()
    return Variable(declared.name, declared.kind, declared.shape, contents)

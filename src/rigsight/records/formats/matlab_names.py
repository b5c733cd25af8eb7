"""What are MATLAB's classes called, and which of them are signals?"""

from __future__ import annotations

NUMERIC = (
    "double",
    "single",
    "int8",
    "uint8",
    "int16",
    "uint16",
    "int32",
    "uint32",
    "int64",
    "uint64",
)
DEEPEST = 16
"""Structs in structs that are looked into."""
DEEPER = f"lies more than {DEEPEST} structs deep. Save its fields as variables of their own"
_REASONS = {
    "char": "is text",
    "logical": "is of type logical",
    "cell": "is a cell array, or an array of structs saved with -v7.3; save its contents as variables of their own",
    "struct": "is a struct without fields",
    "sparse": "is a sparse matrix",
    "complex": "holds complex numbers",
    "function": "is a function, which is not read",
    "object": "is an object, which is not read; save its values as plain arrays",
    "opaque": "is a table, timetable, timeseries or another object, which only MATLAB reads; "
    "save its columns as plain arrays",
}


def why_no_signal(kind: str) -> str:
    """Return why a variable of a MATLAB class is no signal; classes of MATLAB's own libraries are objects."""
    return _REASONS.get(kind, _REASONS["opaque"])

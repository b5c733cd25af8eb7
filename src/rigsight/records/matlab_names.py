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
DEEPER = (
    "is a struct in a struct; only structs one level deep are read. Save its fields as variables of their own"
)
_REASONS = {
    "char": "is text",
    "logical": "is of type logical",
    "cell": "is a cell array; save its contents as variables of their own",
    "struct": "is an array of structs; save each as a variable of its own",
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

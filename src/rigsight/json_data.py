"""How does a result become data for JSON?"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic_core import to_jsonable_python


def json_data(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return content as plain data: data classes as objects of their fields, arrays as lists, NaN and infinity as None."""
    found: dict[str, Any] = to_jsonable_python(content, inf_nan_mode="null", fallback=_plain)
    return found


def _plain(value: Any) -> Any:
    """Return what pydantic does not know: a mapping that is no dictionary, an array or a number of numpy."""
    return dict(value) if isinstance(value, Mapping) else value.tolist()

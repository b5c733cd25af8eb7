"""How does a stored number become the quantity that it stands for, where the file says so beside it?"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

# CF conventions 1.11, chapter 8.1, and the NetCDF attribute conventions; NWB says conversion and offset for the same.
_CONVENTIONS = (("scale_factor", "add_offset"), ("conversion", "offset"))
_MISSING = ("_FillValue", "missing_value")
_MAY_CONVERT = re.compile(
    r"(?<![a-z])(scale|scaling|gain|factor|slope|sensitivity|calibration|offset|intercept|conversion|lsb)(?![a-z])",
    re.IGNORECASE,
)
"""Words of attributes that look like a conversion; in no convention, so that nobody knows in which direction it goes."""


@dataclass(frozen=True)
class Stored:
    """What a file says of the numbers of a channel: ``quantity = scale * stored + offset``."""

    # From the stored number to the quantity, in the unit that the file states.
    scale: float = 1.0
    offset: float = 0.0
    missing: tuple[float, ...] = ()  # stored numbers that stand for no reading
    # Smallest and largest valid stored number.
    least: float = -math.inf
    most: float = math.inf
    unsigned: bool = False  # true if the numbers are unsigned, although their type says otherwise
    # Attributes that may be a conversion, as ``name = value``, but of no known convention.
    unclear: tuple[str, ...] = ()

    def quantity(self, stored: NDArray[Any]) -> NDArray[Any]:
        """Return the quantity, shape (n_samples,), NaN where the file says that a reading is missing or invalid."""
        if self == Stored(unclear=self.unclear):
            return stored
        if self.unsigned and stored.dtype.kind == "i":
            stored = stored.view(f"u{stored.dtype.itemsize}")
        # In single precision -9999.9 is the number next to it.
        alike = stored.dtype if stored.dtype.kind == "f" else np.dtype(np.float64)
        invalid = (
            np.isin(stored.astype(alike), np.array(self.missing).astype(alike))
            | (stored < self.least)
            | (stored > self.most)
        )
        return np.where(invalid, np.nan, self.scale * stored.astype(np.float64) + self.offset)

    @property
    def note(self) -> str:
        """What was done to the numbers, empty where nothing was."""
        converted = (self.scale, self.offset) != (1.0, 0.0)
        return (
            f"{self.scale:.9g} * stored number + {self.offset:.9g}, as the file states" if converted else ""
        )


AS_STORED = Stored()
"""Numbers that are the quantity."""


def stored_by(attributes: Mapping[str, Any]) -> Stored:
    """Return what the attributes of a dataset, a channel or a column say of its numbers."""
    numbers = {name: own for name, value in attributes.items() if (own := _numbers(value))}
    scale, offset = 1.0, 0.0
    known: set[str] = set()
    for scaled, added in _CONVENTIONS:
        # An offset of no convention may be added before or after scaling.
        if scaled in numbers or (added in numbers and added == "add_offset"):
            scale, offset = numbers.get(scaled, (1.0,))[0], numbers.get(added, (0.0,))[0]
            known = {scaled, added}
            break
    valid = numbers.get("valid_range", ())
    least, most = valid if len(valid) == 2 else (-math.inf, math.inf)
    unclear = [
        f"{name} = {own[0]:g}"
        for name, own in numbers.items()
        if name not in known
        and len(own) == 1
        and _MAY_CONVERT.search(name.replace("_", " "))
        and own[0] not in (0.0, 1.0)
    ]
    return Stored(
        scale,
        offset,
        tuple(value for name in _MISSING for value in numbers.get(name, ()) if not math.isnan(value)),
        numbers.get("valid_min", (least,))[0],
        numbers.get("valid_max", (most,))[0],
        str(_text(attributes.get("_Unsigned", ""))).lower() == "true",
        tuple(unclear),
    )


def _text(value: Any) -> Any:
    return value.decode("utf-8", errors="replace") if isinstance(value, bytes) else value


def _numbers(value: Any) -> tuple[float, ...]:
    """Return the few numbers of an attribute, also where they are written as text; none of anything else."""
    value = _text(value)
    if isinstance(value, str):
        try:
            return (float(value),)
        except ValueError:
            return ()
    array = np.asarray(value)
    # An attribute of type empty has no shape.
    if array.dtype.kind not in "iuf" or not 0 < array.size <= 16:
        return ()
    return tuple(float(number) for number in array.reshape(-1))

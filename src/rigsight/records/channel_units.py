"""Conversion of units as written in measured files to SI."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

from rigsight.errors import InputError
from rigsight.records.channel_names import split_unit
from rigsight.records.column_mapping import ColumnMapping, Columns
from rigsight.units import INPUT_UNIT

DRIVES = ("A", "V", "N", "N m")
"""What amplifiers are told, and what motors give."""
_SI = frozenset({"", INPUT_UNIT, "m", "rad", "m/s", "rad/s", "kg", "s", "A", "V", "N", "N m", "K"})
"""Units of which no two measure the same: pint, which takes half a second to load, need not be asked about a pair of them."""
# Only products of units with small powers reach pint: its parser would work out 9**9**9 for as long as that takes.
_UNIT = r"[A-Za-zµμΩ°%]+(?:(?:\^|\*\*)?-?[1-4])?"
_PRODUCT = re.compile(rf"{_UNIT}(?:\s*[*/·.⋅ ]\s*{_UNIT}){{0,5}}")
_LONGEST = 40
_ROUNDING = 1e-9
"""Relative error up to which a conversion counts as linear."""
_POWERS = str.maketrans({"²": "^2", "³": "^3", "⁻": "-", "¹": "1", "μ": "µ", "⋅": "*", "·": "*"})
# As loggers write them; pint would not know these, or take Nm for something else.
_USUAL = {
    "Nm": "N*m",
    "mNm": "mN*m",
    "kNm": "kN*m",
    "Newton": "newton",
    "KN": "kN",
    "MM": "mm",
    **dict.fromkeys(("Deg", "DEG", "degrees"), "deg"),
    **dict.fromkeys(("Rad", "RAD"), "rad"),
    **dict.fromkeys(("Amp", "amp"), "A"),
    **dict.fromkeys(("Sec", "SEC", "seconds"), "s"),
}
# German for degree, to pint a gigaradian and a gon.
_MISLEADING = {"Grad": "deg", "grad": "deg, or gon"}


class UnknownUnitError(ValueError):
    """A unit that is unknown or does not fit the quantity; the text says which."""


def factor(unit: str, si: str) -> float:
    """Return the factor from `unit` to `si`; angles are not treated as dimensionless."""
    return conversion(unit, si)[0]


def conversion(unit: str, si: str) -> tuple[float, float]:
    """Return scale and offset from `unit` to `si`; only units of temperature have an offset."""
    unit = unit.strip()
    return (1.0, 0.0) if unit == si else _conversion(unit, si)


@cache
def _conversion(unit: str, si: str) -> tuple[float, float]:
    if unit != si and {unit, si} <= _SI:
        raise UnknownUnitError(f"does not measure the same as {si}")
    from pint.errors import PintError

    if unit in _MISLEADING:
        raise UnknownUnitError(f"means different things; write {_MISLEADING[unit]}")
    text = _USUAL.get(unit, unit).translate(_POWERS)
    if len(text) > _LONGEST or not _PRODUCT.fullmatch(text):
        raise UnknownUnitError("is no unit")
    registry = _registry()
    try:
        parsed = registry.parse_units(text)
        # Root units, not dimensions: pint counts angles, shares and plain numbers as one dimension.
        size, base = registry.get_root_units(parsed)
        target_size, target = registry.get_root_units(registry.parse_units(_USUAL.get(si, si)))
        none, one = (
            float(registry.Quantity(number, parsed).to_root_units().magnitude) for number in (0.0, 1.0)
        )
    except (PintError, ValueError, TypeError, AttributeError, AssertionError, OverflowError):
        raise UnknownUnitError("is no known unit") from None
    if base != target:
        raise UnknownUnitError(f"does not measure the same as {si}")
    ratio = float(size / target_size)
    if ratio <= 0.0:
        raise UnknownUnitError("is no known unit")
    if unit != si and abs(one - none - float(size)) > _ROUNDING * max(abs(none), abs(one)):
        raise UnknownUnitError("is logarithmic")
    return ratio, none / float(target_size)


@cache
def _registry() -> Any:
    from pint import UnitRegistry

    return UnitRegistry(cache_folder=None)


def has_si(unit: str) -> bool:
    """Return True if a rig's signal has a fixed unit; some accept their input in any unit."""
    return unit != INPUT_UNIT


def in_drive_unit(unit: str) -> tuple[float, str] | None:
    """Return the factor from a unit of a drive to its SI unit, and that unit; None if it is not a unit of a drive."""
    for si in DRIVES:
        with contextlib.suppress(UnknownUnitError):
            return factor(unit, si), si
    return None


def is_a(unit: str, si: str) -> bool:
    """Return True if a unit stated in a file has the same dimension as `si`."""
    return unit.strip() == si or is_unit(unit.strip(), si)


def is_unit(text: str, si: str | None = None) -> bool:
    """Return True if a text is a unit of any quantity, or of that of `si`."""
    try:
        _conversion(text, text if si is None else si)
    except UnknownUnitError:
        return False
    return True


def units_of_columns(
    file: str,
    units: Mapping[str, str],
    others: Sequence[Mapping[str, str]],
    table: Columns,
    mappings: Mapping[str, ColumnMapping],
) -> tuple[dict[str, str], list[str]]:
    """Return the units of all signals, of several sets the one that the columns state, and notes on columns that state none."""
    sets = [dict(units), *({**units, **other} for other in others)]
    differing = [name for name in table.labels if len({one[name] for one in sets}) > 1]
    open_ones = [name for name in differing if mappings[name].scale is None]
    said, is_stated = {}, set()
    for name in open_ones:
        label = table.labels[name]
        named = split_unit(label)[1]
        stated = mappings[name].unit or table.units.get(name)
        unit = stated or named
        if unit is not None and any(is_a(unit, one[name]) for one in sets):
            said[name] = unit
            # What only the last word of a name suggests chooses between sets, and contradicts nothing.
            if stated or label.rstrip().endswith(tuple("])>")):
                is_stated.add(name)

    def unfit(one: Mapping[str, str]) -> set[str]:
        return {name for name, unit in said.items() if not is_a(unit, one[name])}

    best = next((one for one in sets if not unfit(one)), None) or min(sets, key=lambda one: len(unfit(one)))
    if unfit(best) & is_stated:
        got = ", ".join(f"{name} in {unit}" for name, unit in said.items())
        allowed = "; or ".join(", ".join(f"{name} in {one[name]}" for name in open_ones) for one in sets)
        raise InputError(
            f"{file}: the units of its columns do not go together: {got}. Allowed, in any size such as mm: {allowed}. Correct "
            "them under columns with unit, or write scale = 1.0 for a column to take its values without conversion."
        )
    because = ", ".join(f"{name} is in {unit}" for name, unit in said.items())
    notes = [
        f"{file}, column '{table.labels[name]}': taken in {best[name]}, because {because}."
        for name in open_ones
        if best is not sets[0] and name not in said
    ]
    return best, notes


def si_mapping(
    file: str, signal: str, si: str, mapping: ColumnMapping, label: str, stated: str | None, gain: str = ""
) -> tuple[ColumnMapping, tuple[str, ...]]:
    """Return a mapping with the scale from a column to SI, and notes on the conversion."""
    where = f"{file}, column '{label}'"
    if mapping.scale is not None:
        return mapping, ()
    named = split_unit(label)[1]
    drive = None if named is None else in_drive_unit(named)
    taken = si if has_si(si) else drive and drive[1]
    by_whom = "stated in the file"
    # Brackets are written around a unit; behind a blank or a stroke it may be something else.
    if stated is None and named and taken and label.rstrip().endswith(tuple("])>")) and is_a(named, taken):
        stated, by_whom = named, "in its name"
    unit = mapping.unit if mapping.unit is not None else stated
    if unit is None:
        if named is None or taken is None or named == taken or not is_a(named, taken):
            return mapping, ()
        if mapping.offset is None:
            own = f'{signal} = {{ name = "{label}", unit = "{named}" }}'
            remedy = f"{own} (on a command line --unit {signal}={named}); if not, scale = 1.0"
        else:
            remedy = f"scale = {factor(named, taken):.9g} beside the offset; if not, scale = 1.0"
        return mapping, (
            f"{where}: values taken as {taken} without conversion, although the name ends with {named}. If it is in {named}, "
            f"write {remedy}.",
        )
    if not has_si(si):
        if mapping.unit is not None:
            found = in_drive_unit(mapping.unit)
            if found is None:
                raise InputError(
                    f'{where}: unit = "{unit}" cannot be converted: {signal} has no fixed unit on this rig, and this is '
                    f"not a unit of a drive ({', '.join(DRIVES)}). Give scale and offset instead."
                )
            return replace(mapping, unit=None, scale=found[0]), ()
        drive = in_drive_unit(unit)
        if drive is None or drive[0] == 1.0:
            return mapping, (
                f"{where}: {signal} has no fixed unit on this rig; values were taken without conversion, in {unit}.",
            )
        if gain:
            own = f'{signal} = {{ name = "{label}", unit = "{unit}" }}'
            raise InputError(
                f"{where}: is in {unit}, {by_whom}, and {gain} is given, which counts per unit of {signal}. If {gain} counts per "
                f"{drive[1]}, write {own}; if it counts per {unit}, write scale = 1.0 instead of the unit."
            )
        return replace(mapping, scale=drive[0]), (
            f"{where}: converted from {unit}, the unit {by_whom}, to {drive[1]}; gains of the rig refer to that. To take the "
            "values without conversion write scale = 1.0.",
        )
    try:
        scale, offset = conversion(unit, si)
    except UnknownUnitError as error:
        by = "" if mapping.unit is not None else f", {by_whom},"
        # An offset cannot stand beside a unit.
        named_right = f'{signal} = {{ name = "{label}", unit = "..." }} with the right unit, or '
        right = named_right if mapping.offset is None else ""
        raise InputError(
            f"{where}: the unit '{unit}'{by} {error}; {signal} is in {si}. Write {right}scale = 1.0 to take the values without "
            "conversion."
        ) from None
    converted = replace(mapping, unit=None, scale=scale, offset=offset + (mapping.offset or 0.0))
    absolute = ""
    if offset:
        absolute = (
            f" {offset:.6g} {si} was added, as for an absolute temperature; if it is a difference of temperatures, write "
            f"scale = {scale:.6g} instead of a unit."
        )
    if mapping.unit is not None:
        said = named if stated is None else stated
        if said is None or not is_a(said, si) or conversion(said, si) == (scale, offset):
            return converted, (f"{where}: taken in {unit}.{absolute}",) if absolute else ()
        by_file = stated is not None and by_whom == "stated in the file"
        by = "the file states" if by_file else "its name ends with"
        return converted, (
            f"{where}: taken in {unit}, as stated in the campaign, although {by} {said}.{absolute}",
        )
    if (scale, offset) == (1.0, 0.0):
        return converted, ()
    added = "" if mapping.offset is None else f"; the offset {mapping.offset:g} {si} was added"
    return converted, (f"{where}: converted from {unit}, the unit {by_whom}, to {si}{added}.{absolute}",)

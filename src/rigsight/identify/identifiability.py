"""Which parameters do the records determine, and which only in combination with others?

Null directions of the information matrix are parameters that compensate each other. A combination is named if a finite step along
it does not change the outputs, because derivatives at one point cannot distinguish a ratio from a difference.

References
----------
T. J. Rothenberg, Econometrica 39 (1971) 577, for local identifiability. R. N. Gutenkunst et al., PLoS Comput. Biol. 3 (2007)
e189, for eigenvalues in relative units.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations

import numpy as np

from rigsight.errors import SimulationError
from rigsight.identify.fit.fit_data import FitResult
from rigsight.identify.fit.grey_box import GreyBoxFit
from rigsight.identify.information import (
    POORLY_KNOWN,
    Information,
    conditional_errors,
    information,
    listed,
    marginal_errors,
    percent,
    product_text,
    small_fraction,
    sparsest,
    sum_text,
    undetermined,
)
from rigsight.records.record import Floats, Record
from rigsight.simulate import Structure, record_values, simulate

_NOISE = 0.01
"""Assumed noise of an unrecorded sensor, relative to the RMS of its reading: that of a mediocre sensor."""


_NO_INFLUENCE = 100.0
"""Standard error over the value, with all other parameters known, above which a parameter is reported to have no influence."""
_STEP = 1.5
"""Factor of the step that tests a combination: large enough to distinguish a sum from a product."""
_UNCHANGED = 0.005
"""Change of the outputs along a combination, over that by one of its members alone, below which they count as unchanged."""


@dataclass(frozen=True)
class Combination:
    """A combination of parameters that the records determine although they do not determine its members."""

    text: str  # the combination, as in ``J_m/k_t``
    members: tuple[str, ...]  # names of the parameters
    value: float  # value of the combination
    std: float  # its standard error
    unit: str = ""  # unit if it is that of the members, else empty


@dataclass(frozen=True)
class Identifiability:
    """Identifiability of parameters from some records."""

    # Relative standard error by parameter, infinite if nothing is known; relative to its size in the records
    # for a parameter that may be zero.
    relative_errors: dict[str, float]
    determined: tuple[str, ...]  # names of the parameters that the records determine
    combinations: tuple[Combination, ...]  # combinations of the others that the records determine
    statements: tuple[str, ...]  # sentences on parameters that the records do not determine
    # Number of independent changes of parameters that leave the outputs within the noise.
    free_directions: int
    remedies: tuple[str, ...] = ()  # sentences on measures with which more parameters would be determined

    @property
    def sentence(self) -> str:
        """The findings in words: the parameters that are determined, and those that are not."""
        names = list(self.relative_errors)
        if not names:
            return "There was nothing to identify."
        if len(self.determined) == len(names):
            worst = max(names, key=lambda name: self.relative_errors[name])
            error = percent(self.relative_errors[worst])
            return f"The records determine all parameters; the least certain is {worst} ({error})."
        known = f"The records determine {listed(self.determined)}." if self.determined else ""
        first = known or "The records determine no single parameter."
        return " ".join([first, *self.statements, *self.remedies])


def identifiability(found: Information) -> Identifiability:
    """Return the parameters that the records determine, and the combinations of the others."""
    errors, search = relative_errors(found), _Search(found)
    statements = tuple(search.statements())
    return Identifiability(
        relative_errors=errors,
        determined=tuple(name for name, error in errors.items() if error < POORLY_KNOWN),
        combinations=tuple(search.combinations()),
        statements=statements,
        free_directions=free_directions(found),
    )


def free_directions(found: Information) -> int:
    """Return the number of independent relative changes of parameters that leave the outputs within the noise."""
    return int(undetermined(found.root).shape[1])


def relative_errors(found: Information) -> dict[str, float]:
    """Return the relative standard error of each parameter, see `Identifiability`."""
    errors = conditional_errors(found.root)
    # A parameter with almost no influence is held, so that its uncertainty does not affect the others.
    held = errors >= POORLY_KNOWN
    errors[~held] = marginal_errors(found.root[:, ~held])
    return dict(zip(found.names, map(float, errors), strict=True))


@dataclass(frozen=True, eq=False)
class _Quantity:
    """A parameter or a combination of parameters."""

    # Its text, the parameters in it, and its unit.
    text: str
    members: tuple[str, ...]
    unit: str
    # Its value, and the reference of its relative changes.
    value: float
    size: float
    direction: Floats  # relative change of the parameters when it alone grows by its size, shape (n,)
    power: int = 1  # power of the changed parameter in this quantity

    def step(self, factor: float) -> Floats:
        """Return the relative change of the parameters when it alone grows by a factor, shape (n,)."""
        return np.asarray(self.direction * self.power * (factor ** (1.0 / self.power) - 1.0))


def _sum(first: _Quantity, weight: float, second: _Quantity) -> _Quantity:
    """Return ``first + weight second``."""
    text = sum_text(first.text, weight, second.text, first.unit == second.unit)
    value = first.value + weight * second.value
    # A sum that is zero by chance is as certain as its first term.
    size = value if abs(value) > abs(first.size) else first.size
    members = (*first.members, *second.members)
    return _Quantity(text, members, first.unit, value, size, first.direction * size / first.size)


class _Search:
    """Combines parameters until all are determined or reported as undetermined."""

    def __init__(self, found: Information) -> None:
        self._found = found
        self._quantities = [
            _Quantity(name, (name,), unit, float(value), float(size), row)
            for name, unit, value, size, row in zip(
                found.names, found.units, found.values, found.sizes, np.eye(len(found.names)), strict=True
            )
        ]
        self._held: dict[str, _Quantity] = {}
        """Quantity to which the ratio is determined, by the text of the quantity."""

    def statements(self) -> Iterator[str]:
        """Yield sentences on undetermined parameters; each removes one undetermined direction."""
        while self._quantities and (free := undetermined(self._root())).shape[1]:
            yield self._alone() or self._pair() or self._group(free)

    def combinations(self) -> Iterator[Combination]:
        """Yield the combinations that were formed and are determined."""
        if not self._quantities:
            return
        errors = marginal_errors(self._root())
        for q, error in zip(self._quantities, map(float, errors), strict=True):
            if error >= POORLY_KNOWN:
                continue
            if q.text in self._held:
                other = self._held[q.text]
                text, value = product_text([(q.text, 1), (other.text, -1)]), q.value / other.value
                yield Combination(text, (*q.members, *other.members), value, abs(value) * error)
            elif len(q.members) > 1:
                yield Combination(q.text, q.members, q.value, abs(q.size) * error, q.unit)

    def _root(self) -> Floats:
        return self._found.root @ np.column_stack([q.direction for q in self._quantities])

    def _alone(self) -> str:
        """Report a quantity that is not determined though all others are, or were they known, and remove it."""
        # A small part of it in those that are determined is no reason to name them with it.
        root = self._root()
        errors, beside_others = conditional_errors(root), marginal_errors(root)
        if np.count_nonzero(beside_others >= POORLY_KNOWN) == 1:
            errors = beside_others
        index = int(np.argmax(errors))
        if errors[index] < POORLY_KNOWN:
            return ""
        quantity = self._quantities.pop(index)
        none, how = errors[index] > _NO_INFLUENCE, f"standard error {percent(errors[index])}"
        return f"{quantity.text} is not determined ({'it has no influence' if none else how})."

    def _pair(self) -> str:
        """Combine two quantities that compensate each other."""
        root, best, pair = self._root(), 1.0 / POORLY_KNOWN, None
        for i, j in combinations(range(len(self._quantities)), 2):
            _, singular, right = np.linalg.svd(root[:, [i, j]], full_matrices=False)
            if singular[-1] < best:
                best, pair = float(singular[-1]), (i, j, right[-1])
        if pair is None:
            return ""
        i, j, (along_i, along_j) = pair
        first, second = self._quantities[i], self._quantities[j]
        together, words = self._combined(first, second, float(along_i), float(along_j))
        self._quantities = [q for q in self._quantities if q is not first and q is not second] + [together]
        return words

    def _combined(
        self, first: _Quantity, second: _Quantity, along_first: float, along_second: float
    ) -> tuple[_Quantity, str]:
        """Return the determined combination of two quantities that compensate each other: a product of powers, or a sum."""
        name = f"{first.text} and {second.text}"
        # A quantity that may be zero cannot be a factor.
        plain = all(quantity.size == quantity.value for quantity in (first, second))
        power = small_fraction(along_second / along_first) if plain and along_first else None
        change = self._change([first, second], [along_first, along_second], power is not None)
        if power is not None and change <= _UNCHANGED:
            a, b = power.numerator, -power.denominator
            if a < 0:
                a, b = -a, -b
            text = product_text([(first.text, a), (second.text, b)])
            value = first.value**a * second.value**b
            kind = "product" if b > 0 else "ratio"
            members = (*first.members, *second.members)
            together = _Quantity(text, members, "", value, value, first.direction / a, a * first.power)
            return together, f"{name} only as their {kind} {text}."
        weight = -(first.size * along_first) / (second.size * along_second)
        together = _sum(first, weight, second)
        plain_sum = f"{first.text} + {second.text}", f"{first.text} - {second.text}"
        kind = ("sum " if weight > 0.0 else "difference ") if together.text in plain_sum else ""
        exact = self._change([first, second], [along_first, along_second], False) <= _UNCHANGED
        closely = "" if exact else ", close to these values"
        return together, f"{name} only as {'their ' if kind else ''}{kind}{together.text}{closely}."

    def _group(self, free: Floats) -> str:
        """Report quantities that can change together without a change of the outputs, and hold one of them."""
        direction, taking_part = sparsest(free, np.linalg.norm(self._root(), axis=0))
        members = [self._quantities[i] for i in taking_part]
        along = [float(entry) for entry in direction[taking_part] / np.max(np.abs(direction))]
        powers = [p for entry in along if (p := small_fraction(entry)) is not None]
        if (
            len(powers) == len(members)
            and self._change(members, list(map(float, powers)), True) <= _UNCHANGED
        ):
            return self._factor(members, powers)
        if self._change(members, along, False) <= _UNCHANGED:
            return self._sums(members, along)
        held = max(zip(members, along, strict=True), key=lambda pair: abs(pair[1]))[0]
        self._quantities.remove(held)
        return f"{listed([q.text for q in members])} cannot be separated: the others compensate for a change of one."

    def _factor(self, members: Sequence[_Quantity], powers: Sequence[Fraction]) -> str:
        """Report quantities with a common undetermined factor, and hold the first."""
        held = next(q for q, power in zip(members, powers, strict=True) if abs(power) == 1)
        self._quantities.remove(held)
        names = listed([q.text for q in members])
        if len(set(powers)) > 1:
            moved = ", ".join(f"{q.text} x 2^{power}" for q, power in zip(members, powers, strict=True))
            return (
                f"{names} can change together without any change of the outputs ({moved}): one must be known to determine the "
                f"others."
            )
        self._held |= {q.text: held for q in members if q is not held}
        return f"{names} only up to a common factor: their ratios are determined, and one must be known to determine the others."

    def _sums(self, members: Sequence[_Quantity], along: Sequence[float]) -> str:
        """Combine quantities of which one forms a sum with each of the others."""
        slopes = [q.size * entry for q, entry in zip(members, along, strict=True)]
        # The text is clearest if the shared one is added to most of the others.
        shared = max(range(len(members)), key=lambda i: sum(slope * slopes[i] < 0.0 for slope in slopes))
        held, both = members[shared], zip(members, slopes, strict=True)
        made = [_sum(q, -slope / slopes[shared], held) for q, slope in both if q is not held]
        self._quantities = [q for q in self._quantities if q not in members] + made
        return f"{listed([q.text for q in members])} only as {listed([q.text for q in made])}."

    def _change(self, quantities: Sequence[_Quantity], along: Sequence[float], as_powers: bool) -> float:
        """Return the change of the outputs along a direction, divided by that due to its first member alone."""
        # Infinite if the step would exceed a bound on either side.
        for side in (1.0, -1.0):
            places = self._moved(quantities, [side * entry for entry in along], as_powers)
            if all(np.all((self._found.lower <= p) & (p <= self._found.upper)) for p in places):
                break
        else:
            return np.inf
        lengths = [
            self._found.change(dict(zip(self._found.names, map(float, p), strict=True))) for p in places
        ]
        if not np.all(np.isfinite(lengths)) or lengths[1] == 0.0:
            return np.inf
        return lengths[0] / lengths[1]

    def _moved(
        self, quantities: Sequence[_Quantity], along: Sequence[float], as_powers: bool
    ) -> tuple[Floats, Floats]:
        """Return the parameters after a step of all quantities, and after a step of the first alone."""
        found, largest = self._found, max(abs(entry) for entry in along)
        moved, alone = found.values.copy(), found.values.copy()
        for number, (quantity, entry) in enumerate(zip(quantities, along, strict=True)):
            grows = entry / largest
            factor = _STEP**grows if as_powers else 1.0 + (_STEP - 1.0) * grows
            step = found.sizes * quantity.step(factor)
            moved += step
            if number == 0:
                alone += step
        return moved, alone


def helpful_sensors(
    structure: Structure,
    records: Sequence[Record],
    scales: Mapping[str, float],
    noise: Mapping[str, float],
    result: FitResult,
) -> tuple[str, ...]:
    """Return a sentence for each unrecorded sensor with which fewer directions of the parameters would be undetermined."""
    lacking = [s.name for s in structure.rig.outputs if not any(s.name in record for record in records)]
    before = free_directions(information(GreyBoxFit(structure, records, scales, noise), result))
    if not lacking or not before:
        return ()
    try:
        shown = [
            simulate(structure, record_values(structure, result.values, record), record, state)
            for record, state in zip(records, result.rig_states, strict=True)
        ]
    except SimulationError:
        return ()
    reported = []
    for name in lacking:
        with_it = [record.with_signals(**{name: s[name]}) for record, s in zip(records, shown, strict=True)]
        size = float(np.std(np.concatenate([s[name] for s in shown])))
        if size == 0.0:
            continue
        fit = GreyBoxFit(structure, with_it, scales, {**noise, name: _NOISE * size})
        remainder = free_directions(information(fit, result))
        if remainder < before:
            much = "all parameters" if remainder == 0 else "more of them"
            reported.append(f"If '{name}' were also recorded, these inputs would determine {much}.")
    return tuple(reported)

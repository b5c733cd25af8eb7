"""How large may the gap of a sensor be? A limit that was asked for, else what a record exceeds rarely if the model holds."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from rigsight.compare import KnownGap, NumberCheck, OwnNumber, UsualGap, check_numbers
from rigsight.errors import InputError, nearest
from rigsight.records.channel_units import UnknownUnitError, conversion
from rigsight.rigs import Rig
from rigsight.workflow.gating.reference import Reference

FALSE_ALARMS = 0.05
"""Probability that true records close the gate: of all records, sensors and numbers of a run together (Bonferroni)."""
_OF_GAPS = 0.5
"""Share of it for gaps; the rest is for changed numbers."""
_FARTHER = 0.1
"""Share by which noise and another draw of the same input may move a sensor farther."""
_LIMIT = re.compile(r"(?P<output>[^=]+)=\s*(?P<value>[^\s]+)\s*(?P<unit>.*)")


@dataclass(frozen=True)
class Check:
    """The gap of one sensor in one record."""

    record: str
    output: str
    unit: str
    gap: float  # RMS of measured minus simulated; infinite where the model cannot be simulated
    floor: float  # noise floor of the sensor
    limit: float
    usual: float | None  # RMS of a record for which the model is known to hold; None where none is known
    p_value: float | None  # probability of such a gap if the model holds; None where the limit was asked for
    beyond: bool = (
        False  # True where the sensor moves more than in any record for which the model is known to hold
    )

    @property
    def closed(self) -> bool:
        """True if the gap exceeds the limit."""
        return self.gap > self.limit

    @property
    def excess(self) -> float:
        """The gap in units of the limit."""
        return self.gap / self.limit if self.limit > 0.0 else math.inf


@dataclass(frozen=True)
class Limits:
    """The limits that were asked for."""

    floors: float | None = None  # for every sensor, in noise floors
    of_outputs: Mapping[str, float] = field(default_factory=dict)  # in the units of the sensors

    @classmethod
    def read(cls, floors: float | None, texts: Iterable[str], rig: Rig) -> Limits:
        """Return limits from what was written on a command line: ``psi=0.002 rad``."""
        if floors is not None and not (math.isfinite(floors) and floors > 0.0):
            raise InputError(f"--floors must be a positive number, got {floors:g}.")
        return cls(floors, dict(_limit(text, rig) for text in texts))

    def asked(self, output: str, floor: float) -> float | None:
        """Return the limit that was asked for; None if there is none."""
        if output in self.of_outputs:
            return self.of_outputs[output]
        return None if self.floors is None else self.floors * floor


@dataclass(frozen=True)
class Judge:
    """What each gap of a run is held against."""

    rig: Rig
    limits: Limits
    reference: Reference
    n_tested: int  # number of gaps without a limit that was asked for
    n_records: int

    def check(self, gap: KnownGap) -> Check | None:
        """Return the check of a gap; None where nothing limits it."""
        floor = self.reference.floors[gap.output]
        usual = UsualGap.of(self.reference.known, gap.output)
        limit, p_value = self.limits.asked(gap.output, floor), None
        if limit is None:
            if usual is None:
                return None
            limit = usual.limit(gap.duration, _OF_GAPS * FALSE_ALARMS / self.n_tested)
            p_value = usual.p_value(gap.rms, gap.duration)
        return Check(
            gap.record,
            gap.output,
            self.rig.signal_units[gap.output],
            gap.rms,
            floor,
            limit,
            None if usual is None else usual.center,
            p_value,
            usual is not None and gap.moved > usual.farthest * (1.0 + _FARTHER),
        )

    @property
    def asks_numbers(self) -> bool:
        """True if changed numbers close the gate: where their scatter is known, and no other limit was asked for."""
        return bool(self.reference.numbers) and self.limits.floors is None and not self.limits.of_outputs

    def check_numbers(self, record: str, own: Sequence[OwnNumber]) -> list[NumberCheck]:
        """Return the checks of the numbers of a record."""
        each = (1.0 - _OF_GAPS) * FALSE_ALARMS / max(1, len(own) * self.n_records)
        return check_numbers(record, own, self.reference.numbers, each)


def judge(rig: Rig, limits: Limits, reference: Reference, outputs: Sequence[str], n_records: int) -> Judge:
    """Return what gaps are held against; each sensor counts as often as a record holds it."""
    tested = [
        output
        for output in outputs
        if limits.asked(output, 1.0) is None and UsualGap.of(reference.known, output)
    ]
    return Judge(rig, limits, reference, max(1, len(tested)), n_records)


def _limit(text: str, rig: Rig) -> tuple[str, float]:
    found = _LIMIT.fullmatch(text.strip())
    if found is None:
        raise InputError(
            f"--limit '{text}' cannot be read; write SENSOR=VALUE UNIT, for instance psi=0.002 rad."
        )
    output, unit = found["output"].strip(), found["unit"].strip()
    units = {signal.name: signal.unit for signal in rig.outputs}
    if output not in units:
        raise InputError(
            f"--limit '{text}': {rig.name} has no sensor '{output}'.{nearest(output, units)} Its sensors: {', '.join(units)}."
        )
    try:
        value = float(found["value"]) * (conversion(unit, units[output])[0] if unit else 1.0)
    except UnknownUnitError as error:
        raise InputError(
            f"--limit '{text}': the unit '{unit}' {error}. Write it in {units[output]}."
        ) from None
    except ValueError:
        raise InputError(f"--limit '{text}': '{found['value']}' is not a number.") from None
    if not (math.isfinite(value) and value > 0.0):
        raise InputError(f"--limit '{text}': must be a positive number.")
    return output, value

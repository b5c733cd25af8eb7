"""Findings in the records themselves, before any effect is tried."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

FindingKind = Literal["hold", "time_shift", "clipping", "stuck", "quantization", "jump", "offset"]
Answer = Literal["yes", "no", "cannot tell"]


@dataclass(frozen=True)
class Finding:
    """One thing that is, or may be, wrong with the records."""

    kind: FindingKind  # what it is
    sentence: str  # what was seen, with numbers
    remedy: str  # what to do about it
    # True for a fault of the data that may cause the gap; False if an effect may explain it equally well.
    serious: bool = True
    # Where it was seen; None for all records.
    record: str | None = None
    signal: str | None = None
    # Share of the gap of the equations without an effect, above the noise floor and as power, that it
    # explains; None where that was not measured.
    explained: float | None = None

    def to_json(self) -> dict[str, Any]:
        """Return the finding as it stands in ``diagnosis.json``."""
        return {{"remedy": "mend"}.get(key, key): value for key, value in vars(self).items()}


@dataclass(frozen=True)
class AmplitudeDependence:
    """Whether the frequency response changes with the amplitude."""

    # ``"yes"``: a nonlinear effect is involved; ``"no"``: only linear causes are left; or ``"cannot tell"``.
    response: Answer
    sentence: str  # the answer with numbers
    records: tuple[str, ...] = ()  # the two records that were compared
    path: str = ""  # input and sensor, as in ``"u -> x"``; empty where there is none

    def to_json(self) -> dict[str, Any]:
        """Return the answer as it stands in ``diagnosis.json``."""
        return {
            "kind": "amplitude_dependence",
            "path": self.path,
            "answer": self.response,
            "sentence": self.sentence,
            "records": self.records,
        }


@dataclass(frozen=True)
class DataQuality:
    """Findings in the records themselves."""

    # In the order in which they are worth reading; empty where the records are healthy.
    findings: tuple[Finding, ...]
    amplitudes: tuple[AmplitudeDependence, ...]  # whether each frequency response changes with the amplitude

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences with remedies, and the answers about the amplitude; clipping is reported when a record is read."""
        reported = [f"{f.sentence} {f.remedy}" for f in self.findings if f.kind != "clipping"]
        return (*reported, *(response.sentence for response in self.amplitudes))

    def to_json(self) -> list[dict[str, Any]]:
        """Return the list ``data_quality`` of ``diagnosis.json``; the last entries are the answers about the amplitude."""
        return [*(one.to_json() for one in self.findings), *(one.to_json() for one in self.amplitudes)]

"""A campaign before any fit: its records, what is wrong with them, its parameters, and the matrix of effects."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from scipy.signal import resample_poly

from rigsight.campaign import Campaign
from rigsight.check.channels import CheckedRecord, checked_record
from rigsight.check.effect_matrix import EffectMatrix, effect_matrix
from rigsight.check.remarks import Remark, remarks, with_offsets
from rigsight.diagnose.data_quality.amplitude_response import amplitude_dependences
from rigsight.diagnose.data_quality.finding import AmplitudeDependence
from rigsight.diagnose.fit_context import start_values_of
from rigsight.diagnose.noise.detection import NoiseFloor, noise_floors
from rigsight.effects import Effect
from rigsight.errors import SimulationError
from rigsight.identify import FitResult, GreyBoxFit, characteristic_scales
from rigsight.identify.fit.windows import cut, liveliest, shown_by, window_length
from rigsight.identify.identifiability import Identifiability, identifiability
from rigsight.identify.information import POORLY_KNOWN, information, listed
from rigsight.identify.linear_view import longest_free_run, near_rest
from rigsight.inverse import numbers_along_motion, with_all_inputs
from rigsight.json_data import json_data
from rigsight.records import Floats, Record, is_constant
from rigsight.simulate import compose
from rigsight.simulate.linearization import Linearization

SCHEMA_VERSION = 1
_OF_EFFECTS, _OF_PARAMETERS = 3000, 40000
"""Samples of the most excited stretches of all records together for effects and for parameters: a second each."""
PARTS = ("channels", "noise floors", "remarks", "parameters", "effects")
"""Steps of a check, as they are reported."""
_OF_FLOORS = ("output", "unit", "std", "method", "lower_bound")
Status = Literal["determined", "weak", "only with others", "not determined"]
_WEAK = 0.1
"""Relative standard error from which a parameter is known badly (a convention)."""
_EVALUATIONS = 60
"""Of a rough fit: near enough for what the records determine, not for the numbers."""
_OF_START = 15
"""Of a rough fit that tells which start is nearer (a budget)."""
_LARGER_PART = 0.5
"""Share of the power of a reading, or of what another fit leaves, that decides (a convention)."""
_OF_MOTION = 0.99
"""Share of the power of the velocity below the end of the band of a motion."""
_PER_PERIOD = 30.0
"""Samples of a period at the end of this band: forces hold overtones of the motion."""


@dataclass(frozen=True)
class CheckedParameter:
    """Whether the records determine a parameter."""

    name: str
    unit: str
    status: Status
    relative_error: float  # standard error over the value; infinite where nothing is known


@dataclass(frozen=True)
class Check:
    """What the records of a campaign can show."""

    title: str
    rig: str
    records: tuple[CheckedRecord, ...]
    floors: tuple[NoiseFloor, ...]
    remarks: tuple[Remark, ...]  # the gravest first
    amplitudes: tuple[AmplitudeDependence, ...]
    parameters: tuple[CheckedParameter, ...]
    identifiability: str  # the statement on the parameters
    matrix: EffectMatrix

    @property
    def before_a_fit(self) -> tuple[str, ...]:
        """What to know before a fit: faults and warnings, each with what to do, and how each record was read."""
        reported = (r for r in self.remarks if r.severity != "note" or r.record is not None)
        return tuple(f"{r.sentence} {r.remedy}".strip() for r in reported)

    def to_json(self) -> dict[str, Any]:
        """Return the content of ``check.json``."""
        m = self.matrix
        content = {
            "schema_version": SCHEMA_VERSION,
            "title": self.title,
            "rig": self.rig,
            "records": [
                {**vars(r), "channels": [{**vars(c), "usable": c.usable} for c in r.channels]}
                for r in self.records
            ],
            "noise": [{key: getattr(f, key) for key in _OF_FLOORS} for f in self.floors],
            "findings": [vars(remark) for remark in self.remarks],
            "amplitudes": [answer.to_json() for answer in self.amplitudes],
            "parameters": [vars(parameter) for parameter in self.parameters],
            "identifiability": self.identifiability,
            "effects": {
                "judged": [
                    {"effect": e, "family": str(f), "where": w, "visible": v}
                    for e, f, w, v in zip(m.effects, m.families, m.where, m.visible, strict=True)
                ],
                "told_apart": m.told,
                "other_motions": [
                    {"effects": [m.effects[j], m.effects[i]], "motion": motion}
                    for (i, j), motion in m.motions.items()
                ],
                "not_judged": m.not_judged,
                "hidden": m.hidden,
                "reason": m.reason or None,
            },
        }
        return dict(json_data(content))


def check_campaign(campaign: Campaign, effects: Sequence[Effect], say: Callable[[str], None]) -> Check:
    """Return what the records of a campaign can show; each of `PARTS` that is done is said."""
    rig = campaign.rig
    records = tuple(checked_record(rig, record) for record in campaign.records)
    say(PARTS[0])
    whole = [with_all_inputs(rig, record) for record in campaign.records]
    everything = tuple(_coarser(r, output) for r, output in zip(whole, shown_by(rig, whole), strict=True))
    coarser = tuple(record for record in everything if record.role == "estimation")
    short = liveliest(coarser, rig, _OF_EFFECTS)
    floors = noise_floors(rig, campaign.records, campaign.drifts)
    say(PARTS[1])
    noise = {floor.output: floor.std for floor in floors}
    values = _values(replace(campaign, records=coarser), short, noise)
    linear = _near_rest(campaign, short, values)
    found = remarks(campaign, short, liveliest(everything, rig, _OF_PARAMETERS), records, floors, linear)
    faulty = {(one.record or "", one.signal or "") for one in found if one.severity == "fault"}
    answers = amplitude_dependences(rig, coarser, faulty)
    say(PARTS[2])
    parameters, statement, left = _parameters(
        campaign, liveliest(coarser, rig, _OF_PARAMETERS), values, noise, linear
    )
    found = with_offsets(found, rig, *left)
    say(PARTS[3])
    matrix = effect_matrix(campaign, short, values, effects)
    say(PARTS[4])
    return Check(campaign.title, rig.name, records, floors, found, answers, parameters, statement, matrix)


def _values(campaign: Campaign, short: Sequence[Record], noise: Mapping[str, float]) -> dict[str, float]:
    """Return the numbers given, or those of a regression where rough fits of short records tell that they are nearer."""
    given = {**campaign.constants, **campaign.given}
    regressed = _regressed(campaign, given)
    as_given, as_regressed = {**regressed, **given}, {**given, **regressed}
    if as_given == as_regressed:
        return as_given
    structure = compose(campaign.rig, campaign.modelled)
    # Over pieces even a simulation with numbers that are far off stays in phase with the motion.
    pieces = cut(short, window_length(campaign.rig, short))

    def fitted(start: Mapping[str, float]) -> FitResult:
        fit = GreyBoxFit(structure, pieces, characteristic_scales(campaign.rig, pieces, start), noise)
        free = _free(campaign)
        return fit.fit(start, free, max_evaluations=_OF_START, tolerance=1e-3, finish=False)

    from_given, from_regressed = fitted(as_given), fitted(as_regressed)
    is_nearer = from_regressed.cost < _LARGER_PART * from_given.cost
    return {**as_regressed, **from_regressed.values} if is_nearer else as_given


def _regressed(campaign: Campaign, given: Mapping[str, float]) -> dict[str, float]:
    """Return numbers of the rig from regressions of the records; none where all are given and only a long search finds them."""
    lacking = any(p.name not in given for p in campaign.rig.parameters)
    is_short = _responds_in_spectra(campaign, given)
    along = None if is_short else numbers_along_motion(campaign, given)
    if along is not None:
        return along
    return start_values_of(campaign) if is_short or lacking else {}


def _responds_in_spectra(campaign: Campaign, known: Mapping[str, float]) -> bool:
    """Return whether a rig of one driven mass has a known gain: its numbers follow from the spectra, noisy or not."""
    rig = campaign.rig
    if not (rig.has_one_motion and rig.is_driven):
        return False
    moves = any(not is_constant(record[rig.inputs[0].name]) for record in campaign.estimation)
    return moves and {symbol.name for symbol in rig.motion.drive_gain.free_symbols} <= known.keys()


def _near_rest(
    campaign: Campaign, records: Sequence[Record], values: Mapping[str, float]
) -> Linearization | None:
    """Return the equations linearized near rest in the first record; None where they have no rest."""
    try:
        structure = compose(campaign.rig, campaign.modelled)
        return near_rest(structure, {**values, **records[0].constants}, records[:1])
    except SimulationError:
        return None


def _coarser(record: Record, output: str) -> Record:
    """Return a record sampled as finely as the motion of an output needs."""
    velocity = np.diff(record[output])
    power = np.cumsum(np.abs(np.fft.rfft(velocity - np.mean(velocity))) ** 2)
    highest = float(np.searchsorted(power, _OF_MOTION * power[-1])) / velocity.size
    factor = int(1.0 / max(_PER_PERIOD * highest, 1.0 / record.n_samples))
    if factor < 2 or record.n_samples // factor < 500:
        return record
    signals = {name: resample_poly(s, 1, factor, padtype="line") for name, s in record.signals.items()}
    return replace(record, dt=factor * record.dt, signals=signals, hold="band_limited")


def _parameters(
    campaign: Campaign,
    records: Sequence[Record],
    values: Mapping[str, float],
    noise: Mapping[str, float],
    linear: Linearization | None,
) -> tuple[tuple[CheckedParameter, ...], str, tuple[Sequence[Record], Sequence[Floats]]]:
    """Return the parameters, what is not determined, and what a rough fit leaves; none where the start cannot be simulated."""
    rig, structure = campaign.rig, compose(campaign.rig, campaign.modelled)
    limit = None if linear is None else longest_free_run(linear.poles, records)
    if limit is not None or campaign.drifts:
        limit = min(window_length(rig, records), limit or np.inf)
    windows = cut(records, limit)
    scales = characteristic_scales(rig, windows, values)
    fit = GreyBoxFit(structure, windows, scales, noise)
    result = fit.fit({**values}, _free(campaign), max_evaluations=_EVALUATIONS, tolerance=1e-3)
    if not result.residuals:
        why = (
            "The equations cannot be simulated at these numbers, so what the records determine is not known."
        )
        return (), why, (windows, ())
    found = identifiability(information(fit, result))
    units = {p.name: p.unit for p in structure.parameters}
    parameters = tuple(
        CheckedParameter(name, units[name], _status(name, found), error)
        for name, error in found.relative_errors.items()
    )
    factor = campaign.open_factor
    statement = " ".join(
        [
            *_judged_at(campaign, values, noise, windows, result.residuals),
            found.sentence,
            *([factor.sentence] if factor is not None and factor.is_given else []),
        ]
    )
    return parameters, statement, (windows, result.residuals)


def _free(campaign: Campaign) -> list[str]:
    """Return the names of the parameters that are judged."""
    held, factor = {*campaign.constants}, campaign.open_factor
    if campaign.absent_spring:
        held.add(campaign.absent_spring)
    if factor is not None and factor.is_given:
        held.add(factor.held)
    structure = compose(campaign.rig, campaign.modelled)
    return [p.name for p in structure.parameters if p.name not in held]


def _judged_at(
    campaign: Campaign,
    values: Mapping[str, float],
    noise: Mapping[str, float],
    windows: Sequence[Record],
    residuals: Sequence[Floats],
) -> list[str]:
    """Return sentences where parameters are judged at other numbers than those given, or at numbers that do not fit."""
    rig, given = campaign.rig, campaign.given
    others = [
        f"{name} = {values[name]:.4g} instead of {given[name]:.4g}"
        for name in sorted(rig.usually_positive & given.keys())
        if abs(values[name] - given[name]) > _WEAK * abs(given[name])
    ]
    sentences = []
    if others:
        sentences.append(
            "A fit from the numbers given stays far from the records. Parameters and effects are judged at numbers "
            f"from a regression: {listed(others)}."
        )
    remaining = []
    for column, signal in enumerate(rig.outputs):
        seen = [
            (w[signal.name], r[:, column])
            for w, r in zip(windows, residuals, strict=True)
            if signal.name in w
        ]
        if seen:
            readings, own = (np.concatenate(parts) for parts in zip(*seen, strict=True))
            known = noise[signal.name] ** 2
            share = (np.mean(own**2) - known) / max(np.var(readings) - known, known)
            if share > _LARGER_PART:
                remaining.append(f"{min(share, 1.0):.0%} of {signal.name}")
    if remaining:
        sentences.append(
            f"The nearest numbers leave {listed(remaining)} unexplained: unless that is noise, what is determined is not "
            "known before the records or the equations are corrected. At these numbers:"
        )
    return sentences


def _status(name: str, found: Identifiability) -> Status:
    error = found.relative_errors[name]
    if error < POORLY_KNOWN:
        return "determined" if error < _WEAK else "weak"
    together = {member for combination in found.combinations for member in combination.members}
    return "only with others" if name in together else "not determined"

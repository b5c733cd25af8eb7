"""Where does the gap lie? Its square split by record, amplitude, frequency band, time, state and signal path."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.location.bands import band_edges, band_powers, dominant_frequency
from rigsight.diagnose.location.gap_parts import (
    AmplitudePart,
    BandPart,
    Localization,
    RecordPart,
    TimePart,
)
from rigsight.diagnose.location.paths import path_parts, path_sentence
from rigsight.diagnose.location.state_plane import joint_parts, state_parts
from rigsight.diagnose.location.trace import STAGES, Trace, budget_intervals
from rigsight.diagnose.noise.detection import NoiseFloor, Stretches
from rigsight.diagnose.policy import MAPS
from rigsight.identify import mean_square_freedom
from rigsight.metrics import rms
from rigsight.records.record import Floats
from rigsight.rigs import Rig


def localize(
    context: FitContext,
    traces: Sequence[Trace],
    scored_on: str,
    before: FittedModel,
    reidentified: FittedModel,
    after: FittedModel,
    rng: np.random.Generator,
    floors: Sequence[NoiseFloor] = (),
) -> Localization:
    """Return the gap split in every way."""
    stretches: dict[str, Stretches] = {
        floor.output: tuple((noise, dt) for noise, dt in floor.stretches if noise.size >= MAPS.least_noise)
        for floor in floors
    }
    scored = [trace for trace in traces if trace.role == scored_on]
    one_motion = context.rig.has_one_motion
    by_path = path_parts(context, before, reidentified, after) if one_motion else ()
    return Localization(
        by_record=tuple(_by_record(context.rig, traces, scored_on, context.noise, rng)),
        by_amplitude=tuple(_by_amplitude(context, traces, scored_on)),
        by_band=tuple(_by_band(scored, context.noise, stretches)),
        by_state=(state_parts if one_motion else joint_parts)(context, reidentified, scored),
        by_time=tuple(_by_time(scored, context.noise)),
        by_path=by_path,
        sentence=path_sentence(by_path, context.rig),
        noise_shape={output: "measured" if stretches.get(output) else "white" for output in context.noise},
    )


def _by_record(
    rig: Rig,
    traces: Sequence[Trace],
    scored_on: str,
    noise: Mapping[str, float],
    rng: np.random.Generator,
) -> list[RecordPart]:
    parts = []
    for trace in traces:
        alike = [other for other in traces if other.role == trace.role]
        for output in trace.measured:
            spread = _spread([trace], output)
            floor = noise[output] / spread
            remainder = trace.residual("after", output)
            unit = rig.signal_units[output]
            parts.append(
                RecordPart(
                    output=output,
                    **_figures([trace], output, noise[output], alike),
                    record=trace.record,
                    role=trace.role,
                    kind=trace.kind,
                    amplitude=trace.amplitude,
                    scored=trace.role == scored_on,
                    n_samples=trace.t.size,
                    duration=trace.t.size * trace.dt,
                    measured_rms=spread,
                    rms=rms(remainder),
                    freedom=mean_square_freedom(remainder),
                    units={"duration": "s", "measured_rms": unit, "rms": unit},
                    interval=budget_intervals([trace], output, floor, rng),
                )
            )
    return parts


def _by_amplitude(context: FitContext, traces: Sequence[Trace], scored_on: str) -> list[AmplitudePart]:
    units = {"amplitude": context.rig.inputs[0].unit if context.rig.inputs else "1"}
    known = {(trace.role != scored_on, trace.amplitude) for trace in traces if trace.amplitude is not None}
    parts = []
    for fitted, amplitude in sorted(known):
        alike = [trace for trace in traces if (trace.role != scored_on) == fitted]
        group = [trace for trace in alike if trace.amplitude == amplitude]
        for output in (signal.name for signal in context.rig.outputs):
            holding = [trace for trace in group if output in trace.measured]
            if holding:
                parts.append(
                    AmplitudePart(
                        output=output,
                        **_figures(holding, output, context.noise[output], alike),
                        amplitude=amplitude,
                        role=holding[0].role,
                        scored=not fitted,
                        records=tuple(trace.record for trace in holding),
                        measured_rms=_spread(holding, output),
                        units={**units, "measured_rms": context.rig.signal_units[output]},
                    )
                )
    return parts


def _by_band(
    scored: Sequence[Trace], noise: Mapping[str, float], stretches: Mapping[str, Stretches]
) -> list[BandPart]:
    parts = []
    for output, std in noise.items():
        holding = [trace for trace in scored if output in trace.measured]
        if not holding:
            continue
        spread = _spread(holding, output)
        edges = band_edges([(_input(trace), trace.measured[output], trace.dt) for trace in holding], std)
        weights = np.array([trace.t.size for trace in holding], dtype=np.float64)
        powers = {
            stage: np.average(
                [band_powers(trace.residual(stage, output), trace.dt, edges) for trace in holding],
                axis=0,
                weights=weights,
            )
            for stage in STAGES
        }
        floor = _colored(std, stretches.get(output, ()), edges)
        if floor is None:
            floor = np.average([_white(std, trace.dt, edges) for trace in holding], axis=0, weights=weights)
        total = float(np.sum(powers["reidentified"]))
        for i in range(edges.size - 1):
            parts.append(
                BandPart(
                    output=output,
                    **{stage: float(np.sqrt(powers[stage][i])) / spread for stage in STAGES},
                    noise_floor=float(np.sqrt(floor[i])) / spread,
                    share=_share(float(powers["reidentified"][i]), total),
                    noise_share=_share(float(floor[i]), total),
                    omega_low=float(edges[i]),
                    omega_high=float(edges[i + 1]),
                    excited=i < edges.size - 2,
                    units={"omega_low": "rad/s", "omega_high": "rad/s"},
                )
            )
    return parts


def _colored(std: float, stretches: Stretches, edges: Floats) -> Floats | None:
    """Return the power of the noise in each band from stretches of noise alone, shape (n_bands,); None without any."""
    if not stretches:
        return None
    powers = [band_powers(noise, dt, edges) for noise, dt in stretches]
    mean = np.average(powers, axis=0, weights=[noise.size for noise, _ in stretches])
    return np.asarray(mean * std**2 / float(np.sum(mean)))


def _white(std: float, dt: float, edges: Floats) -> Floats:
    """Return the power of white noise in each band, shape (n_bands,)."""
    inside = np.minimum(edges, np.pi / dt)
    return np.asarray(std**2 * np.diff(inside) / (np.pi / dt))


def _by_time(scored: Sequence[Trace], noise: Mapping[str, float]) -> list[TimePart]:
    parts = []
    for trace in scored:
        edges = np.linspace(
            0, trace.t.size, 1 + max(1, min(MAPS.time_stretches, trace.t.size // MAPS.fewest_stretch_samples))
        ).astype(int)
        for output in trace.measured:
            holding = [other for other in scored if output in other.measured]
            spread, total = _spread(holding, output), _total(holding, output)
            for start, stop in pairwise(edges):
                own = {stage: trace.residual(stage, output)[start:stop] for stage in STAGES}
                parts.append(
                    TimePart(
                        output=output,
                        **{stage: rms(residual) / spread for stage, residual in own.items()},
                        noise_floor=noise[output] / spread,
                        share=_share(float(np.sum(own["reidentified"] ** 2)), total),
                        noise_share=_share((stop - start) * noise[output] ** 2, total),
                        record=trace.record,
                        t_start=float(trace.t[start]),
                        t_end=float(trace.t[stop - 1]),
                        omega=dominant_frequency(
                            _input(trace)[start:stop], trace.dt, float(np.ptp(_input(trace)))
                        ),
                        mean=float(np.mean(own["reidentified"])) / spread,
                        units={"t_start": "s", "t_end": "s", "omega": "rad/s"},
                    )
                )
    return parts


def _figures(group: Sequence[Trace], output: str, noise: float, alike: Sequence[Trace]) -> dict[str, Any]:
    """Return the error of a group of records relative to its own motion, and its share among records of its kind."""
    spread = _spread(group, output)
    stages = {
        str(stage): rms(np.concatenate([trace.residual(stage, output) for trace in group])) / spread
        for stage in STAGES
    }
    total = _total([trace for trace in alike if output in trace.measured], output)
    n_samples = sum(trace.t.size for trace in group)
    return {
        **stages,
        "noise_floor": noise / spread,
        "share": _share(_total(group, output), total),
        "noise_share": _share(n_samples * noise**2, total),
    }


def _spread(traces: Sequence[Trace], output: str) -> float:
    """Return the RMS of an output about its mean over records; the smallest number where it rests."""
    samples = np.concatenate([trace.measured[output] for trace in traces])
    return float(np.std(samples)) or float(np.finfo(np.float64).tiny)


def _total(traces: Sequence[Trace], output: str) -> float:
    return float(sum(np.sum(trace.residual("reidentified", output) ** 2) for trace in traces))


def _share(part: float, total: float) -> float:
    return part / total if total > 0.0 else 0.0


def _input(trace: Trace) -> Floats:
    """Return what drives a record: of several inputs the one that moves most beside its own middle."""
    if not trace.inputs:
        return np.zeros(trace.t.size)
    return max(trace.inputs.values(), key=lambda samples: float(np.ptp(samples)))

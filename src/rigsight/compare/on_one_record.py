"""Comparison of many models on one record: responses, steps and free runs, each beside its noise floor."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from rigsight.compare.comparison import Column, Competitor, Failure, Floor, RecordComparison, Score
from rigsight.compare.response_error import (
    DEFAULT_SECONDS,
    ResponseError,
    SignalPath,
    StepWindow,
    measured_responses,
    response_error,
    response_floor,
    signal_paths,
    simulated_response,
    step_window,
    stepping_input,
    without_shares,
)
from rigsight.errors import InputError, SimulationError
from rigsight.frequency import FrequencyResponse
from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.identify.transfer.record_response import Method
from rigsight.metrics import nrmse
from rigsight.records import Floats, Record
from rigsight.rigs import Rig
from rigsight.simulate import Model, simulate

_TOLERANCE, _EVALUATIONS = 1e-5, 60
"""Relative change of the squared error at which states are good enough, and limit: hysteresis that does not forget needs many."""
_STATE_ACCURACY = 1e-3
"""Relative accuracy of the simulations that estimate a state; the one that is scored is a thousand times better."""


_NOISE_SEED = 0
"""Of the noise that shows what noise does to a frequency response: the same comparison gives the same floors."""
_COPIES = 4
"""Copies with other noise, over which the floor of a frequency response is averaged: one alone may be a fifth too low."""
_FEWER = 0.95
"""Share of the measured lines below which a simulated response is said to have fewer."""


@dataclass(frozen=True)
class Yardstick:
    """What all models are measured by."""

    rig: Rig  # the rig
    # Noise floor of each output that was measured. They belong to the records, not to the models, and are
    # handed in.
    floors: tuple[Floor, ...]
    method: Method = "local_rational"  # estimator of frequency responses
    step_seconds: float = DEFAULT_SECONDS  # length of the step window [s]


def compare_on_record(
    competitors: Sequence[Competitor], record: Record, windows: Sequence[Record], yardstick: Yardstick
) -> RecordComparison:
    """Score all models on one record.

    A model that cannot be simulated on the record, or whose response cannot be read, becomes a `Failure`; the others go on.
    """
    paths = signal_paths(yardstick.rig)
    measured, problems = measured_responses(record, paths, yardstick.method)
    disturbed = _with_more_noise(record, yardstick)
    least = {
        path.name: response_floor(disturbed, path, yardstick.method, measured[path.name])
        for path in paths
        if path.name in measured
    }
    notes = [f"No frequency response: {problem}" for problem in problems]
    step = None
    if record.kind == "step":
        try:
            step = _step(record, yardstick)
        except InputError as error:
            notes.append(str(error))
    trials = [_trial(c, record, windows, yardstick, paths, measured, least, step) for c in competitors]
    moved: dict[str, dict[str, Floats]] = {}
    for trial in trials:
        for output, samples in trial.moved.items():
            moved.setdefault(output, {})[trial.model] = samples
    return RecordComparison(
        record=record,
        measured={name: without_shares(response) for name, response in measured.items()},
        simulated={trial.model: trial.responses for trial in trials},
        step=step,
        moved=moved,
        scores=tuple(score for trial in trials for score in trial.scores),
        failures=tuple(failure for trial in trials for failure in trial.failures),
        notes=(*notes, *(note for trial in trials for note in trial.notes)),
    )


def _step(record: Record, yardstick: Yardstick) -> StepWindow:
    sources = [signal.name for signal in yardstick.rig.inputs]
    if not sources:
        raise InputError(f"Record '{record.name}': the rig has no input, so there is no step.")
    return step_window(record, stepping_input(record, sources), yardstick.step_seconds)


def _with_more_noise(record: Record, yardstick: Yardstick) -> list[Record]:
    """Return copies of a record whose outputs have as much noise again."""
    rng = np.random.default_rng(_NOISE_SEED)
    floors = [floor for floor in yardstick.floors if floor.output in record]
    return [
        record.with_signals(
            **{f.output: record[f.output] + f.noise(record.n_samples, record.dt, rng) for f in floors}
        )
        for _ in range(_COPIES)
    ]


@dataclass(eq=False)
class _Trial:
    """One model on one record."""

    model: str
    record: str
    scores: list[Score] = field(default_factory=list)
    responses: dict[str, FrequencyResponse] = field(default_factory=dict)
    moved: dict[str, Floats] = field(default_factory=dict)
    failures: list[Failure] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def add(self, column: Column, value: float, noise_floor: float | None, n_values: int) -> None:
        """Keep one score, or say that it is no number."""
        if math.isfinite(value):
            floor = noise_floor if noise_floor is not None and math.isfinite(noise_floor) else None
            self.scores.append(Score(self.model, self.record, column, value, floor, n_values))
        else:
            self.failures.append(Failure(self.model, self.record, "The error is not finite.", column))


def _trial(
    competitor: Competitor,
    record: Record,
    windows: Sequence[Record],
    yardstick: Yardstick,
    paths: Iterable[SignalPath],
    measured: Mapping[str, FrequencyResponse],
    least: Mapping[str, ResponseError | None],
    step: StepWindow | None,
) -> _Trial:
    trial = _Trial(competitor.name, record.name)
    stds = {floor.output: floor.std for floor in yardstick.floors}
    try:
        run = free_run(competitor.model, record, windows, stds)
    except SimulationError as error:
        trial.failures.append(Failure(competitor.name, record.name, str(error)))
        return trial
    if not run.estimated:
        trial.notes.append(
            f"{competitor.name}: the initial state was approximated, not estimated: the model is too stiff for a fit."
        )
    for path in paths:
        if path.name in measured:
            _score_response(
                trial, run.simulated, path, measured[path.name], least[path.name], yardstick.method
            )
    for floor in yardstick.floors:
        if floor.output not in record:
            continue
        output, spread = floor.output, float(np.std(record[floor.output]))
        least_nrmse = floor.std / spread if spread > 0.0 else None
        trial.add(Column("free_run_nrmse", output, "1"), run.nrmse[output], least_nrmse, record.n_samples)
        if step is not None:
            simulated = run.simulated[output]
            trial.moved[output] = step.moved(simulated)
            deviation, n_inside = step.error(record[output], simulated), step.inside.stop - step.inside.start
            trial.add(Column("step_rmse", output, floor.unit), deviation, step.floor(floor.std), n_inside)
    return trial


def _score_response(
    trial: _Trial,
    simulated: Record,
    path: SignalPath,
    measured: FrequencyResponse,
    floor: ResponseError | None,
    method: Method,
) -> None:
    columns = (
        Column("magnitude_rmse", path.name, measured.unit),
        Column("phase_rmse", path.name, "rad"),
        Column("magnitude_db", path.name, "dB"),
    )
    try:
        own = simulated_response(simulated, path, method, measured)
        error = response_error(measured, own)
    except InputError as problem:
        trial.failures += [Failure(trial.model, trial.record, str(problem), column) for column in columns]
        return
    trial.responses[path.name] = without_shares(own)
    floors = (None, None, None) if floor is None else (floor.magnitude, floor.phase, floor.decibel)
    for column, value, least in zip(
        columns, (error.magnitude, error.phase, error.decibel), floors, strict=True
    ):
        trial.add(column, value, least, error.n_lines)
    if error.n_lines < _FEWER * measured.omega.size:
        trial.notes.append(
            f"{trial.model}: {path.name} is compared at {error.n_lines} of {measured.omega.size} lines; at the others the "
            f"simulated source is zero."
        )


@dataclass(frozen=True, eq=False)
class FreeRun:
    """A model on a record."""

    simulated: Record  # the whole record with simulated outputs, from the estimated first state
    # True if the initial states were fitted; False where the fixed steps of a fit cannot follow the model, so
    # that the states are those guessed from the first samples.
    estimated: bool
    # Output -> RMS(measured - simulated) / RMS(measured - mean), over all windows, each from its own state.
    nrmse: dict[str, float]
    residuals: dict[str, Floats]  # output -> measured - simulated of all windows, shape (n_samples,)


def free_run(
    model: Model, record: Record, windows: Sequence[Record], output_noise: Mapping[str, float]
) -> FreeRun:
    """Simulate a record and score it."""
    structure, rig = model.structure, model.structure.rig
    scales = characteristic_scales(rig, windows, model.values)
    found = GreyBoxFit(structure, windows, scales, output_noise, _STATE_ACCURACY).fit(
        model.values, [], max_evaluations=_EVALUATIONS, tolerance=_TOLERANCE, finish=False
    )
    states = found.rig_states

    def run(window: Record, index: int) -> Record:
        ran = simulate(structure, model.values, window, states[index])
        return ran.with_signals(**{name: ran[name] + own for name, own in found.offsets(index).items()})

    runs = [run(window, index) for index, window in enumerate(windows)]
    whole = runs[0] if len(windows) == 1 else run(record, 0)
    errors, residuals = {}, {}
    for signal in rig.outputs:
        if signal.name in record:
            measured, simulated = (np.concatenate([r[signal.name] for r in part]) for part in (windows, runs))
            if not np.all(np.isfinite(simulated)):
                raise SimulationError(f"The simulated {signal.name} diverges.")
            residuals[signal.name] = measured - simulated
            errors[signal.name] = nrmse(residuals[signal.name], measured)
    return FreeRun(whole, bool(np.isfinite(found.cost)), errors, residuals)

"""Make campaigns and models without files: of records and values in memory, an example, and of a rig without records yet.

Without records, a sweep through the natural frequencies of the rig is simulated.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import get_args

import numpy as np

from rigsight.campaign import Campaign
from rigsight.effects import Effect, effect_named
from rigsight.errors import InputError, SimulationError, check_option
from rigsight.excitation import linear_sweep, log_sweep
from rigsight.parameters import complete_values
from rigsight.records import Hold, Record, Role, is_constant
from rigsight.rigs import RIGS, Rig, read_rig_file, rig_of_tables, rotational
from rigsight.simulate import Model, compose, simulate
from rigsight.simulate.linearization import linearize
from rigsight.workflow.campaign.campaign_file import Offsets, Where, checked_numbers, checked_simulation
from rigsight.workflow.campaign.read_campaign import campaign_of_records, check_roles, read_campaign
from rigsight.workflow.campaign.record_notes import in_units_of, rig_in_units_of
from rigsight.workflow.own.own_effects import effects_on

_EXAMPLE_GIVEN = {"m": 2.0, "d": 5.0, "k": 800.0}
_K_3 = 5e6
"""Cubic stiffness that is missing in the given simulation [N/m^3]."""
_EXAMPLE_NOISE = 2e-5
"""Standard deviation of the sensor noise [m]."""
_EXAMPLE_DT = 5e-3
_EXAMPLE_BAND = (3.0, 60.0)
"""First and last angular frequency of the sweeps [rad/s]."""
_EXAMPLE_SAMPLES = 2000
_EXAMPLE_REST = 200
"""Samples of rest before the sweep, which show only noise."""
_BELOW, _ABOVE = 0.2, 5.0
"""Ends of the sweep in units of the lowest and of the highest natural frequency."""
_WIDEST = 1e3
"""Ratio of these ends at most."""
_ASIDE = 0.8
"""Ratio of the frequencies of two inputs, so that each moves the rig in its own way."""
_SAMPLES, _PER_PERIOD = 20000, 12.0
_RELATIVE_NOISE = 1e-3
"""Noise of each reading over its standard deviation: that of a good sensor."""


def make_campaign(
    rig: str | Rig,
    records: Sequence[Record],
    *,
    constants: Mapping[str, float] | None = None,
    parameters: Mapping[str, float] | None = None,
    effects: Sequence[str | Effect] = (),
    title: str = "",
    offsets: Offsets = "shared",
) -> Campaign:
    """Make a campaign of records in memory.

    Parameters
    ----------
    rig
        Name of a built-in rig (``rigsight rigs`` lists them), or a rig of your own.
    records
        With distinct names; each holds the inputs and outputs of the rig, in SI units where its `units` state no other: those are
        converted, with a note. Outputs may be missing, all but the first of ``"running_gear"``, ``"axis"`` and ``"element"``, all
        but one of others. Roles say which may be fitted.
    constants
        Known numbers of the rig by name [SI].
    parameters
        Parameter values of the given simulation [SI]; missing ones are identified from the records.
    effects
        Effects that this simulation has already, by name or as declarations.
    title
        What a report calls the campaign; by default the name of the rig.
    offsets
        ``"per_record"`` if each sensor has its own offset in each record: it is estimated and not part of the model.

    Raises
    ------
    InputError
        Naming the value, effect, record or signal that cannot be used, and what is allowed.

    Examples
    --------
    >>> import numpy as np
    >>> import rigsight as rs
    >>> u = np.sin(np.linspace(0.0, 60.0, 1000) ** 1.5)
    >>> record = rs.Record("sweep", dt=0.01, signals={"u": u, "x": 0.01 * u}, units={"u": "N", "x": "m"})
    >>> campaign = rs.make_campaign("axis", [record], parameters={"k": 100.0})
    >>> campaign.rig.name, campaign.parameters, len(campaign.estimation)
    ('axis', {'k': 100.0}, 1)
    """
    found = rig_in_units_of(rig_of(rig), records)
    called = title or found.name
    by_record = set.intersection(*(set(record.constants) for record in records)) if records else set()
    modelled = effects_on(found, effects_of(effects), called)
    known, given = checked_simulation(
        Where(called), found, modelled, constants or {}, parameters or {}, by_record
    )
    check_roles(Where(called), records)
    taken = [record.name for record in records]
    twice = sorted({name for name in taken if taken.count(name) > 1})
    if twice:
        raise InputError(
            f"{called}: records: several have the name '{twice[0]}'. Give every record a different name."
        )
    check_option("offsets", offsets, get_args(Offsets))
    checked = [_checked(called, record, found) for record in records]
    return campaign_of_records(called, found, known, given, checked, modelled, offsets)


def campaign_of(
    campaign: Campaign | Sequence[Record] | str | Path,
    own_effects: Iterable[Effect] = (),
    rig: str | Rig | None = None,
) -> Campaign:
    """Return a campaign of a rig that may be given: as given, read from its file or folder, or made from records of the rig."""
    found = None if rig is None else rig_of(rig)
    if isinstance(campaign, Sequence) and not isinstance(campaign, str):
        if found is None:
            raise InputError(
                "The rig of the records is not given: name it, for instance rs.Diagnoser(rig=...), or make a campaign with "
                "rs.make_campaign(rig, records)."
            )
        return make_campaign(found, campaign)
    own_rigs = () if found is None or found.name in RIGS else (found,)
    read = campaign if isinstance(campaign, Campaign) else read_campaign(campaign, own_effects, own_rigs)
    if found is None or read.rig in (found, rotational(found)) or read.rig.mechanism == found.mechanism:
        return read
    raise InputError(
        f"The campaign '{read.title}' is of the rig '{read.rig.name}', but the estimator has rig='{found.name}'. Leave rig "
        "out, or give records of that rig."
    )


def make_model(
    rig: str | Rig, values: Mapping[str, float], effects: Sequence[str | Effect] = (), hold: Hold = "foh"
) -> Model:
    """Make a model from values in memory.

    Parameters
    ----------
    rig
        Name of a built-in rig (``rigsight rigs`` lists them), or a rig of your own.
    values
        Constants of the rig, its parameters and those of the effects, by name [SI]; one with a default may be missing.
    effects
        Effects of the model, by name or as declarations.
    hold
        How its input behaves between samples.

    Raises
    ------
    InputError
        Naming what is unknown, missing or out of range, and what is allowed.

    Examples
    --------
    >>> import rigsight as rs
    >>> model = rs.make_model("axis", {"m": 2.0, "d": 5.0, "k": 800.0, "k_3": 5e6}, ["cubic_stiffness"])
    >>> model.to_json()["effect_parameters"]
    {'k_3': 5000000.0}
    """
    found = rig_of(rig)
    structure = compose(found, effects_on(found, effects_of(effects), found.name))
    return Model(structure, complete_values(structure.parameters, values), hold)


def rig_of(rig: str | Rig) -> Rig:
    """Return a rig that was given by the name of a built-in one, or as it is."""
    if isinstance(rig, str):
        return RIGS[check_option("The rig", rig, RIGS)]
    # A rig with the same declaration is reused if there is one, so that its equations are derived only once.
    return rig_of_tables(rig.declaration, f"Rig '{rig.name}'") if rig.declaration else rig


def effects_of(effects: str | Effect | Sequence[str | Effect]) -> tuple[Effect, ...]:
    """Return effects that were given by name or as declarations."""
    # A single string is a sequence of letters too.
    given = (effects,) if isinstance(effects, str | Effect) else effects
    return tuple(effect if isinstance(effect, Effect) else effect_named(effect) for effect in given)


def _checked(called: str, record: Record, rig: Rig) -> Record:
    """Return a record in the units of its rig."""
    outputs = rig.required_outputs or tuple(s.name for s in rig.outputs if s.name in record)
    if not outputs:
        listed = ", ".join(signal.name for signal in rig.outputs)
        raise InputError(f"Record '{record.name}' has none of the outputs {listed}; give at least one.")
    inputs = [signal.name for signal in rig.inputs]
    must_move = {name: "input" for name in rig.moving_inputs if record.role == "estimation"}
    may_rest = (record.kind == "operation" and record.amplitude is None) or (
        record.kind == "step" and any(record[name][0] != 0.0 for name in inputs)
    )
    if record.role == "estimation" and not may_rest and all(is_constant(record[name]) for name in inputs):
        must_move |= dict.fromkeys(inputs, "input")
    if rig.required_outputs or all(is_constant(record[name]) for name in outputs):
        must_move |= dict.fromkeys(outputs, "output")
    for name in (*inputs, *outputs):
        if is_constant(record[name]) and name in must_move:
            raise InputError(
                f"Record '{record.name}': the {must_move[name]} {name} never changes ({record[name][0]:g}), so nothing can "
                "be identified from it. Check the signal, or leave the record out. For a record of free motion, set kind = "
                '"operation" and give no amplitude.'
            )
    checked_numbers(
        Where(f"{called}: record '{record.name}'"), ("constants",), rig.name, rig.constants, record.constants
    )
    return in_units_of(rig, record)


def example_campaign(seed: int = 0) -> Campaign:
    """Return two sweeps of a simulated stage, an axis with a hardening spring, and a simulation without the hardening.

    The stage obeys ``m x'' + d x' + k x + k_3 x^3 = u`` with m = 2 kg, d = 5 N s/m, k = 800 N/m and k_3 = 5e6 N/m^3; its sensor
    has noise of 0.02 mm. The given simulation has the same parameter values and no k_3. One sweep of 4 N is for estimation, one
    of 3 N for validation; each lasts 10 s.

    Parameters
    ----------
    seed
        Seed of the sensor noise.

    Examples
    --------
    >>> import rigsight as rs
    >>> campaign = rs.example_campaign()
    >>> [(record.name, record.role, record.n_samples) for record in campaign.records]
    [('fit', 'estimation', 2000), ('score', 'validation', 2000)]
    """
    rng = np.random.default_rng(seed)
    return make_campaign(
        "axis",
        [_sweep("fit", 4.0, "estimation", rng), _sweep("score", 3.0, "validation", rng)],
        parameters=_EXAMPLE_GIVEN,
        title="Example stage",
    )


def _sweep(name: str, amplitude: float, role: Role, rng: np.random.Generator) -> Record:
    truth = make_model("axis", {**_EXAMPLE_GIVEN, "k_3": _K_3}, ["cubic_stiffness"])
    t = _EXAMPLE_DT * np.arange(_EXAMPLE_SAMPLES, dtype=np.float64)
    u = np.concatenate([np.zeros(_EXAMPLE_REST), linear_sweep(t[_EXAMPLE_REST:], amplitude, *_EXAMPLE_BAND)])
    driven = Record(name, _EXAMPLE_DT, {"u": u}, {"u": "N"}, role=role, kind="sweep", amplitude=amplitude)
    clean = simulate(truth.structure, truth.values, driven)
    return clean.with_signals(x=clean["x"] + rng.normal(scale=_EXAMPLE_NOISE, size=_EXAMPLE_SAMPLES))


def is_rig_file(path: Path) -> bool:
    """Return whether a file declares a rig and is no campaign; what cannot be read is left to who reads the campaign."""
    try:
        tables = tomllib.loads(path.read_text("utf-8-sig"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError):
        return False
    return "sensors" in tables and not {"rig", "records"} & tables.keys()


def campaign_of_rig(path: Path, amplitudes: Mapping[str, float] = MappingProxyType({})) -> Campaign:
    """Return a campaign whose one record, a sweep of amplitudes or 1, is simulated with the numbers of a rig file."""
    rig = read_rig_file(path)
    numbers = {p.name: p.default for p in (*rig.constants, *rig.parameters)}
    values = {name: value for name, value in numbers.items() if value is not None}
    if len(values) < len(numbers):
        missing = ", ".join(name for name in numbers if name not in values)
        raise InputError(
            f"{path}: without records every number needs a value, and these have none: {missing}. Give default = ... in the rig "
            "file, or check a campaign with records."
        )
    if not rig.inputs:
        raise InputError(
            f"{path}: the rig has no input, so nothing moves it without records. Check a campaign."
        )
    try:
        record, low, high = _swept(rig, values, amplitudes)
    except SimulationError as error:
        raise InputError(f"{path}: cannot be simulated with its numbers: {error}") from None
    sizes = ", ".join(f"{amplitudes.get(signal.name, 1.0):.3g} in {signal.name}" for signal in rig.inputs)
    note = (
        f"There are no records: a sweep from {low:.3g} to {high:.3g} rad/s with an amplitude of {sizes} was simulated "
        f"with the numbers of {path.name}, and noise of {_RELATIVE_NOISE:.1%} was added to each reading."
    )
    return Campaign(
        rig.name,
        rig,
        {p.name: values[p.name] for p in rig.constants},
        {p.name: values[p.name] for p in rig.parameters},
        (record,),
        notes=(note,),
    )


def _swept(
    rig: Rig, values: Mapping[str, float], amplitudes: Mapping[str, float]
) -> tuple[Record, float, float]:
    """Return the simulated sweep with noise, and its first and last angular frequency [rad/s]."""
    structure = compose(rig)
    natural = np.abs(linearize(structure, values).poles)
    natural = natural[natural > 1e-6 * np.max(natural, initial=0.0)]
    high = _ABOVE * float(np.max(natural, initial=0.0)) or 1.0
    low = max(_BELOW * float(np.min(natural, initial=high)), high / _WIDEST)
    dt = 2.0 * np.pi / (_PER_PERIOD * high)
    t = np.asarray(dt * np.arange(_SAMPLES), dtype=np.float64)
    inputs = {
        signal.name: log_sweep(t, amplitudes.get(signal.name, 1.0), _ASIDE**i * low, _ASIDE**i * high)
        for i, signal in enumerate(rig.inputs)
    }
    run = simulate(structure, values, Record("simulated sweep", dt, inputs, rig.signal_units, kind="sweep"))
    rng = np.random.default_rng(0)
    noisy = {
        s.name: run[s.name] + _RELATIVE_NOISE * np.std(run[s.name]) * rng.standard_normal(t.size)
        for s in rig.outputs
    }
    return run.with_signals(**noisy), low, high

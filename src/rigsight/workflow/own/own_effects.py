"""Load a user's own effects from Python files and installed packages, find what a name means, and write such a file.

A file is executed, as code that the user chose to run; every `Effect` at its top level is taken.
"""

from __future__ import annotations

import ast
import importlib.metadata
import json
import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from pathlib import Path

from rigsight.campaign import Campaign
from rigsight.diagnose.fit_context import candidates_on
from rigsight.effects import AT, CATALOGUE, Effect, effect_named, kind_of, placed
from rigsight.effects.effect import PARTS
from rigsight.errors import InputError, nearest
from rigsight.libraries.templates import filled, template_parts
from rigsight.parameters import Parameter
from rigsight.rigs import Rig
from rigsight.simulate.printing.notation import text
from rigsight.workflow.own.effect_declaration import declaration_faults
from rigsight.workflow.own.own_rigs import run_python_file
from rigsight.workflow.run.progress import Listener, Stage, silent

ENTRY_POINTS = "rigsight.effects"
"""Entry point group of packages that bring effects; each entry is an `Effect` or a tuple of them."""
CHECKING = "Checking own effects"
_LONGEST_EQUATION = 160
_NAME = re.compile(r"(?<![\w.])[A-Za-z_]\w*")
_Declared = tuple[Effect, str]
"""An effect that is not in the catalogue, and the place of its declaration for messages."""
_MISSING = "--effects expects a Python file. To try only one effect of the catalogue, use --effect NAME."


def own_effects(
    files: Iterable[str | Path] = (), *, check: bool = True, listener: Listener = silent
) -> tuple[Effect, ...]:
    """Return the effects of installed packages and of Python files.

    Parameters
    ----------
    files
        Python files that declare effects.
    check
        Simulate and fit each of them, with the checks of the catalogue's effects; False if a fitted model is only to be
        simulated.
    listener
        Told of every checked effect.

    Raises
    ------
    InputError
        Naming file and line, if a file cannot be run, declares no effect or a name twice, or an effect fails a check.
    """
    distinct = {Path(file).resolve(): Path(file) for file in files}.values()
    listed = [*_installed(), *(own for path in distinct for own in _loaded(path))]
    if not listed:
        return ()
    # Not above: without effects of one's own, benches that check them would be loaded for nothing.
    from rigsight.discover.terms import known_terms
    from rigsight.workflow.own.effect_checks import failed_checks

    found: list[_Declared] = []
    taken = {effect.name: "the catalogue" for effect in known_terms().values()}
    for effect, declared in listed:
        if any(effect is other for other, _ in found):
            continue
        _refuse(effect, declared, declaration_faults(effect))
        if effect.name in taken:
            raise InputError(
                f"{declared}: the effect name '{effect.name}' is used by {taken[effect.name]}; choose another."
            )
        taken[effect.name] = declared
        found.append((effect, declared))
    stage = Stage(CHECKING, len(found), listener)
    for effect, declared in found:
        for parent in effect.parents:
            if parent not in taken:
                raise InputError(
                    f"{declared}: effect '{effect.name}' starts from '{parent}', which is not a known effect."
                )
        if check:
            _refuse(effect, declared, failed_checks(effect))
            stage.finished(effect.name)
    return tuple(effect for effect, _ in found)


def named(names: Sequence[str], own: Sequence[Effect]) -> tuple[Effect, ...]:
    """Return the effects of the catalogue and `own` with these names; all of them if no name is given."""
    # A name may say where the effect acts, ``coulomb_friction@shaft``; whether the rig has this place is checked later.
    known = (*CATALOGUE, *own)
    return tuple(effect_named(name, known) for name in dict.fromkeys(names)) or known


def equation_text(effect: Effect) -> str:
    """Return the equation of an effect in one line of plain text, shortened if it is long."""
    lines = [PARTS[part].text.format(text(expression, {})) for part, expression in effect.equations.items()]
    for state in effect.states:
        limit = "" if state.limit is None else f" within +-{text(state.limit, {})}"
        lines.append(f"{state.symbol}' = {text(state.rate, {})}{limit}")
    return textwrap.shorten(", ".join(lines).replace("*", " "), _LONGEST_EQUATION, placeholder=" ...")


def _refuse(effect: Effect, declared: str, faults: Sequence[str]) -> None:
    """Refuse an effect with faults."""
    if faults:
        start = f"{declared}: effect '{effect.name}': "
        raise InputError("\n".join(f"{start}{fault}" for fault in faults[:5]))


def _loaded(path: Path) -> list[_Declared]:
    """Run a Python file and return the effects that it declares, in the order of declaration."""
    module, tree = run_python_file(path, "the Python file with the effects", _MISSING)
    lines_of = _assignments(tree)
    declared = [
        (value, f"{path.name}, line {lines_of[name]}" if name in lines_of else path.name)
        for name, value in vars(module).items()
        if isinstance(value, Effect) and not any(value is effect for effect in CATALOGUE)
    ]
    if not declared:
        raise InputError(
            f"{path.name}: declares no effect. Declare at least one: MY_EFFECT = Effect(name=..., ...) at the top level."
        )
    return declared


def _assignments(tree: ast.Module) -> dict[str, int]:
    """Return the line of the last assignment to each name of the top level."""
    lines = {}
    for statement in tree.body:
        targets: list[ast.expr] = []
        if isinstance(statement, ast.Assign):
            targets = statement.targets
        elif isinstance(statement, ast.AnnAssign):
            targets = [statement.target]
        for target in targets:
            for node in ast.walk(target):
                if isinstance(node, ast.Name):
                    lines[node.id] = statement.lineno
    return lines


def _installed() -> list[_Declared]:
    """Return the effects of installed packages."""
    found = []
    for entry in importlib.metadata.entry_points(group=ENTRY_POINTS):
        package = entry.dist.name if entry.dist is not None else "an installed package"
        declared = f"{package} (entry point {entry.name})"
        try:
            loaded = entry.load()
        except Exception as error:
            raise InputError(
                f"{declared}: cannot be loaded: {type(error).__name__}: {error}. Fix or uninstall the package."
            ) from None
        effects = loaded if isinstance(loaded, tuple | list) else (loaded,)
        for effect in effects:
            if not isinstance(effect, Effect):
                raise InputError(
                    f"{declared}: is a {type(effect).__name__}, not an Effect. Fix or uninstall the package."
                )
            found.append((effect, declared))
    return found


def effects_on(rig: Rig, effects: Iterable[Effect], where: str) -> tuple[Effect, ...]:
    """Return declared effects as they act on a rig."""
    catalogue = {effect.name: effect for effect in CATALOGUE}
    found = []
    for effect in effects:
        kind = kind_of(effect.name)
        if effect.at is not None and kind not in catalogue:
            _check_place(rig, effect, effect.at, where)
            found.append(effect)
        else:
            known = {kind: effect} if effect.at is None else catalogue
            found.append(effect_on(rig, effect.name, known, where))
    return tuple(found)


def effect_on(rig: Rig, name: str, known: Mapping[str, Effect], where: str) -> Effect:
    """Return the effect that a name means on a rig."""
    kind, place = kind_of(name), name.partition(AT)[2]
    if kind not in known:
        raise InputError(f"{where}: '{kind}' is unknown.{nearest(kind, known)} Known: {', '.join(known)}.")
    effect = known[kind]
    if AT in name:
        _check_place(rig, effect, place, where)
        # On a rig of one motion, results name an effect without its place.
        is_usual = rig.has_one_motion and place == rig.acts_at(effect)
        return effect if is_usual else placed(effect, place)
    if rig.has_one_motion:
        return effect
    at_places = [placed(effect, one) for one in rig.places(effect.place)]
    offered = [one for one in at_places if rig.offers(one)]
    if len(offered) > 1:
        listed = ", ".join(one.name for one in offered)
        raise InputError(f"{where}: '{kind}' can act at several places of {rig.name}; name one: {listed}.")
    # If it applies nowhere, the composition raises the error.
    return offered[0] if offered else effect


def _check_place(rig: Rig, effect: Effect, place: str, where: str) -> None:
    places = rig.places(effect.place)
    if place not in places:
        listed = ", ".join(places) or "none"
        raise InputError(
            f"{where}: '{kind_of(effect.name)}{AT}{place}': {rig.name} has no such place for it.{nearest(place, places)} "
            f"Its places: {listed}."
        )


def candidates_of(campaign: Campaign, effects: Sequence[Effect]) -> list[Effect]:
    """Return the candidates at every place of a campaign's rig."""
    # An effect without a place is skipped if it does not apply; a place that was named must exist.
    named = [effect for effect in effects if effect.at is None] + [
        *effects_on(campaign.rig, [effect for effect in effects if effect.at is not None], "The candidates")
    ]
    found = candidates_on(campaign.rig, named, campaign.modelled)
    modelled = {kind_of(effect.name) for effect in campaign.modelled}
    if named and not found and not any(kind_of(effect.name) in modelled for effect in named):
        listed = ", ".join(f"'{effect.name}'" for effect in named)
        raise InputError(
            f"The candidates: {listed} cannot act on {campaign.rig.name}. "
            "'rigsight effects' lists all with their kind of place."
        )
    return found


def effect_file(about: str, effects: Mapping[str, Effect]) -> str:
    """Return the text of a Python file that declares forces at joints: as Python text -> the effect that resists with each."""
    parts = template_parts("workflow", "effects.py.txt")
    numbers = list(dict.fromkeys(p.name for effect in effects.values() for p in effect.parameters))
    read = {name for force in effects for name in _NAME.findall(force)} - {*numbers}
    head = {"ABOUT": about, "READ": ", ".join(sorted(read)), "NUMBERS": ", ".join(numbers)}
    head["NAMES"] = " ".join(numbers)
    declared = [filled(parts["EFFECT"], _fragments(force, effect)) for force, effect in effects.items()]
    return "\n".join([filled(parts["HEAD"], head), *declared]) + "\n"


def _fragments(force: str, effect: Effect) -> dict[str, str]:
    return {
        "CONSTANT": effect.name.upper(),
        "NAME": effect.name,
        "SUMMARY": _literal(effect.summary),
        "PARAMETERS": "\n".join(f"        {_declared(p)}," for p in effect.parameters),
        "ENERGY": effect.energy.name,
        "TREND": effect.signature.gain_trend.name,
        "EVEN": str(effect.signature.even_harmonics),
        "TORQUE": force,
    }


def _declared(parameter: Parameter) -> str:
    """Return the call that makes a parameter; what is as usual is left out."""
    usual = Parameter(parameter.name, parameter.description)
    given = {field.name: getattr(parameter, field.name) for field in fields(parameter)}
    said = [f"{name}={_literal(value)}" for name, value in given.items() if value != getattr(usual, name)]
    return f"Parameter({', '.join([_literal(parameter.name), _literal(parameter.description), *said])})"


def _literal(value: object) -> str:
    return json.dumps(value) if isinstance(value, str) else repr(value)

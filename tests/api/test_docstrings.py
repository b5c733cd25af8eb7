"""Is all that is public documented as it is: every parameter, shape, unit, error and source?"""

from __future__ import annotations

import builtins
import inspect
import logging
import re
import types
from collections.abc import Iterator
from dataclasses import is_dataclass
from functools import cached_property
from typing import Any

import pytest

import rigsight as rs
from rigsight import errors

griffe = pytest.importorskip("griffe", reason="griffe, which reads docstrings, is not installed")

ESTIMATORS = ("Diagnoser", "EquationDiscoverer", "LinearIdentifier")
KNOWN_ERRORS = {*vars(errors), *vars(builtins), "NotFittedError"}
# Griffe warns of parameters without a type: ours stand in the signature.
logging.getLogger("griffe").setLevel(logging.ERROR)


def public_callables() -> Iterator[tuple[str, Any]]:
    """Yield every public class and function, with the public methods and properties that rigsight gives the classes."""
    for name in rs.__all__:
        found = getattr(rs, name)
        if inspect.isfunction(found):
            yield name, found
        if inspect.isclass(found):
            yield name, found
            for member in sorted({m for base in found.__mro__ if ours(base) for m in vars(base)}):
                if member.startswith("_"):
                    continue
                held = inspect.getattr_static(found, member)
                if isinstance(held, staticmethod | classmethod):
                    held = held.__func__
                if isinstance(held, types.FunctionType | property | cached_property):
                    yield f"{name}.{member}", held


def ours(base: type) -> bool:
    return base.__module__.startswith("rigsight")


PUBLIC = dict(public_callables())
FUNCTIONS = {name: held for name, held in PUBLIC.items() if inspect.isfunction(held)}
CLASSES = {name: held for name, held in PUBLIC.items() if inspect.isclass(held)}


def sections(held: Any) -> dict[str, Any]:
    """Return the sections of a docstring, with the texts of the unnamed ones joined."""
    parsed = griffe.Docstring(inspect.getdoc(held) or "").parse("numpy")
    found: dict[str, Any] = {}
    for section in parsed:
        kind = section.kind.value
        found[kind] = f"{found.get(kind, '')}{section.value}" if kind == "text" else section.value
    return found


def documented(held: Any, kind: str) -> dict[str, str]:
    """Return name -> description of the entries of a section."""
    return {
        name.strip(): entry.description
        for entry in sections(held).get(kind, ())
        for name in entry.name.split(",")
    }


def signature_of(held: Any) -> dict[str, inspect.Parameter]:
    """Return the parameters that a caller gives."""
    found = inspect.signature(held).parameters
    stars = {inspect.Parameter.VAR_POSITIONAL: "*", inspect.Parameter.VAR_KEYWORD: "**"}
    return {
        f"{stars.get(parameter.kind, '')}{name}": parameter
        for name, parameter in found.items()
        if name not in ("self", "cls")
    }


def fields_of(held: type) -> dict[str, str]:
    """Return what the class documents, with what its parents in rigsight do."""
    found: dict[str, str] = {}
    for base in reversed([base for base in held.__mro__ if ours(base)]):
        if base.__doc__ and not base.__doc__.startswith(f"{base.__name__}("):
            found |= documented(types.SimpleNamespace(__doc__=base.__doc__), "attributes")
            found |= documented(types.SimpleNamespace(__doc__=base.__doc__), "parameters")
    return found


def test_there_is_something_to_check() -> None:
    assert len(FUNCTIONS) > 30
    assert len(CLASSES) > 12


@pytest.mark.parametrize("name", PUBLIC)
def test_it_says_what_it_is(name: str) -> None:
    text = sections(PUBLIC[name]).get("text", "")
    assert text.strip(), f"{name} has no docstring"
    assert text.strip().splitlines()[0].rstrip().endswith((".", "?", ":")) or "\n" in text


@pytest.mark.parametrize("name", FUNCTIONS)
def test_documented_parameters_are_those_of_the_signature(name: str) -> None:
    reported = documented(FUNCTIONS[name], "parameters")
    assert list(reported) == list(signature_of(FUNCTIONS[name]))
    assert all(reported.values())


@pytest.mark.parametrize("name", CLASSES)
def test_a_class_documents_what_it_is_made_of(name: str) -> None:
    held = CLASSES[name]
    reported = fields_of(held)
    if issubclass(held, Exception):
        return
    assert set(signature_of(held)) <= set(reported)
    annotated = {field for base in held.__mro__ for field in vars(base).get("__annotations__", {})}
    assert set(reported) <= annotated | set(dir(held)) | set(signature_of(held))
    if is_dataclass(held) or name in ESTIMATORS:
        assert all(reported.values())


@pytest.mark.parametrize("name", {**FUNCTIONS, **CLASSES})
def test_everything_is_annotated(name: str) -> None:
    held = PUBLIC[name]
    if inspect.isclass(held) and issubclass(held, Exception):
        return
    for parameter in signature_of(held).values():
        assert parameter.annotation is not inspect.Parameter.empty, parameter
    if not inspect.isclass(held):
        assert inspect.signature(held).return_annotation is not inspect.Signature.empty


@pytest.mark.parametrize("name", {**FUNCTIONS, **CLASSES})
def test_arrays_have_shapes_and_numbers_have_units(name: str) -> None:
    held = PUBLIC[name]
    if inspect.isclass(held) and issubclass(held, Exception):
        return
    reported = fields_of(held) if inspect.isclass(held) else documented(held, "parameters")
    whole = inspect.getdoc(held) or ""
    for parameter, declared in signature_of(held).items():
        annotation = str(declared.annotation)
        if re.search(r"NDArray|ArrayLike", annotation):
            assert "shape" in reported[parameter], f"{name}: {parameter} has no shape"
        if re.fullmatch(r"float( \| None)?", annotation):
            assert re.search(r"\[[^\]]+\]|unit|dimensionless", reported[parameter]), f"{name}: {parameter}"
    if not inspect.isclass(held) and "NDArray" in str(inspect.signature(held).return_annotation):
        assert "shape" in whole


@pytest.mark.parametrize("name", FUNCTIONS)
def test_errors_exist_and_say_when(name: str) -> None:
    for entry in sections(FUNCTIONS[name]).get("raises", ()):
        for error in str(entry.annotation).split(","):
            assert error.strip() in KNOWN_ERRORS
        assert entry.description


@pytest.mark.parametrize("name", [name for name in FUNCTIONS if name.startswith(("read", "make", "compare"))])
def test_what_takes_a_users_data_says_how_it_fails(name: str) -> None:
    assert sections(FUNCTIONS[name]).get("raises")


@pytest.mark.parametrize("name", ESTIMATORS)
def test_an_estimator_names_its_source_and_shows_itself(name: str) -> None:
    text = inspect.getdoc(CLASSES[name]) or ""
    assert "References\n----------" in text
    assert "Examples\n--------" in text
    raised = sections(PUBLIC[f"{name}.fit"]).get("raises", ())
    assert "InputError" in {str(entry.annotation) for entry in raised}


def test_a_wrong_docstring_is_found() -> None:
    def wrong(one: int, two: int) -> None:
        """Do something.

        Parameters
        ----------
        one
            The first.
        """

    assert list(documented(wrong, "parameters")) != list(signature_of(wrong))
    assert list(documented(rs.make_model, "parameters")) == list(signature_of(rs.make_model))

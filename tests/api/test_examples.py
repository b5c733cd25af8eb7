"""Do the examples, those of the docstrings and those of the page on the Python API, say what comes out?"""

from __future__ import annotations

import doctest
import inspect
import re
from pathlib import Path

import pytest

import rigsight as rs

PAGE = Path(__file__).parents[2] / "docs" / "python_api.md"
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def examples() -> dict[str, doctest.DocTest]:
    """Return the examples of everything public, by the name of what they belong to."""
    finder = doctest.DocTestFinder()
    public = {name: getattr(rs, name) for name in rs.__all__}
    found = [
        test
        for name, held in public.items()
        if inspect.isclass(held) or inspect.isfunction(held)
        for test in finder.find(held, name, globs={})
    ]
    return {test.name: test for test in found if test.examples}


EXAMPLES = examples()


def run(test: doctest.DocTest) -> None:
    reported: list[str] = []
    result = doctest.DocTestRunner(optionflags=FLAGS).run(test, out=reported.append)
    assert result.attempted > 0
    assert result.failed == 0, "".join(reported)


def test_the_estimators_and_functions_have_examples() -> None:
    functions = {name for name in rs.__all__ if inspect.isfunction(getattr(rs, name))}
    # Own effects are files: docs/own_effects.md holds their example.
    assert set(EXAMPLES) >= (functions - {"own_effects"}) | {
        "Diagnoser",
        "EquationDiscoverer",
        "LinearIdentifier",
    }


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_says_what_comes_out(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    run(EXAMPLES[name])


@pytest.mark.slow
def test_the_page_says_what_comes_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pandas", reason="pandas, with which the page makes tables, is not installed")
    monkeypatch.chdir(tmp_path)
    # To doctest, the fence after an output would belong to it.
    text = re.sub(r"^```.*$", "", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    run(doctest.DocTestParser().get_doctest(text, {}, PAGE.name, str(PAGE), 0))

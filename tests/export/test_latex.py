"""The exported LaTeX fragment: complete, and accepted by LaTeX."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from rigsight.export.targets import export_model


def text_of(case) -> str:
    text = export_model(case.model, "latex", source="model.json")
    assert isinstance(text, str)
    return text


def test_every_parameter_and_state_is_in_it(case):
    text = text_of(case)
    structure = case.model.structure
    table = text.partition(r"\begin{tabular}")[2]
    assert table.count(r" \\") == len(structure.parameters) + 1
    lefts = [line.partition("&=")[0] for line in text.splitlines()]
    # Two dots stand for two states, a displacement and its rate.
    assert sum("dot{" in left for left in lefts) + sum(r"\ddot{" in left for left in lefts) >= len(
        structure.states
    )
    assert text.count("{") == text.count("}")


def test_values_come_with_units(case_named):
    text = text_of(case_named("cubic_stiffness"))
    assert r"$k_{3}$ & $300000$ & $\mathrm{N\,m/rad^{3}}$ & cubic stiffness \\" in text
    assert r"\psi_{\text{off}}" in text


def test_two_of_one_name_carry_their_effects(case_named):
    text = text_of(case_named("friction twice"))
    assert r"T_{c, \text{coulomb friction}}" in text
    assert r"T_{c, \text{stribeck friction}}" in text


def test_a_delay_stands_at_the_signal(case_named):
    text = text_of(case_named("all delays"))
    assert r"u\left(t - T_{d}\right)" in text


@pytest.mark.skipif(
    shutil.which("pdflatex") is None, reason="pdflatex is not installed (apt-get install texlive-latex-base)"
)
def test_latex_accepts_all_of_them(case_named, case_names, tmp_path: Path):
    body = "\n\\newpage\n".join(text_of(case_named(name)) for name in case_names)
    document = f"\\documentclass{{article}}\n\\usepackage{{amsmath}}\n\\begin{{document}}\n{body}\n\\end{{document}}\n"
    (tmp_path / "all.tex").write_text(document, encoding="utf-8")
    run = subprocess.run(
        ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "all.tex"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stdout[-2000:]

"""How do a model's equations and numbers become a fragment of LaTeX?"""

from __future__ import annotations

import re

import sympy as sp

from rigsight.export.description import made_by
from rigsight.export.equations import Exported, Quantity
from rigsight.simulate.structure import INPUT, INPUT_RATE, TIME

_THIN = r"\,"
_GREEK = re.compile(
    r"^(alpha|beta|gamma|delta|zeta|psi|phi|omega|tau|sigma|rho|mu|nu|kappa|lambda|theta|eta)$"
)


def latex(exported: Exported, source: str) -> str:
    r"""Return equations as an ``align*`` (package amsmath), and a table of symbols, values and units.

    Parameters
    ----------
    exported
        The model.
    source
        The file it comes from.
    """
    writer = _Writer(exported)
    table = [
        f"  {writer.symbols[symbol]} & {_number(value)} & {_unit(q.unit)} & {_text(q.description)} \\\\"
        for symbol, q, value in zip(
            exported.structure.parameter_symbols, exported.parameters, exported.values, strict=True
        )
    ]
    table = [re.sub(r"^  (.*?) & (.*?) & (.*?) &", r"  $\1$ & $\2$ & $\3$ &", row) for row in table]
    lines = [
        f"% {exported.title}. {made_by(source)}.",
        "% For a document that loads amsmath.",
        r"\begin{align*}",
        " \\\\\n".join(f"  {equation}" for equation in writer.equations()),
        r"\end{align*}",
        r"\begin{tabular}{llll}",
        r"  symbol & value & unit & meaning \\ \hline",
        *table,
        r"\end{tabular}",
    ]
    return "\n".join(lines) + "\n"


class _Writer:
    def __init__(self, exported: Exported) -> None:
        self._exported = exported
        structure = exported.structure
        sources = [p.name for p in structure.parameters] + [s.name for s in structure.states]
        letters = [source.rpartition(".")[2] for source in sources]
        self.symbols: dict[sp.Symbol, str] = {
            symbol: _symbol(source, alone=letters.count(source.rpartition(".")[2]) == 1)
            for symbol, source in zip((*structure.parameter_symbols, *structure.states), sources, strict=True)
        }
        if (
            structure.rig.is_driven
            and (shown := _symbol(exported.outputs[0].name)) not in self.symbols.values()
        ):
            # The axis calls its displacement x; only its state has a longer name.
            self.symbols[structure.states[0]] = shown
        source = _symbol(exported.inputs[0].name)
        self.symbols |= {INPUT: source, INPUT_RATE: rf"\dot{{{source}}}", TIME: "t"}
        self._late = structure.delay
        if self._late is not None:
            # What arrives is what was sent a delay ago.
            self.symbols[INPUT] = rf"{source}\left(t - {self.expression(self._late)}\right)"

    def expression(self, expression: sp.Expr) -> str:
        """Return an expression in the symbols of the fragment."""
        return str(sp.latex(expression, symbol_names=self.symbols, full_prec=False))

    def equations(self) -> list[str]:
        """Return the equations of the states, then those of the outputs."""
        structure = self._exported.structure
        lines = []
        for equation in structure.equations:
            state, rate = self.symbols[equation.symbol], self.expression(equation.rate)
            if equation.limit is not None:
                half = self.expression(equation.limit)
                rate = (
                    rf"\begin{{cases}} 0 & \text{{if }} {state} = \pm {half} \text{{ and driven outwards}} \\ "
                    rf"{rate} & \text{{else}} \end{{cases}}"
                )
            lines.append(rf"\dot{{{state}}} &= {rate}")
        if self._exported.frozen.friction_mode is not None:
            velocity = self.symbols[structure.states[structure.velocity_index or 0]]
            lines.append(rf"{velocity} &= 0 \text{{ while dry friction holds}}")
        for i, (output, expression) in enumerate(zip(self._exported.outputs, structure.outputs, strict=True)):
            late = structure.measured_late if i == 0 else None
            if late is None and self.symbols.get(expression) == _symbol(output.name):
                continue
            text = self.expression(expression)
            if late is not None:
                text = rf"{text}\left(t - {self.expression(late)}\right)"
            lines.append(rf"{_symbol(output.name)}_{{\text{{measured}}}} &= {text}" if self._shadowed(output)
                         else rf"{_symbol(output.name)} &= {text}")  # fmt: skip
        return lines

    def _shadowed(self, output: Quantity) -> bool:
        return _symbol(output.name) in self.symbols.values()


def _symbol(source: str, *, alone: bool = True) -> str:
    """Return a declared name as LaTeX: ``k_c``; with its effect below where another has the same."""
    effect, _, own = source.rpartition(".")
    letter, _, below = own.partition("_")
    base = (
        f"\\{letter}" if _GREEK.match(letter) else (letter if len(letter) == 1 else rf"\mathrm{{{letter}}}")
    )
    if match := re.fullmatch(r"([A-Za-z])(\d+)", letter):
        base, below = match[1], ", ".join(filter(None, [match[2], below]))
    words = [] if not below else [_below(below)]
    if effect and not alone:
        words.append(rf"\text{{{_text(effect.replace('_', ' '))}}}")
    return f"{base}_{{{', '.join(words)}}}" if words else base


def _below(text: str) -> str:
    if _GREEK.match(text):
        return f"\\{text}"
    return text if len(text) <= 2 else rf"\text{{{_text(text.replace('_', ' '))}}}"


def _number(value: float) -> str:
    mantissa, _, exponent = f"{value:.6g}".partition("e")
    return mantissa if not exponent else rf"{mantissa} \cdot 10^{{{int(exponent)}}}"


def _unit(unit: str) -> str:
    powers = re.sub(r"\^(-?[0-9]+)", r"^{\1}", _text(unit, math=True))
    return rf"\mathrm{{{powers.replace(' ', _THIN)}}}"


def _text(text: str, *, math: bool = False) -> str:
    """Return text with the characters escaped that LaTeX reads itself."""
    special = r"([&%$#_{}])" if math else r"([&%$#_{}^])"
    return re.sub(special, r"\\\1", text.replace("\\", "/")).replace("\\^", r"\^{}")

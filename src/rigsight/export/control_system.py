"""How does a model become a Python file that defines a python-control system?"""

from __future__ import annotations

import sympy as sp

from rigsight.export.description import header_lines, indented
from rigsight.export.equations import Exported
from rigsight.export.fixed_step import state_at_rest
from rigsight.export.python_function import (
    code_names,
    parameter_entries,
    results,
    sequence,
    unpacked_parameters,
    unpacked_states,
)
from rigsight.libraries.templates import filled, template
from rigsight.simulate.printing.language import PYTHON

_KINKS = (
    "Its equations have kinks, which a variable-step solver does not detect: choose max_step smaller than the time between "
    "them."
)
_SMOOTH = "Its equations are smooth."


def control_system(exported: Exported, source: str, name: str) -> str:
    """Return the text of a Python file that defines ``system``."""
    structure = exported.structure
    inputs = [quantity.name for quantity in exported.inputs]
    unpack = indented(unpacked_parameters(exported, _own_words(exported)))
    return filled(
        template("export", "control.py.txt"),
        {
            "TITLE": exported.title[0].upper() + exported.title[1:],
            "HEADER": "\n".join(header_lines(exported, source)),
            "CALL": inputs[0] if len(inputs) == 1 else f"[{', '.join(inputs)}]",
            "KINKS": _KINKS if exported.frozen.modes else _SMOOTH,
            "PARAMETERS": indented(parameter_entries(exported)),
            "REST": sequence([repr(value) for value in state_at_rest(exported)]),
            "UNPACK_PARAMETERS": unpack,
            "UNPACK_INPUT": _unpacked_input(exported),
            "RATES": _array(exported, [equation.limited_rate for equation in structure.equations]),
            "OUTPUTS": _array(exported, list(structure.outputs)),
            "INPUTS": ", ".join(map(repr, inputs)),
            "OUTPUT_NAMES": ", ".join(repr(output.name) for output in exported.outputs),
            "STATES": ", ".join(repr(state.name) for state in exported.states),
            "NAME": repr(name),
        },
    )


def _unpacked_input(exported: Exported) -> str:
    """Return the statement that sorts what is given into inputs and rates of prescribed motions."""
    places = iter(range(len(exported.inputs)))
    values, rates = [], []
    for source in exported.sources:
        values.append(f"given[{next(places)}]")
        rates.append("0.0" if source.rate is None else f"given[{next(places)}]")
    return f"input_value, input_rate = ({sequence(values)}), ({sequence(rates)})"


def _array(exported: Exported, expressions: list[sp.Expr]) -> str:
    targets, own = results(len(expressions)), _own_words(exported)
    lines = PYTHON.statements(targets, expressions, code_names(exported, own), exported.structure.steps)
    return indented([*unpacked_states(exported, own), *lines, f"return np.array([{', '.join(targets)}])"])


def _own_words(exported: Exported) -> frozenset[str]:
    """Return what the template calls its own where parameters and states stand, beside what no name in any export is."""
    count = max(len(exported.states), len(exported.outputs))
    return frozenset({"PARAMETERS", "params", *results(count)})

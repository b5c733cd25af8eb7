"""Names and texts that are safe in every target."""

from __future__ import annotations

import re
from importlib.resources import files

import pytest
import sympy as sp

from rigsight.effects.effect import Effect, Energy, GainTrend, Place, Signature
from rigsight.effects.symbols import v, x
from rigsight.export import TARGETS
from rigsight.export.equations import exported
from rigsight.export.targets import RESERVED, export_model
from rigsight.libraries.templates import template
from rigsight.parameters import Parameter
from rigsight.rigs import AXIS
from rigsight.simulate import compose
from rigsight.simulate.compiled.kernel_source import ACCURATE
from rigsight.simulate.model import Model


def own_effect(names: list[str], description: str) -> Effect:
    """A damper and springs whose parameters are called as a user pleases."""
    symbols = [sp.Symbol(name, real=True) for name in names]
    return Effect(
        name="my_own",
        place=Place.DYNAMICS,
        summary="Words of other languages as names.",
        parameters=tuple(Parameter(name, description, "force x^-1", null=0.0) for name in names),
        energy=Energy.ACTIVE,
        signature=Signature(gain_trend=GainTrend.STEADY),
        torque=sum((symbol * x for symbol in symbols), start=sp.Integer(0)) + 0.1 * sp.Abs(v) * v,
    )


def own_model(names: list[str], description: str = "stiffness") -> Model:
    structure = compose(AXIS, [own_effect(names, description)])
    values = {"gain": 1.0, "m": 1.0, "d": 0.6, "k": 100.0, "x_off": 0.0, "force_off": 0.0}
    return Model(structure, {**values, **dict.fromkeys(names, 2.0)}, "foh")


def test_names_are_words_that_no_language_has_and_occur_once():
    content = exported(
        own_model(["lambda", "model", "part0", "end", "u", "x_position", "double"]), "foh", 0.01, RESERVED
    )
    names = [q.name for q in (*content.parameters, *content.states, *content.inputs)]
    assert len(set(names)) == len(names)
    assert not RESERVED.intersection(names)
    assert all(name.isidentifier() for name in names)


def test_no_name_is_a_macro_of_the_c_text():
    kernel = [template("simulate", name) for name in ("equations.c.txt", *ACCURATE)]
    own = [
        files("rigsight.export").joinpath("templates", f"{name}.c.txt").read_text("utf-8")
        for name in ("model", "fmi", "fmi2", "fmi3")
    ]
    # Macros with arguments are not those of a name without.
    macros = re.findall(r"^#define (\w+)(?!\w|\()", "\n".join([*kernel, *own]), re.MULTILINE)
    assert len(macros) > 20
    assert set(macros) <= RESERVED


@pytest.mark.parametrize("target", [name for name in TARGETS if not name.startswith("fmu")])
def test_a_description_ends_no_comment_and_no_string(target: str):
    text = export_model(
        own_model(["stiff"], 'a "b" */ c\n \\" """ d'), target, source='x"""*/\n\\y/model.json', name="rig"
    )
    assert isinstance(text, str)
    if TARGETS[target].suffix == ".py":
        compile(text, "exported.py", "exec")
    assert '"b"' not in text
    assert "*/ c" not in text
    assert "*/\n\\y" not in text


def test_an_effect_of_one_s_own_with_words_of_c_moves_as_in_the_engine():
    import numpy as np

    from rigsight.excitation import linear_sweep
    from rigsight.records import Record
    from rigsight.simulate import simulate

    model = own_model(["lambda", "model", "u"])
    t = 0.01 * np.arange(100)
    u = linear_sweep(t, 1.0, 3.0, 40.0)
    truth = simulate(
        model.structure,
        model.values,
        Record(name="r", dt=0.01, signals={"u": u}, units={"u": "N"}),
        accuracy=1e-9,
    )
    space: dict = {}
    exec(str(export_model(model, "python", source="model.json")), space)
    np.testing.assert_allclose(
        space["simulate"](t, u)["x"], truth["x"], rtol=0, atol=1e-6 * np.std(truth["x"])
    )

"""Parameters of one motion from its PT2, of the state that follows it from its PT1, and the forms that parameters give."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from scipy.stats import norm

from rigsight.effects.symbols import derivative
from rigsight.errors import InputError
from rigsight.identify.fit.covariance import LEVEL, propagated_covariance
from rigsight.identify.transfer.transfer_form import Order, TransferFit, TransferForm
from rigsight.rigs import Rig, evaluated


@dataclass(frozen=True, eq=False)
class PhysicalEstimates:
    """Physical parameters with their joint uncertainty."""

    names: tuple[str, ...]  # in the order of `covariance`
    values: dict[str, float]  # in SI units
    covariance: NDArray[np.float64]  # shape (n_parameters, n_parameters)
    method: str  # equations and records from which they were computed
    positive: frozenset[str] = frozenset()  # names of those that are positive by definition

    @property
    def standard_errors(self) -> dict[str, float]:
        """Standard error by name; infinite if the records do not determine the parameter."""
        return dict(zip(self.names, map(float, np.sqrt(np.diag(self.covariance))), strict=True))

    def interval(self, name: str, level: float = LEVEL) -> tuple[float, float]:
        """Return the confidence interval of a parameter, symmetric in the logarithm if it is positive by definition."""
        value, error = self.values[name], self.standard_errors[name]
        width = float(norm.ppf(0.5 + 0.5 * level))
        if not math.isfinite(error):
            return (0.0 if name in self.positive else -math.inf), math.inf
        if name in self.positive:
            factor = math.exp(min(width * error / value, 700.0))
            return value / factor, value * factor
        return value - width * error, value + width * error

    def only(self, names: frozenset[str]) -> PhysicalEstimates | None:
        """Return the estimates of some parameters; None if not all of them are among these."""
        kept = [name for name in self.names if name in names]
        if not kept or len(kept) < len(names):
            return None
        rows = [self.names.index(name) for name in kept]
        values = {name: self.values[name] for name in kept}
        return PhysicalEstimates(
            tuple(kept), values, self.covariance[np.ix_(rows, rows)], self.method, self.positive
        )


def expressions_of_form(rig: Rig, order: Order) -> dict[str, sp.Expr]:
    """Return gain, break frequency and, of a PT2, damping ratio that the equations of a rig of one motion give."""
    # A PT2 leads from its input to its motion (thesis, 2.21), a PT1 from there to the state that follows (2.24). The place of the
    # velocity v is that of the lateral equation; in (2.25) it is on the wrong side, which has no effect for v = 1 m/s.
    if order == "pt1":
        assert rig.follower is not None
        return {"gain": rig.follower.static_gain, "omega_b": rig.follower.gain * rig.follower.feedback}
    motion = rig.motion
    assert motion.inertia is not None
    return {
        "gain": motion.drive_gain / motion.stiffness,
        "omega_b": sp.sqrt(motion.stiffness / motion.inertia),
        "zeta": motion.damping / (2 * sp.sqrt(motion.stiffness * motion.inertia)),
    }


def parameters_of_form(rig: Rig, order: Order) -> frozenset[str]:
    """Return the names of the parameters of the rig in a form."""
    own = {p.name for p in rig.parameters}
    read = {s.name for part in expressions_of_form(rig, order).values() for s in part.free_symbols}
    return frozenset(own & read)


def form_gives_parameters(rig: Rig, order: Order) -> bool:
    """Return True if gain, break frequency and damping ratio have one further unknown parameter each, in this order."""
    unknown = parameters_of_form(rig, order)
    for expression in expressions_of_form(rig, order).values():
        own = unknown & {symbol.name for symbol in expression.free_symbols}
        if len(own) != 1:
            return False
        unknown -= own
    return True


def physical_parameters(rig: Rig, fit: TransferFit, constants: Mapping[str, float]) -> PhysicalEstimates:
    """Return the parameters of a rig of one motion that follow from a fitted form.

    Parameters
    ----------
    rig
        One of which `form_gives_parameters` holds.
    fit
        PT2 from the input to the motion, or PT1 from the motion to the follower.
    constants
        The rig's constants by name.

    Raises
    ------
    InputError
        If the gain has the sign that no such rig has.
    """
    forms = expressions_of_form(rig, fit.form.order)
    fitted = {name: sp.Symbol(f"fitted_{name}", positive=name != "gain") for name in forms}
    numbers = {**constants, **{symbol.name: fit.values[name] for name, symbol in fitted.items()}}
    unknown, found = set(parameters_of_form(rig, fit.form.order)), dict[sp.Symbol, sp.Expr]()
    for name, expression in forms.items():
        known = expression.xreplace(found)
        (symbol,) = (s for s in known.free_symbols if s.name in unknown)
        # Of a root of two signs, the last solution is the positive one.
        found[symbol] = sp.solve(known - fitted[name], symbol)[-1]
        unknown.remove(symbol.name)
    values = {symbol.name: evaluated(expression, numbers) for symbol, expression in found.items()}
    if not next(iter(values.values())) > 0.0:
        raise InputError(
            f"The gain of {fit.source} -> {fit.response} is {fit.values['gain']:.4g} {fit.unit}, which no rig with these "
            f"equations has: one of the signals has the opposite sign. Change the sign of that signal."
        )
    chain = [
        [evaluated(derivative(expression, symbol), numbers) for symbol in fitted.values()]
        for expression in found.values()
    ]
    covariance = propagated_covariance(fit.covariance_of(*forms), np.array(chain))
    positive = frozenset(p.name for p in rig.parameters if p.logarithmic)
    return PhysicalEstimates(tuple(values), values, covariance, f"from the {fit.method}", positive)


def form_of(
    rig: Rig,
    order: Order,
    own: PhysicalEstimates,
    constants: Mapping[str, float],
    path: tuple[str, str, str],
) -> TransferFit:
    """Return the form that estimates of all `parameters_of_form` give; the path is source, response, and unit of the gain."""
    forms, numbers = expressions_of_form(rig, order), {**constants, **own.values}
    values = {name: evaluated(expression, numbers) for name, expression in forms.items()}
    chain = [
        [evaluated(derivative(part, sp.Symbol(name, real=True)), numbers) for name in own.names]
        for part in forms.values()
    ]
    covariance = propagated_covariance(own.covariance, np.array(chain))
    errors = dict(zip(forms, map(float, np.sqrt(np.diag(covariance))), strict=True))
    source, response, unit = path
    return TransferFit(
        form=TransferForm(order),
        names=tuple(forms),
        values=values,
        standard_errors=errors,
        covariance=covariance,
        residuals=np.zeros(0),
        misfit=math.nan,
        success=True,
        message="Of the parameters that were fitted over time.",
        source=source,
        response=response,
        unit=unit,
        method=own.method,
    )

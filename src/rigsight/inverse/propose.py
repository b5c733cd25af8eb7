"""The missing force first: which families of effects at which places explain what the equations leave along the measured motion.

The equations of motion are a regression along the motion that the sensors show: their numbers and those of the effects are linear
in it or tried on a grid that becomes finer where it counts, so its optimum is global and nothing is simulated. Families are taken
one by one, the one first that removes most of the residual of stretches that it was not fitted to. It proposes; fits of the
simulation decide.

References
----------
J. Swevers, W. Verdonck and J. De Schutter, IEEE Control Systems 27 (2007) 58, for inverse dynamics as a regression.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rigsight.campaign import Campaign
from rigsight.effects import Effect, Place
from rigsight.effects import symbols as canonical
from rigsight.errors import SimulationError
from rigsight.identify import characteristic_scales
from rigsight.inverse.drive_gain import gains_of_known_scale
from rigsight.inverse.effect_terms import EffectTerms, is_joint_force, is_late, lateness
from rigsight.inverse.equation_fit import (
    EquationFit,
    held_numbers,
    identifiable,
    record_motions,
    undriven_inertias,
    with_all_inputs,
)
from rigsight.inverse.measured_motion import shifted
from rigsight.inverse.missing_force import missing_forces, noise_of_rows
from rigsight.inverse.proposal import Proposal
from rigsight.inverse.selection import Selection
from rigsight.inverse.term import Term
from rigsight.inverse.tone_terms import of_tone
from rigsight.rigs.rig import joint_of
from rigsight.simulate import compose

Floats = NDArray[np.float64]

_HALVINGS = 5
"""Halvings of the grid's step: points of one parameter are then 3 % apart."""
_ROUNDS = 10
"""Rounds of this compass search: parameters that act together need some more moves than halvings."""


def propose(
    campaign: Campaign,
    known: Mapping[str, float],
    effects: Sequence[Effect],
    noise: Mapping[str, float] | None = None,
) -> Proposal | None:
    """Return the families that explain what the equations of a campaign leave of its estimation records.

    None where the sensors do not show the motion, another program simulates the bodies, or the given simulation has an effect
    that is neither a force at a joint nor a delay.

    Parameters
    ----------
    campaign
        Records and rig.
    known
        Constants and parameters of the rig and of the modelled effects; those of the drives set the scale of all forces.
    effects
        Candidates at their places.
    noise
        Standard deviation of the noise of each sensor; it weighs the joints of a rig against each other.
    """
    terms_of = along_motion(campaign, known)
    if terms_of is None:
        return None
    fit, values = terms_of.fit, terms_of.values
    covariance = noise_of_rows(fit, values, noise or {})
    by_noise, variance = None, None
    if covariance is not None:
        variance = np.diag(covariance)
        weight = 1.0 / fit.tolerance(values, variance) ** 2
        by_noise = min(1.0, float(np.sum(variance * weight) / np.sum(fit.rms(values) ** 2 * weight)))
    selection = selection_of(terms_of, effects, variance)
    nothing = Proposal((), (), frozenset(), explained=0.0, by_chance=1.0)
    found = nothing if selection is None else selection.proposal(campaign.rig)
    hidden = frozenset(effect.name for effect in effects if not terms_of.can_show(effect))
    return replace(found, hidden=hidden, noise=by_noise, forces=missing_forces(fit, values, covariance))


def hidden_effects(
    campaign: Campaign, known: Mapping[str, float], effects: Sequence[Effect]
) -> frozenset[str]:
    """Return the names of effects that the motion of the estimation records cannot show, whatever effects are modelled.

    Parameters
    ----------
    campaign
        Records and rig.
    known
        Constants and parameters of the rig.
    effects
        Candidates at their places.
    """
    terms_of = along_motion(replace(campaign, modelled=()), known)
    if terms_of is not None:
        return frozenset(effect.name for effect in effects if not terms_of.can_show(effect))
    # Sensors that lose a sign do not show the motion. Of a position that nothing reads and no force depends on, only changes are
    # known.
    mechanism = campaign.rig.mechanism
    depend = [*(sensor.reads for sensor in mechanism.sensors), *(drive.signal for drive in mechanism.drives)]
    depend += [*mechanism.generalized_forces, *(joint.force for joint in mechanism.joints)]
    depend += [joint.motion for joint in mechanism.joints if joint.stiffness != 0]
    determined = set().union(*(expression.free_symbols for expression in depend))
    return frozenset(
        effect.name
        for effect in effects
        if effect.place is Place.DYNAMICS
        and effect.reads(canonical.x)
        and not effect.states
        and determined.isdisjoint(joint_of(campaign.rig, effect).motion.free_symbols)
    )


def selection_of(
    terms_of: EffectTerms, effects: Sequence[Effect], noise: Floats | None = None
) -> Selection | None:
    """Return the selection among effects; None where no effect is a term.

    Tones stand at the lines of two residuals: that of the equations alone, and that beside the effects selected without tones.

    Parameters
    ----------
    terms_of
        Effects as terms along the motions.
    effects
        Candidates at their places.
    noise
        Variance of each equation by noise of the sensors.
    """
    fit, values = terms_of.fit, terms_of.values
    terms = [term for effect in effects for term in terms_of.of(effect)]
    if not terms:
        return None
    selection = _with_finer_grid(Selection(fit, values, terms, noise), terms_of)
    # Beside a law that imitates a tone, the residual has no line of it.
    beside = dict.fromkeys([(), tuple(selection.columns_of(selection.selected(fit.rig)))])
    residuals = [selection.regression.residuals(columns) for columns in beside]
    tones = {
        (e.name, term.inner[e.pulsation]): term
        for e in effects
        if e.pulsation is not None
        for rows in residuals
        for term in of_tone(e, fit, values, rows)
    }
    return selection.with_terms(list(tones.values()))


def _with_finer_grid(selection: Selection, terms_of: EffectTerms) -> Selection:
    """Return the selection with terms beside the leading ones; the step of one is halved when none beside it is better."""
    halvings: dict[Term, int] = {}
    for _ in range(_ROUNDS):
        finer = []
        for term in selection.leading(terms_of.fit.rig):
            halvings[term] = halved = halvings.get(term, 0) + 1
            if halved <= _HALVINGS:
                near = list(terms_of.beside(term, halved))
                halvings |= dict.fromkeys(near, halved - 1)
                finer += near
        if not finer:
            break
        selection = selection.with_terms(finer)
    return selection


def along_motion(campaign: Campaign, known: Mapping[str, float]) -> EffectTerms | None:
    """Return effects as terms of the equations along the motion of the estimation records; None as for `propose`."""
    rig = campaign.rig
    campaign, known = _in_time(campaign, known)
    if rig.mechanism.bodies is not None or not all(map(is_joint_force, campaign.modelled)):
        return None
    try:
        fit, values = _fitted(campaign, known)
    except SimulationError:
        return None
    own = {p.name: values[p.name] for p in (*rig.constants, *rig.parameters)}
    records = [with_all_inputs(rig, record) for record in campaign.estimation]
    return EffectTerms(fit, values, characteristic_scales(rig, records, own))


def numbers_along_motion(campaign: Campaign, known: Mapping[str, float]) -> dict[str, float] | None:
    """Return the parameters of the rig with the smallest error of the equations along the motion; None as for `propose`.

    Parameters
    ----------
    campaign
        Records and rig.
    known
        Constants and parameters from which the regression starts.
    """
    if campaign.rig.mechanism.bodies is not None or campaign.modelled:
        return None
    try:
        _, values = _fitted(campaign, known)
    except SimulationError:
        return None
    return {p.name: values[p.name] for p in campaign.rig.parameters}


def _in_time(campaign: Campaign, known: Mapping[str, float]) -> tuple[Campaign, Mapping[str, float]]:
    """Return a campaign without its modelled delays and lags, if known, and all numbers: what is late is moved to its time."""
    structure = compose(campaign.rig, campaign.modelled)
    records = campaign.records
    if not all(name in known for name in structure.names):
        return campaign, known
    for effect in filter(is_late, campaign.modelled):
        numbers = {p.name: known[structure.parameter_name(effect, p.name)] for p in effect.parameters}
        place, late = campaign.rig.acts_at(effect), lateness(effect, numbers)
        signals = {place}
        if effect.place is Place.ACTUATOR:
            inputs = {
                drive.name: {symbol.name for symbol in drive.signal.free_symbols}
                for drive in campaign.rig.mechanism.drives
            }
            signals, late = inputs.pop(place), -late
            if any(signals & others for others in inputs.values()):
                return campaign, known  # The other drive is in time.
        moved = [{n: shifted(r[n], r.dt, late) for n in signals if n in r} for r in records]
        records = tuple(r.with_signals(**own) for r, own in zip(records, moved, strict=True))
    kept = tuple(effect for effect in campaign.modelled if not is_late(effect))
    # A number loses the name of its effect where no other one has the same any more.
    fewer = compose(campaign.rig, kept)
    own = {
        fewer.parameter_name(effect, p.name): known[structure.parameter_name(effect, p.name)]
        for effect in kept
        for p in effect.parameters
    }
    return replace(campaign, records=records, modelled=kept), {**known, **own}


def _fitted(campaign: Campaign, known: Mapping[str, float]) -> tuple[EquationFit, dict[str, float]]:
    rig = campaign.rig
    start = {p.name: p.default if p.default is not None else 1.0 for p in rig.parameters}
    start |= {**campaign.constants, **known}
    held = held_numbers(rig) - {name for name in gains_of_known_scale(rig) if start[name] != 0.0}
    held |= {campaign.absent_spring} if campaign.absent_spring else set()
    motions = record_motions(rig, campaign.estimation, start)
    held |= undriven_inertias(motions, start)
    # Of a motion that nothing drives, equations without any force would hold best.
    held |= {campaign.open_factor.held} if campaign.open_factor else set()
    free = identifiable(rig, motions, campaign.modelled, start, held)
    values, _ = EquationFit(rig, motions, campaign.modelled, free, start).settled(start)
    return EquationFit(rig, motions, campaign.modelled, free, values), values

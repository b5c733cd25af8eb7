"""Which effects are fitted after what the motion says of the missing force?"""

from __future__ import annotations

from rigsight.diagnose.search.worth_fitting import worth_fitting
from rigsight.effects import CATALOGUE, Effect, effect_named
from rigsight.inverse import Proposal, ProposedCause, ProposedStart
from rigsight.rigs import AXIS


def cause(name: str, share: float, least: float | None = None) -> ProposedCause:
    effect = effect_named(name)
    interval = (share if least is None else least, 1.0)
    return ProposedCause(effect, effect.family, AXIS.where(effect), share, {}, interval)


def fitted(*alone: ProposedCause, taken: tuple[ProposedCause, ...] = (), by_chance: float = 0.1) -> set[str]:
    effects: list[Effect] = [*CATALOGUE]
    judged = frozenset(e.name for e in effects if not e.states)
    proposal = Proposal(taken or alone[:1], alone, judged, alone[0].share, by_chance)
    return {effect.name for effect in worth_fitting(AXIS, proposal, effects).alone}


def test_families_that_explain_little_beside_the_best_are_not_fitted() -> None:
    kept = fitted(
        cause("coulomb_friction", 0.8), cause("cubic_stiffness", 0.5), cause("quadratic_damping", 0.2)
    )
    assert {"coulomb_friction", "stribeck_friction", "cubic_stiffness"} <= kept
    assert "quadratic_damping" not in kept


def test_what_the_motion_does_not_judge_is_fitted() -> None:
    assert {"sensor_lag", "flexible_mode"} <= fitted(cause("coulomb_friction", 0.8))


def test_a_further_family_that_was_taken_is_fitted() -> None:
    best, second = cause("coulomb_friction", 0.8), cause("quadratic_damping", 0.2)
    assert "quadratic_damping" in fitted(best, second, taken=(best, second))


def test_where_no_family_explains_enough_all_are_fitted() -> None:
    assert len(fitted(cause("coulomb_friction", 0.2))) == len(CATALOGUE)
    assert len(fitted(cause("coulomb_friction", 0.8), by_chance=0.9)) == len(CATALOGUE)
    assert len(fitted(cause("coulomb_friction", 0.8, least=0.02))) == len(CATALOGUE)
    assert worth_fitting(AXIS, None, CATALOGUE).alone == CATALOGUE


def test_of_families_that_explain_the_force_only_together_the_forms_that_were_taken_are_fitted() -> None:
    both = cause("coulomb_friction", 0.5), cause("cubic_stiffness", 0.9)
    judged = frozenset(effect.name for effect in CATALOGUE)
    proposal = Proposal(both, both[:1], judged, explained=0.95, by_chance=0.01, noise=0.01)
    worth = worth_fitting(AXIS, proposal, CATALOGUE)
    assert {effect.name for effect in worth.alone} == {"coulomb_friction", "cubic_stiffness"}
    assert worth.explained == 0.95


def test_a_delay_that_is_named_is_fitted_at_every_place() -> None:
    """What is late in one place makes all readings behind it late."""
    late = {"input_delay", "actuator_lag", "sensor_delay", "sensor_lag", "time_shift"}
    both = cause("sensor_delay", 0.5), cause("cubic_stiffness", 0.9)
    judged = frozenset(effect.name for effect in CATALOGUE)
    for taken, expected in ((both, late), (both[1:], set())):
        proposal = Proposal(taken, both[1:], judged, explained=0.95, by_chance=0.01, noise=0.01)
        kept = {effect.name for effect in worth_fitting(AXIS, proposal, CATALOGUE).named}
        assert kept & late == expected


def test_a_weight_is_fitted_beside_a_ripple() -> None:
    """It is a ripple of one period a turn, at which the motion alone need not show it."""
    assert "gravity_torque" in fitted(cause("torque_ripple", 0.8))
    assert "gravity_torque" not in fitted(cause("encoder_eccentricity", 0.8))


def test_a_form_of_a_form_is_fitted_where_the_motion_shows_it() -> None:
    """LuGre friction contains presliding and Stribeck friction, which contain Coulomb friction; a loop is another family."""
    best, loop = cause("coulomb_friction", 0.8), cause("bouc_wen_hysteresis", 0.79)
    unexplained = {"coulomb_friction": 0.2, "stribeck_friction": 0.199, "presliding_friction": 0.18}
    for of_lugre, is_fitted in ((0.179, False), (0.1, True)):
        starts = {
            name: ProposedStart({}, {}, left)
            for name, left in {**unexplained, "lugre_friction": of_lugre, loop.effect.name: 0.21}.items()
        }
        proposal = Proposal((best,), (best, loop), frozenset(starts), 0.8, 0.1, starts=starts)
        kept = {effect.name for effect in worth_fitting(AXIS, proposal, CATALOGUE).alone}
        assert {*unexplained, loop.effect.name} <= kept
        assert ("lugre_friction" in kept) == is_fitted

"""Models are ranked by held-out error; what cannot be told apart is said to be tied."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.verdict.ranking import Grounds, Ranking, rank
from rigsight.rigs import RIGS

N = 4000


def ranked(*models: FittedModel, seed: int = 0, gap: float = 1.0) -> Ranking:
    return rank(models, np.ones(1), np.random.default_rng(seed), gap)


@pytest.fixture
def white() -> np.ndarray:
    return np.random.default_rng(1).standard_normal(N)


def test_of_two_that_tie_the_simpler_wins(scored, white) -> None:
    complex_model = scored(("bouc_wen_hysteresis",), 0.999 * white, n_free=7)
    simple = scored(("coulomb_friction",), white, n_free=5)
    ranking = ranked(complex_model, simple)
    assert ranking.order[0] is simple
    assert ranking.tied == (complex_model,)


def test_of_two_with_as_many_numbers_a_small_difference_all_along_is_more_than_a_hint(scored, white) -> None:
    plainer = scored(("cubic_stiffness",), 1.005 * white, n_free=5)
    likened = scored(("gravity_pendulum",), white, n_free=5)
    ranking = ranked(plainer, likened)
    assert ranking.order[0] is likened
    assert 0.85 < ranking.probabilities[0] < 0.95
    assert ranking.tied == (plainer,)
    alike = ranked(scored(("cubic_stiffness",), white, n_free=5), likened)
    assert alike.order[0].names == ("cubic_stiffness",)
    assert alike.probabilities[0] == pytest.approx(0.75, abs=0.01)


def test_a_clearly_better_model_wins_however_complex(scored, white) -> None:
    complex_model = scored(("bouc_wen_hysteresis",), white, n_free=7)
    simple = scored(("coulomb_friction",), 1.5 * white, n_free=5)
    ranking = ranked(simple, complex_model)
    assert ranking.order[0] is complex_model
    assert ranking.tied == ()
    assert ranking.probabilities[0] > 0.99


def test_a_difference_of_a_few_percent_in_every_part_of_the_record_is_no_tie(scored, white) -> None:
    """Both models see the same noise: their errors are compared pairwise, which resolves far less than their scatter."""
    better = scored(("cubic_stiffness",), white, n_free=5)
    worse = scored(("end_stop",), 1.05 * white, n_free=5)
    assert ranked(worse, better).tied == ()


def test_an_advantage_in_a_single_stretch_is_not_trusted(scored, white) -> None:
    burst = white.copy()
    burst[1000:1040] *= 4.0
    ranking = ranked(scored(("end_stop",), burst, n_free=5), scored(("cubic_stiffness",), white, n_free=5))
    assert ranking.order[0].names == ("cubic_stiffness",)
    assert [m.names for m in ranking.tied] == [("end_stop",)]


def test_fewer_effects_win_at_equal_numbers_of_parameters(scored, white) -> None:
    pair = scored(("cubic_stiffness", "asymmetric_stiffness"), white, n_free=6)
    single = scored(("end_stop",), white, n_free=6)
    assert ranked(pair, single).order[0] is single


def test_far_above_the_floor_a_small_difference_is_no_hint(scored, white) -> None:
    plainer = scored(("cubic_stiffness",), 3.03 * white, n_free=5)
    likened = scored(("gravity_pendulum",), 3.0 * white, n_free=5)
    ranking = ranked(plainer, likened)
    assert ranking.order[0] is plainer
    assert ranking.tied == (likened,)


def test_a_small_difference_does_not_speak_for_a_second_effect(scored, white) -> None:
    pair = scored(("cubic_stiffness", "asymmetric_stiffness"), white, n_free=6)
    single = scored(("end_stop",), 1.005 * white, n_free=6)
    assert ranked(pair, single).order[0] is single


def test_probabilities_sum_to_one_and_follow_the_order_of_errors(scored, white) -> None:
    names = ["cubic_stiffness", "end_stop", "free_play", "quadratic_damping"]
    models = [scored((name,), (1.0 + 0.2 * i) * white, n_free=5) for i, name in enumerate(names)]
    ranking = ranked(*models[::-1])
    assert sum(ranking.probabilities) == pytest.approx(1.0, abs=1e-12)
    assert [m.names[0] for m in ranking.order] == names
    assert all(p >= 0.0 for p in ranking.probabilities)
    assert list(ranking.probabilities) == sorted(ranking.probabilities, reverse=True)


def test_failed_models_come_last_with_nothing(scored, white) -> None:
    failed = scored(("free_play",))
    good = scored(("cubic_stiffness",), white, n_free=5)
    ranking = ranked(failed, good)
    assert ranking.order == (good, failed)
    assert ranking.probabilities == (pytest.approx(1.0), 0.0)
    assert failed not in ranking.tied


def test_only_failed_models(scored) -> None:
    failed = scored(("free_play",))
    ranking = ranked(failed)
    assert ranking == Ranking(
        (failed,), (0.0,), (), (Grounds(0.0, 0.0, None),), impossible=frozenset({failed.names})
    )
    assert ranked() == Ranking((), (), (), ())


def test_a_model_that_left_the_range_of_numbers_has_failed(scored, white) -> None:
    diverged = scored(("free_play",), np.full(N, np.inf), n_free=5)
    assert ranked(diverged, scored(("end_stop",), white, n_free=5)).probabilities[1] == 0.0


def test_the_same_seed_gives_the_same_ranking(scored, white) -> None:
    other = np.random.default_rng(2).standard_normal(N)
    models = [scored(("cubic_stiffness",), white, n_free=5), scored(("end_stop",), other, n_free=5)]
    first, second = ranked(*models, seed=3), ranked(*models, seed=3)
    assert first.probabilities == second.probabilities
    assert first.order == second.order


def test_the_order_of_the_candidates_does_not_matter(scored, white) -> None:
    a = scored(("cubic_stiffness",), white, n_free=5)
    b = scored(("end_stop",), 1.3 * white, n_free=5)
    assert ranked(a, b).order == ranked(b, a).order


def test_a_worse_model_far_above_the_floor_may_tie_within_what_the_best_leaves(scored, white) -> None:
    """At ten times the floor no candidate is the truth: a few percent between them decide nothing. At the floor they do."""
    for level, expected in ((10.0, 1), (1.0, 0)):
        best = scored(("cubic_stiffness",), level * white, n_free=5)
        second = scored(("end_stop",), 1.07 * level * white, n_free=5)
        assert len(ranked(best, second).tied) == expected


def test_of_a_large_gap_the_last_thousandth_decides_nothing(scored, white) -> None:
    """4 % of the floor are a thousandth of a gap of 50 times the floor: the simpler model is named, the other one told."""
    richer = scored(("end_stop",), white, n_free=6)
    simpler = scored(("free_play",), 1.04 * white, n_free=5)
    assert ranked(richer, simpler, gap=3.0).order[0] is richer
    found = ranked(richer, simpler, gap=50.0)
    assert found.order[0] is simpler
    assert found.tied == (richer,)


def test_an_output_that_was_not_measured_does_not_count() -> None:
    rig = RIGS["drive_train"]
    first, *others = (signal.name for signal in rig.outputs)
    assert others
    context = FitContext(rig, (), (), (), {}, {first: 2.0}, frozenset())
    np.testing.assert_array_equal(context.floors, [2.0, *(np.inf for _ in others)])


def test_with_one_output_a_late_drive_is_named_before_a_late_sensor(scored, white) -> None:
    """Both are the same records there; the other one stays among those that cannot be told from it."""
    late_sensor = scored(("sensor_delay",), white)
    late_drive = scored(("input_delay",), 1.0001 * white)
    found = ranked(late_sensor, late_drive)
    assert found.order[0] is late_drive
    assert found.tied == (late_sensor,)
    assert found.probabilities[0] == pytest.approx(0.75, abs=0.02)


def test_a_mean_force_of_friction_stands_before_a_constant_force_that_nobody_knew(scored, white) -> None:
    """Both are the same equation; that the second competes at all says that even friction needs such a force."""
    beside_a_force = scored(("coulomb_friction",), white, n_free=5)
    of_its_own = scored(("directional_friction",), white, n_free=5)
    ranking = ranked(beside_a_force, of_its_own)
    assert ranking.order[0] is of_its_own
    assert ranking.tied == (beside_a_force,)
    assert ranking.probabilities[0] == pytest.approx(0.75, abs=0.01)


def test_evidence_decides_between_models_whose_errors_tell_little(scored, white) -> None:
    """Far above the floor errors within a tenth of it count as equal, and the fewest numbers win."""
    plain = scored(("coulomb_friction",), 9.0 * white, n_free=4)
    true = scored(("load_dependent_friction",), 8.9 * white, n_free=5)
    far = scored(("end_stop",), 20.0 * white, n_free=5)
    reported = {plain.names: 900.0, true.names: 0.0}
    models, rng = [plain, true, far], np.random.default_rng(0)
    assert rank(models, np.ones(1), rng).order[0] is plain
    ranking = rank(models, np.ones(1), rng, criterion=lambda model: reported[model.names])
    assert ranking.order[0] is true
    assert ranking.tied == ()
    assert rank(models, np.ones(1), rng, criterion=lambda _: 0.0).tied == (true,)


def test_what_chose_a_model_does_not_report_its_error(scored) -> None:
    """Of twenty models that are alike the luckiest is chosen; on stretches that did not choose, its luck is gone."""
    rng = np.random.default_rng(3)
    swelling = np.repeat(np.exp(0.5 * rng.standard_normal((20, 40))), N // 40, axis=1)
    noise = rng.standard_normal((20, N)) * swelling
    models = [scored(("cubic_stiffness",), own, n_free=5) for own in noise]
    ranking = ranked(*models)
    expected = np.sqrt(np.mean(noise**2))
    assert ranking.order[0].error_over_noise < 0.95 * expected
    assert ranking.error_of_choice > 1.03 * ranking.order[0].error_over_noise


def test_one_model_is_chosen_by_nothing(scored, white) -> None:
    ranking = ranked(scored(("cubic_stiffness",), white, n_free=5))
    assert ranking.error_of_choice == pytest.approx(ranking.order[0].error_over_noise, rel=0.01)

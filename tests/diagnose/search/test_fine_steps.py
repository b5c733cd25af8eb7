"""In how fine steps does a fit follow a time constant that the samples do not show?"""

from __future__ import annotations

from pathlib import Path

from rigsight.diagnose.fit_context import fit_context_of, start_values_of
from rigsight.diagnose.noise.detection import noise_floors
from rigsight.diagnose.search.single_effects import reidentify
from rigsight.identify import IdleThreads
from rigsight.identify.fit.windows import Windowing
from rigsight.workflow.campaign.read_campaign import read_campaign


def test_a_mass_that_samples_do_not_show_is_not_followed_to_zero(shared_data: Path) -> None:
    # At 50 samples a second the pole of a measured servo went to -1073 rad/s, in 16 steps a sample, for a thousandth of the cost.
    campaign = read_campaign(shared_data / "so101" / "elbow" / "campaign.toml")
    noise = {floor.output: floor.std for floor in noise_floors(campaign.rig, campaign.records)}
    context = fit_context_of(campaign, noise, Windowing(), None, IdleThreads(), start_values_of(campaign))
    reidentified = reidentify(context, context.start)
    assert max(reidentified.fit.substeps) <= 4
    finest = context.problem(reidentified.fit.structure, context.estimation).fit(
        reidentified.fit.values,
        reidentified.fit.free,
        reidentified.fit.initial_states,
        substeps=[16] * len(context.estimation),
    )
    assert reidentified.fit.cost < 1.005 * finest.cost

"""What do all estimators share? Settings in the constructor, `fit` on a campaign, a model that predicts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self

from sklearn.utils.validation import check_is_fitted

from rigsight.effects import Effect
from rigsight.records import Record
from rigsight.simulate.model import Model
from rigsight.workflow.campaign import Campaign, read_campaign
from rigsight.workflow.simulate import simulate_model

if TYPE_CHECKING:

    class BaseEstimator:
        """What is used of scikit-learn's, which has no types: on an unknown base no misspelled attribute would be seen."""

        def get_params(self, deep: bool = True) -> dict[str, Any]:
            """Return the settings."""

        def set_params(self, **params: Any) -> Self:
            """Change settings."""

else:
    from sklearn.base import BaseEstimator


class CampaignEstimator(BaseEstimator):
    """What is fitted to the records of a campaign and then predicts what the rig does.

    Attributes
    ----------
    model_
        The simulation that `fit` found, with all its numbers.
    """

    model_: Model

    def predict(
        self, record: Record, initial_state: Mapping[str, float] | Literal["estimated"] | None = None
    ) -> Record:
        """Simulate the fitted model for the input of a record.

        Parameters
        ----------
        record
            Its input is simulated with its hold; its outputs are read only where initial states are estimated.
        initial_state
            As in `rigsight.simulate_model`: by default the static equilibrium at the first input sample.

        Returns
        -------
        A copy of the record with the outputs that the model predicts, shape (n_samples,) each, in SI units.

        Raises
        ------
        NotFittedError
            If `fit` has not been called.
        InputError
            If the record lacks the input, or initial states cannot be estimated from it.
        SimulationError
            If the motion leaves the range of numbers.
        """
        check_is_fitted(self)
        return simulate_model(self.model_, record, initial_state)

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Return the settings by name, as scikit-learn does.

        Parameters
        ----------
        deep
            Without meaning here: no setting is an estimator.
        """
        return super().get_params(deep)

    def set_params(self, **params: Any) -> Self:
        """Change settings and return the estimator; it has to be fitted anew.

        Parameters
        ----------
        **params
            Settings by name.

        Raises
        ------
        ValueError
            If there is no such setting.
        """
        return super().set_params(**params)


def campaign_of(campaign: Campaign | str | Path, own_effects: Iterable[Effect] = ()) -> Campaign:
    """Return a campaign, read where its file or folder is named.

    Parameters
    ----------
    campaign
        A campaign, or the toml file or the folder that holds one.
    own_effects
        Effects that it may name beside those of the catalogue.

    Raises
    ------
    InputError
        Naming file and key of what cannot be used.
    """
    return campaign if isinstance(campaign, Campaign) else read_campaign(campaign, own_effects)

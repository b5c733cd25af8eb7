"""Base of all estimators: settings in the constructor, `fit` on a campaign, a model that predicts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self

from sklearn.utils.validation import check_is_fitted

from rigsight.campaign import Campaign
from rigsight.effects import Effect
from rigsight.errors import InputError
from rigsight.records import Record
from rigsight.rigs import RIGS, Rig, rotational
from rigsight.simulate.model import Model
from rigsight.workflow.campaign.in_memory import make_campaign, rig_of
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.simulate import simulate_model

if TYPE_CHECKING:

    class BaseEstimator:
        """The used part of scikit-learn's base class, which is untyped: with it, misspelled attributes would go unnoticed."""

        def get_params(self, deep: bool = True) -> dict[str, Any]:
            """Return the settings."""

        def set_params(self, **params: Any) -> Self:
            """Change settings."""

else:
    from sklearn.base import BaseEstimator


class CampaignEstimator(BaseEstimator):
    """Base of estimators that are fitted to the records of a campaign and then predict the outputs of the rig.

    Attributes
    ----------
    model_
        The fitted simulation, with all its parameter values.
    """

    model_: Model

    def predict(
        self, record: Record, initial_state: Mapping[str, float] | Literal["estimated"] | None = None
    ) -> Record:
        """Simulate the fitted model for the inputs of a record.

        Parameters
        ----------
        record
            Its inputs are simulated, with its hold and its own constants; its outputs are read only where initial states are
            estimated.
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
            If the motion diverges.
        """
        check_is_fitted(self)
        return simulate_model(self.model_, record, initial_state)

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Return the settings by name, as scikit-learn does.

        Parameters
        ----------
        deep
            Ignored: no setting is an estimator.
        """
        return super().get_params(deep)

    def set_params(self, **params: Any) -> Self:
        """Change settings and return the estimator; it must be fitted again.

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


def campaign_of(
    campaign: Campaign | Sequence[Record] | str | Path,
    own_effects: Iterable[Effect] = (),
    rig: str | Rig | None = None,
) -> Campaign:
    """Return a campaign: as given, read from its file or folder, or made from records.

    Parameters
    ----------
    campaign
        A campaign, the toml file or the folder that contains one, or records of `rig`.
    own_effects
        Effects that it may name beside those of the catalogue.
    rig
        Rig of the records, or one that the file may name.

    Raises
    ------
    InputError
        Naming file and key of what cannot be used; or if records are given without a rig, or a campaign is of another rig.
    """
    found = None if rig is None else rig_of(rig)
    if isinstance(campaign, Sequence) and not isinstance(campaign, str):
        if found is None:
            raise InputError(
                "The rig of the records is not given: name it, for instance rs.Diagnoser(rig=...), or make a campaign with "
                "rs.make_campaign(rig, records)."
            )
        return make_campaign(found, campaign)
    own_rigs = () if found is None or found.name in RIGS else (found,)
    read = campaign if isinstance(campaign, Campaign) else read_campaign(campaign, own_effects, own_rigs)
    if (
        found is not None
        and read.rig not in (found, rotational(found))
        and read.rig.mechanism != found.mechanism
    ):
        raise InputError(
            f"The campaign '{read.title}' is of the rig '{read.rig.name}', but the estimator has rig='{found.name}'. Leave rig "
            "out, or give records of that rig."
        )
    return read

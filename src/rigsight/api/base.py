"""Base of all estimators, which predict with a fitted model, and of all results, which are drawn, tabulated and saved."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self, TypeVar

from sklearn.utils.validation import check_is_fitted

from rigsight.campaign import Campaign
from rigsight.effects import CATALOGUE, Effect
from rigsight.errors import InputError, check_option
from rigsight.records import Record
from rigsight.rigs import Rig
from rigsight.simulate.model import Model
from rigsight.workflow.campaign.in_memory import campaign_of
from rigsight.workflow.campaign.model_file import model_of
from rigsight.workflow.run.kernels import checked_jobs
from rigsight.workflow.run.progress import Listener, listening
from rigsight.workflow.simulate import simulate_model

if TYPE_CHECKING:
    import pandas as pd

    class BaseEstimator:
        """The used part of scikit-learn's base class, which is untyped: with it, misspelled attributes would go unnoticed."""

        def get_params(self, deep: bool = True) -> dict[str, Any]:
            """Return the settings."""

        def set_params(self, **params: Any) -> Self:
            """Change settings."""

else:
    from sklearn.base import BaseEstimator

T = TypeVar("T")


class CampaignEstimator(BaseEstimator):
    """Base of estimators that are fitted to the records of a campaign and then predict the outputs of the rig.

    Attributes
    ----------
    model_
        The fitted simulation, with all its parameter values.
    """

    model_: Model
    n_jobs: int | None
    verbose: bool
    rig: str | Rig | None

    def fit(self, campaign: Campaign | Sequence[Record] | str | Path) -> Self:
        """Fit the model to the estimation records of a campaign; its validation records are only scored.

        Parameters
        ----------
        campaign
            A campaign, the toml file or the folder that contains one, or records of `rig`.

        Returns
        -------
        The estimator itself.

        Raises
        ------
        InputError
            If the campaign or a setting cannot be used, an effect is unknown, or the records do not show what is to be found.
        SimulationError
            If the given simulation, or the rig's own equations, cannot be simulated near the records.
        """
        self._check_settings()
        jobs = checked_jobs(self.n_jobs)
        own = self._own_effects()
        read = campaign_of(campaign, own, rig=self.rig)
        with listening(quiet=not self.verbose) as listener:
            found = self._fit(read, jobs, listener)
        self.model_ = model_of(found.model, (*own, *read.modelled))
        return self

    def _fit(self, campaign: Campaign, n_jobs: int, listener: Listener) -> Any:
        """Keep the result as an attribute, and return it."""
        raise NotImplementedError

    def _check_settings(self) -> None:
        """Refuse settings that no campaign can be fitted with."""

    def _effects(self) -> Sequence[Effect]:
        """Return the effects that a fit takes."""
        return ()

    def _own_effects(self) -> list[Effect]:
        """Return those of them that are not of the catalogue."""
        return [effect for effect in self._effects() if effect not in CATALOGUE]

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


class Result:
    """Base of results, which a command leaves as files: they are drawn, tabulated and saved."""

    @classmethod
    def of(cls, found: Any) -> Self:
        """Return a result of any origin, for instance of `run_identify`, with plots, tables and files.

        Parameters
        ----------
        found
            The result.
        """
        return cls(**vars(found))

    def save(self, folder: str | Path) -> tuple[Path, ...]:
        """Write the files of the command of this result into a folder, all or none.

        Parameters
        ----------
        folder
            Made if it does not exist; files of these names are replaced.

        Returns
        -------
        The files written.

        Raises
        ------
        InputError
            If they cannot be written.
        """
        return self._write(Path(folder))

    def _write(self, folder: Path) -> tuple[Path, ...]:
        raise NotImplementedError

    @staticmethod
    def _chosen(what: str, name: str | None, known: Mapping[str, T]) -> T:
        """Return the item of a kind with this name, the first one for None."""
        if not known:
            raise InputError(f"The result contains no {what} to show.")
        return next(iter(known.values())) if name is None else known[check_option(f"The {what}", name, known)]

    @staticmethod
    def _check_unused(needed: str, picture: str, **given: str | None) -> None:
        """Refuse choices, None where not made, that only the picture `needed` shows."""
        chosen = [name for name, value in given.items() if value is not None]
        if chosen and picture != needed:
            raise InputError(
                f"{' and '.join(chosen)} can be chosen only for the picture '{needed}', not for '{picture}'. Leave it out."
            )

    @classmethod
    def _estimates(cls, what: str, found: Mapping[str, Any]) -> pd.DataFrame:
        """Return estimates by name as a table."""
        rows = ({what: name, "value": n.value, "std": n.std, "unit": n.unit} for name, n in found.items())
        return cls._frame(rows, (what, "value", "std", "unit"))

    @staticmethod
    def _frame(rows: Iterable[Mapping[str, Any]], columns: Iterable[str]) -> pd.DataFrame:
        """Return rows as a table with these columns first; columns that only some rows have follow."""
        # Pandas is optional, and only loaded where a table is asked for.
        try:
            import pandas as pd
        except ImportError:
            raise InputError(
                'Tables need pandas, which is not installed: pip install "rigsight[notebook]"'
            ) from None
        found = [dict(row) for row in rows]
        names = dict.fromkeys([*columns, *(name for row in found for name in row)])
        return pd.DataFrame(found, columns=list(names))

"""Result of a discovery: equations and terms, with a picture, tables and files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self, get_args

from rigsight.api.tables import data_frame
from rigsight.discover import Discovery
from rigsight.errors import check_option
from rigsight.plot.discovery import discovery_figure
from rigsight.report.notebook import discovery_html
from rigsight.workflow.discover import write_discovery

if TYPE_CHECKING:
    import pandas as pd

    from rigsight.plot import Figure

Table = Literal["coefficients", "terms", "alternatives"]


class DiscoveryResult(Discovery):
    """The result of a discovery, as it is in ``discovery.json``, with plots, tables and files."""

    @classmethod
    def of(cls, found: Discovery) -> Self:
        """Return a discovery of any origin, for instance of `run_discover`, with plots, tables and files.

        Parameters
        ----------
        found
            The discovery.
        """
        return cls(**vars(found))

    def __repr__(self) -> str:
        return f"DiscoveryResult({self.title!r}, equations={self.equations!r})"

    def _repr_html_(self) -> str:
        return discovery_html(self)

    def plot(self) -> Figure:
        """Draw the terms with their inclusion probabilities, the coefficients, and the free run on the records.

        Returns
        -------
        A new matplotlib figure.
        """
        return discovery_figure(self)

    def to_dataframe(self, table: Table = "coefficients") -> pd.DataFrame:
        """Return a part of the discovery as a table.

        Parameters
        ----------
        table
            ``"coefficients"``: a row per number of the equations, with its standard error and unit. ``"terms"``: a row per term
            that was offered, with its inclusion probability. ``"alternatives"``: a row per fitted equation; errors on the
            held-out records are in units of the noise floor.

        Raises
        ------
        InputError
            If there is no such table, or pandas is not installed.
        """
        check_option("The table", table, get_args(Table))
        if table == "terms":
            return data_frame(
                (
                    {"term": t.name, "kept": t.kept, "inclusion": t.inclusion, "doubt": t.doubt}
                    for t in self.terms
                ),
                ("term", "kept", "inclusion", "doubt"),
            )
        if table == "alternatives":
            columns = ("n_parameters", "held_out", "aic", "bic")
            return data_frame(
                (
                    {
                        "terms": ", ".join(other.terms),
                        **{column: getattr(other, column) for column in columns},
                    }
                    for other in self.alternatives
                ),
                ("terms", *columns),
            )
        return data_frame(self._coefficient_rows(), ("coefficient", "value", "std", "unit"))

    def _coefficient_rows(self) -> Iterator[dict[str, Any]]:
        found = dict(self.rig_parameters)
        for term in self.kept:
            found |= term.coefficients
        for name, number in found.items():
            yield {"coefficient": name, "value": number.value, "std": number.std, "unit": number.unit}

    def save(self, folder: str | Path) -> tuple[Path, ...]:
        """Write ``discovery.json``, ``model.json`` and ``discovery.svg`` into a folder, all or none.

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
        return write_discovery(self, Path(folder))

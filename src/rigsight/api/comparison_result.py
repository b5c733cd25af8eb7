"""Result of a comparison: errors of models on records, with pictures, a table and files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Self

from rigsight.api.choice import named
from rigsight.api.tables import data_frame
from rigsight.compare import Comparison
from rigsight.report.drawing.comparison_figures import overall_figure, record_figures
from rigsight.report.notebook import comparison_html
from rigsight.workflow.compare import write_comparison

if TYPE_CHECKING:
    import pandas as pd

    from rigsight.plot import Figure


@dataclass(frozen=True, eq=False)
class ComparisonResult(Comparison):
    """The result of a comparison, as it is in ``comparison.json``, with plots, tables and files.

    Attributes
    ----------
    made_by
        The command or call that made it; quoted in the page.
    """

    made_by: str = "rigsight"

    @classmethod
    def of(cls, found: Comparison, made_by: str = "rigsight") -> Self:
        """Return a comparison of any origin, for instance of `run_compare`, with plots, tables and files.

        Parameters
        ----------
        found
            The comparison.
        made_by
            As the attribute.
        """
        return cls(**vars(found), made_by=made_by)

    def __repr__(self) -> str:
        models = [competitor.name for competitor in self.competitors]
        return f"ComparisonResult({self.title!r}, models={models!r}, records={len(self.records)})"

    def _repr_html_(self) -> str:
        return comparison_html(self)

    def plot(self, record: str | None = None) -> Figure:
        """Draw the comparison.

        Parameters
        ----------
        record
            Name of a record, to draw its frequency responses, or its step; None for the errors over all records.

        Returns
        -------
        A new matplotlib figure.

        Raises
        ------
        InputError
            If there is no such record, or it shows neither a response nor a step.
        """
        if record is None:
            return overall_figure(self).drawing
        index = named("record", record, {own.record.name: i for i, own in enumerate(self.records)})
        drawings = {f"picture of '{record}'": figure.drawing for figure in record_figures(self, index)}
        return named(f"picture of '{record}'", None, drawings)

    def to_dataframe(self) -> pd.DataFrame:
        """Return every error as a row: model, record, quantity, signal, unit, value, noise floor, lines or samples.

        Raises
        ------
        InputError
            If pandas is not installed.
        """
        columns = ("model", "record", "quantity", "signal", "unit", "value", "noise_floor", "n_values")
        return data_frame(
            (
                {
                    column: getattr(
                        score.column if column in ("quantity", "signal", "unit") else score, column
                    )
                    for column in columns
                }
                for score in self.scores
            ),
            columns,
        )

    def save(self, folder: str | Path) -> tuple[Path, ...]:
        """Write ``comparison.json``, ``.csv``, ``.html`` and the figures into a folder, all or none.

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
        return write_comparison(self, Path(folder), self.made_by)

"""Result of an identification: the parameters of the linear rig, with pictures, tables and files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self, get_args

from rigsight.api.choice import check_unused, named
from rigsight.api.tables import data_frame
from rigsight.errors import InputError, check_option
from rigsight.identify.identification import Identification
from rigsight.report.notebook import identification_html
from rigsight.workflow.identification.figures import amplitudes_figure, bode_figure, responses_figure
from rigsight.workflow.identify import write_identification

if TYPE_CHECKING:
    import pandas as pd

    from rigsight.plot import Figure

Picture = Literal["responses", "amplitudes", "bode"]
Table = Literal["records", "joint"]


class IdentificationResult(Identification):
    """The result of an identification, as it is in ``identification.json``, with plots, tables and files."""

    @classmethod
    def of(cls, found: Identification) -> Self:
        """Return an identification of any origin, for instance of `run_identify`, with plots, tables and files.

        Parameters
        ----------
        found
            The identification.
        """
        return cls(**vars(found))

    def __repr__(self) -> str:
        return (
            f"IdentificationResult({self.title!r}, records={len(self.records)}, changing={self.changing!r})"
        )

    def _repr_html_(self) -> str:
        return identification_html(self)

    def plot(self, picture: Picture = "responses", record: str | None = None) -> Figure:
        """Draw the identification.

        Parameters
        ----------
        picture
            ``"responses"``: frequency responses of all records in one plot, measured and fitted. ``"amplitudes"``: the
            parameters of each record over its amplitude. ``"bode"``: one record with the 95 % bands.
        record
            Name of the record, for ``"bode"``; by default the first.

        Returns
        -------
        A new matplotlib figure.

        Raises
        ------
        InputError
            If there is no such picture or record, or the records do not show what is to be drawn.
        """
        check_option("The picture", picture, get_args(Picture))
        check_unused("bode", picture, record=record)
        if picture == "amplitudes":
            drawing = amplitudes_figure(self)
        elif picture == "responses":
            drawing = responses_figure(self)
        else:
            drawing = bode_figure(named("record", record, {r.record.name: r for r in self.records}), self)
        if drawing is None:
            raise InputError(
                f"The picture '{picture}' would be empty: no sweep or multisine gave a response, or no fit succeeded. See the "
                "warnings of the result for the reason."
            )
        return drawing

    def to_dataframe(self, table: Table = "records") -> pd.DataFrame:
        """Return the parameters as a table in SI units, a row per parameter.

        Parameters
        ----------
        table
            ``"records"``: the estimates from each record alone. ``"joint"``: the one set for all records.

        Raises
        ------
        InputError
            If there is no such table, or pandas is not installed.
        """
        check_option("The table", table, get_args(Table))
        columns = ("parameter", "value", "std", "unit")
        if table == "joint":
            return data_frame(self._joint_rows(), columns)
        return data_frame(self._record_rows(), ("record", "amplitude", *columns))

    def _record_rows(self) -> Iterator[dict[str, Any]]:
        for record in self.records:
            for name, (value, std) in record.estimates.items():
                yield {
                    "record": record.record.name, "amplitude": record.amplitude, "parameter": name,
                    "value": value, "std": std, "unit": self.units.get(name, ""),
                }  # fmt: skip

    def _joint_rows(self) -> Iterator[dict[str, Any]]:
        fit, pooled = self.joint.fit.fit, self.joint.pooled
        found = {name: (fit.values[name], fit.standard_errors[name]) for name in self.joint.names}
        if pooled is not None:
            errors = pooled.standard_errors
            found |= {name: (value, errors[name]) for name, value in pooled.values.items()}
        for name, (value, std) in found.items():
            yield {"parameter": name, "value": value, "std": std, "unit": self.units.get(name, "")}

    def save(self, folder: str | Path) -> tuple[Path, ...]:
        """Write ``identification.json``, ``model.json`` and the figures into a folder, all or none.

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
        return write_identification(self, Path(folder))

"""Results of the estimators, which are drawn, tabulated and saved as the command of each leaves them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self, TypeVar, get_args

from rigsight.diagnose.location.trace import STAGES
from rigsight.diagnose.result import Diagnosis
from rigsight.discover.result import Discovery
from rigsight.effects import Effect
from rigsight.errors import InputError, check_option
from rigsight.identify.identification import Identification
from rigsight.plot.fitted_numbers import discovery_figure
from rigsight.report.identification import identification_html, joint_estimates
from rigsight.report.record_views import record_drawing
from rigsight.report.sections import TRUST_COLUMNS, budget_drawing, ranking_drawing, trust_drawing, trust_rows
from rigsight.report.terminal import diagnosis_html, discovery_html
from rigsight.report.wording import named_candidate
from rigsight.workflow.diagnose import result_files
from rigsight.workflow.discover import write_discovery
from rigsight.workflow.identification.figures import amplitudes_figure, bode_figure, responses_figure
from rigsight.workflow.identify import write_identification
from rigsight.workflow.run.results import write_together

if TYPE_CHECKING:
    import pandas as pd

    from rigsight.plot import Figure

T = TypeVar("T")
DiagnosisPicture = Literal["gap", "candidates", "record", "trust"]
DiagnosisTable = Literal["candidates", "gap", "parameters", "trust"]
IdentificationPicture = Literal["responses", "amplitudes", "bode"]
IdentificationTable = Literal["records", "joint"]
DiscoveryTable = Literal["coefficients", "terms", "alternatives"]


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


@dataclass(frozen=True)
class DiagnosisResult(Result, Diagnosis):
    """The result of a diagnosis, as it is in ``diagnosis.json``; saved with ``model.json`` and ``report.html``.

    Attributes
    ----------
    made_by
        The command or call that made it; quoted in the report.
    seed
        Seed of the diagnosis, None where it is not known.
    own_effects
        Effects beside those of the catalogue that it may name; the report shows their equations.
    """

    made_by: str = "rigsight"
    seed: int | None = None
    own_effects: tuple[Effect, ...] = ()

    @classmethod
    def of(
        cls,
        found: Diagnosis,
        made_by: str = "rigsight",
        seed: int | None = None,
        own_effects: Iterable[Effect] = (),
    ) -> Self:
        """Return a diagnosis of any origin, for instance of `run_diagnose`, with plots, tables and files.

        Parameters
        ----------
        found
            The diagnosis.
        made_by, seed, own_effects
            As the attributes.
        """
        return cls(**vars(found), made_by=made_by, seed=seed, own_effects=tuple(own_effects))

    def __repr__(self) -> str:
        return f"DiagnosisResult({self.title!r}, verdict={self.verdict!r}, effects={self.effects!r})"

    def _repr_html_(self) -> str:
        return diagnosis_html(self)

    def plot(
        self, picture: DiagnosisPicture = "gap", record: str | None = None, output: str | None = None
    ) -> Figure:
        """Draw the diagnosis.

        Parameters
        ----------
        picture
            ``"gap"``: how the gap shrinks, step by step. ``"candidates"``: the error of each. ``"record"``: measured and
            simulated output of one record, with the errors below. ``"trust"``: parameters estimated from single records.
        record
            Name of the record, for ``"record"``; by default the first that was scored.
        output
            Name of the output, for ``"record"``; by default the first of the rig.

        Returns
        -------
        A new matplotlib figure.

        Raises
        ------
        InputError
            If there is no such picture, record or output, or no parameter was estimated by record.
        """
        check_option("The picture", picture, get_args(DiagnosisPicture))
        self._check_unused("record", picture, record=record, output=output)
        if picture == "gap":
            return budget_drawing(self)
        if picture == "candidates":
            return ranking_drawing(self)
        if picture == "trust":
            return trust_drawing(self)
        trace = self._chosen("record", record, {trace.record: trace for trace in self.traces})
        name = self._chosen("output", output, {name: name for name in trace.measured})
        return record_drawing(self, trace, name)

    def to_dataframe(self, table: DiagnosisTable = "candidates") -> pd.DataFrame:
        """Return a part of the diagnosis as a table.

        Parameters
        ----------
        table
            ``"candidates"``: a row per set of effects that was tried, best first; errors are NRMSE on the validation records.
            ``"gap"``: a row per output with the NRMSE of each stage. ``"parameters"``: a row per fitted parameter of the
            diagnosed simulation, with its standard error and unit. ``"trust"``: a row per parameter and group (a record, an
            amplitude, windows of a length) with its value there, and how the parameter differs between groups.

        Raises
        ------
        InputError
            If there is no such table, or pandas is not installed.
        """
        check_option("The table", table, get_args(DiagnosisTable))
        if table == "trust":
            return self._frame(trust_rows(self), TRUST_COLUMNS)
        if table == "gap":
            stages = (*STAGES, "noise_floor", "closed")
            gaps = [
                {"output": name, **{s: getattr(gap, s) for s in stages}} for name, gap in self.gap.items()
            ]
            return self._frame(gaps, ("output", *stages))
        if table == "parameters":
            best = named_candidate(self)
            return self._estimates("parameter", {} if best is None else best.parameters)
        rows = [
            {
                "effects": ", ".join(candidate.effects),
                "probability": candidate.probability,
                "error_over_noise": candidate.error_over_noise,
                **{f"nrmse_{output}": error for output, error in candidate.validation_nrmse.items()},
                "converged": candidate.success,
            }
            for candidate in self.candidates
        ]
        return self._frame(rows, ("effects", "probability", "error_over_noise"))

    def _write(self, folder: Path) -> tuple[Path, ...]:
        return write_together(folder, result_files(self, self.made_by, self.seed, self.own_effects))


class IdentificationResult(Result, Identification):
    """The result of an identification, as it is in ``identification.json``; saved with ``model.json`` and the figures."""

    def __repr__(self) -> str:
        return (
            f"IdentificationResult({self.title!r}, records={len(self.records)}, changing={self.changing!r})"
        )

    def _repr_html_(self) -> str:
        return identification_html(self)

    def plot(self, picture: IdentificationPicture = "responses", record: str | None = None) -> Figure:
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
        check_option("The picture", picture, get_args(IdentificationPicture))
        self._check_unused("bode", picture, record=record)
        if picture == "amplitudes":
            drawing = amplitudes_figure(self)
        elif picture == "responses":
            drawing = responses_figure(self)
        else:
            drawing = bode_figure(
                self._chosen("record", record, {r.record.name: r for r in self.records}), self
            )
        if drawing is None:
            raise InputError(
                f"The picture '{picture}' would be empty: no sweep or multisine gave a response, or no fit succeeded. See the "
                "warnings of the result for the reason."
            )
        return drawing

    def to_dataframe(self, table: IdentificationTable = "records") -> pd.DataFrame:
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
        check_option("The table", table, get_args(IdentificationTable))
        if table == "joint":
            return self._estimates("parameter", joint_estimates(self))
        columns = ("record", "amplitude", "parameter", "value", "std", "unit")
        return self._frame(self._record_rows(), columns)

    def _record_rows(self) -> Iterator[dict[str, Any]]:
        for record in self.records:
            for name, (value, std) in record.estimates.items():
                yield {
                    "record": record.record.name, "amplitude": record.amplitude, "parameter": name,
                    "value": value, "std": std, "unit": self.units.get(name, ""),
                }  # fmt: skip

    def _write(self, folder: Path) -> tuple[Path, ...]:
        return write_identification(self, folder)


class DiscoveryResult(Result, Discovery):
    """The result of a discovery, as it is in ``discovery.json``; saved with ``model.json``, ``discovery.svg``, own effects."""

    def __repr__(self) -> str:
        return f"DiscoveryResult({self.title!r}, equations={self.equations!r})"

    def _repr_html_(self) -> str:
        return discovery_html(self)

    def plot(self) -> Figure:
        """Draw the terms with the error without each, the coefficients, the free run on the records, and the missing forces.

        Returns
        -------
        A new matplotlib figure.
        """
        return discovery_figure(self)

    def to_dataframe(self, table: DiscoveryTable = "coefficients") -> pd.DataFrame:
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
        check_option("The table", table, get_args(DiscoveryTable))
        if table == "terms":
            rows = [(t.name, t.kept, t.inclusion, t.doubt) for t in self.terms]
            names = ("term", "kept", "inclusion", "doubt")
            return self._frame((dict(zip(names, row, strict=True)) for row in rows), names)
        if table == "alternatives":
            own = ("n_parameters", "held_out", "aic", "bic")
            others = [
                {"terms": ", ".join(other.terms), **{c: getattr(other, c) for c in own}}
                for other in self.alternatives
            ]
            return self._frame(others, ("terms", *own))
        found = dict(self.rig_parameters)
        for term in self.kept:
            found |= term.coefficients
        return self._estimates("coefficient", found)

    def _write(self, folder: Path) -> tuple[Path, ...]:
        return write_discovery(self, folder)

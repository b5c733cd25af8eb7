"""The identification of the linear rig as an estimator."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

from rigsight.api.base import CampaignEstimator, Result
from rigsight.campaign import Campaign
from rigsight.effects import Effect
from rigsight.errors import InputError, check_option
from rigsight.identify.identification import Identification
from rigsight.identify.record_identification import EstimationOptions
from rigsight.report.identification import identification_html
from rigsight.rigs import Rig
from rigsight.workflow.campaign.in_memory import effects_of
from rigsight.workflow.identification.figures import amplitudes_figure, bode_figure, responses_figure
from rigsight.workflow.identify import checked_options, identify_campaign, write_identification
from rigsight.workflow.run.progress import Listener

if TYPE_CHECKING:
    import pandas as pd

    from rigsight.plot import Figure


Picture = Literal["responses", "amplitudes", "bode"]
Table = Literal["records", "joint"]


class LinearIdentifier(CampaignEstimator):
    """Identify the parameters of the linear rig, from each record alone and from all of them together.

    Frequency responses of sweeps and multisines are estimated and fitted, steps are fitted in the time domain, and one parameter
    set is fitted to all estimation records by output error. The same as ``rigsight identify``.

    Parameters
    ----------
    method
        Estimator of the frequency responses: ``"local_rational"``, ``"local_polynomial"``, ``"h1"`` or ``"thesis"``.
    resolution
        Requested frequency resolution [rad/s]; None uses that of each record.
    n_jobs
        Records identified at the same time; None for one per processor.
    verbose
        Show progress on stderr.
    rig
        Rig of the records if `fit` gets records instead of a campaign: the name of a built-in rig, or a rig of your own.
    effects
        Effects with which the rig is calibrated as well, by name or as declarations; at least one of them with memory.
    seed
        Seed of this calibration.
    objective
        What fits over time minimize: ``"windows"``, the error with fitted initial states, over windows where the rig drifts; or
        ``"free-run"``, the error of each whole record from the state that its first samples give.
    initial_samples
        Number of these first samples; None for 20.

    Attributes
    ----------
    identification_
        The result: parameters of each record and of all together, with standard errors.
    model_
        The linear simulation with the parameters of all records together; with `effects`, the simulation with them.

    References
    ----------
    R. Pintelon and J. Schoukens, *System Identification: A Frequency Domain Approach* (Wiley 2012), chapters 7 and 9. T.
    McKelvey and G. Guerin, 16th IFAC Symposium on System Identification (2012), for the local rational method.

    Examples
    --------
    >>> import rigsight as rs
    >>> identifier = rs.LinearIdentifier(n_jobs=1).fit(rs.example_campaign())
    >>> [record.record.name for record in identifier.identification_.records]
    ['fit']
    """

    identification_: IdentificationResult

    def __init__(
        self,
        method: str = "local_rational",
        resolution: float | None = None,
        n_jobs: int | None = None,
        verbose: bool = False,
        rig: str | Rig | None = None,
        effects: Sequence[str | Effect] = (),
        seed: int = 0,
        objective: str = "windows",
        initial_samples: int | None = None,
    ) -> None:
        self.method = method
        self.resolution = resolution
        self.n_jobs = n_jobs
        self.verbose = verbose
        self.rig = rig
        self.effects = effects
        self.seed = seed
        self.objective = objective
        self.initial_samples = initial_samples

    def _check_settings(self) -> None:
        self._options()

    def _options(self) -> EstimationOptions:
        return checked_options(self.method, self.resolution, self.objective, self.initial_samples)

    def _effects(self) -> Sequence[Effect]:
        return effects_of(self.effects)

    def _fit(self, campaign: Campaign, n_jobs: int, listener: Listener) -> IdentificationResult:
        effects = self._effects()
        found = identify_campaign(
            campaign, self._options(), n_jobs, listener, effects=effects, seed=self.seed
        )
        self.identification_ = IdentificationResult.of(found)
        return self.identification_


class IdentificationResult(Result, Identification):
    """The result of an identification, as it is in ``identification.json``; saved with ``model.json`` and the figures."""

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
            return self._frame(self._joint_rows(), columns)
        return self._frame(self._record_rows(), ("record", "amplitude", *columns))

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

    def _write(self, folder: Path) -> tuple[Path, ...]:
        return write_identification(self, folder)

"""The discovery of equations as an estimator."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

from rigsight.api.base import CampaignEstimator, Result
from rigsight.campaign import Campaign
from rigsight.discover import Discovery
from rigsight.effects import Effect
from rigsight.errors import check_option
from rigsight.plot.discovery import discovery_figure
from rigsight.report.terminal import discovery_html
from rigsight.rigs import Rig
from rigsight.workflow.discover import discover_campaign, write_discovery
from rigsight.workflow.run.progress import Listener

if TYPE_CHECKING:
    import pandas as pd

    from rigsight.plot import Figure


Table = Literal["coefficients", "terms", "alternatives"]


class EquationDiscoverer(CampaignEstimator):
    """Discover the equations of motion by sparse regression, refined by output-error fits and selected on held-out records.

    What ``rigsight discover`` does.

    Parameters
    ----------
    effects
        Effects of the user, which are terms beside those of the catalogue.
    one_by_one
        Also discover on each estimation record alone.
    seed
        Seed of the ensembles.
    n_jobs
        Records discovered on at the same time; None for one per processor.
    verbose
        Show progress on stderr.
    rig
        Rig of the records if `fit` gets records instead of a campaign: the name of a built-in rig, or a rig of your own.

    Attributes
    ----------
    discovery_
        The result: equations, coefficients with standard errors, inclusion probabilities.
    model_
        The simulation with the equations found.

    References
    ----------
    J. Swevers, W. Verdonck and J. De Schutter, IEEE Control Systems 27 (2007) 58, for inverse dynamics as a regression. L.
    Boninsegna, F. Nueske and C. Clementi, J. Chem. Phys. 148 (2018) 241723, for stepwise sparse regression. U. Fasel et al.,
    Proc. R. Soc. A 478 (2022) 20210904, for inclusion probabilities.

    Examples
    --------
    >>> import rigsight as rs
    >>> discoverer = rs.EquationDiscoverer(n_jobs=1).fit(rs.example_campaign())
    >>> [term.name for term in discoverer.discovery_.kept]
    ['cubic_stiffness']
    """

    discovery_: DiscoveryResult

    def __init__(
        self,
        effects: Sequence[Effect] = (),
        one_by_one: bool = False,
        seed: int = 0,
        n_jobs: int | None = None,
        verbose: bool = False,
        rig: str | Rig | None = None,
    ) -> None:
        self.effects = effects
        self.one_by_one = one_by_one
        self.seed = seed
        self.n_jobs = n_jobs
        self.verbose = verbose
        self.rig = rig

    def _fit(self, campaign: Campaign, n_jobs: int, listener: Listener) -> DiscoveryResult:
        found = discover_campaign(
            campaign,
            effects=self.effects,
            one_by_one=self.one_by_one,
            seed=self.seed,
            n_jobs=n_jobs,
            listener=listener,
        )
        self.discovery_ = DiscoveryResult.of(found)
        return self.discovery_


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

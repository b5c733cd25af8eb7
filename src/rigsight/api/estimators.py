"""Estimators, which are fitted to the records of a campaign and then predict: diagnosis, identification, discovery."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self

from sklearn.utils.validation import check_is_fitted

from rigsight.api.results import DiagnosisResult, DiscoveryResult, IdentificationResult
from rigsight.campaign import Campaign
from rigsight.effects import CATALOGUE, Effect
from rigsight.identify.record_identification import EstimationOptions
from rigsight.records import Record
from rigsight.rigs import Rig
from rigsight.simulate.model import Model
from rigsight.workflow.campaign.in_memory import campaign_of, effects_of
from rigsight.workflow.campaign.model_file import model_of
from rigsight.workflow.diagnose import diagnose_campaign
from rigsight.workflow.discover import discover_campaign
from rigsight.workflow.identify import checked_options, identify_campaign
from rigsight.workflow.run.kernels import checked_jobs
from rigsight.workflow.run.progress import Listener, listening
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


@dataclass(repr=False, eq=False)
class Diagnoser(CampaignEstimator):
    """Find the effect that is missing in a simulation, where it acts, and how far it closes the gap.

    Each candidate is added to the simulation and fitted to the estimation records by output error; the ranking
    is by the validation records. The same as ``rigsight diagnose``.

    Parameters
    ----------
    effects
        Candidates, by name or as declarations of your own; None for the whole catalogue.
    seed
        Seed of the resampling behind probabilities and intervals.
    n_jobs
        Candidates fitted at the same time; None for one per processor.
    verbose
        Show progress on stderr.
    rig
        Rig of the records if `fit` gets records instead of a campaign: the name of a built-in rig, or a rig of your own.

    Attributes
    ----------
    diagnosis_
        The result: verdict, ranking, gap budget.
    model_
        The diagnosed simulation, with the effects of the verdict added.

    References
    ----------
    L. Ljung, *System Identification* (Prentice Hall 1999), chapters 7 and 9, for output error and its covariance. H. R.
    Kuensch, Ann. Statist. 17 (1989) 1217, for the block bootstrap behind the probabilities.

    Examples
    --------
    A stage with a hardening spring; its given simulation has the mass, the damper and a linear spring:

    >>> import rigsight as rs
    >>> campaign = rs.example_campaign()
    >>> diagnoser = rs.Diagnoser(effects=["cubic_stiffness"], n_jobs=1).fit(campaign)
    >>> found = diagnoser.diagnosis_
    >>> found.verdict, found.effects, found.where
    ('effect', ('cubic_stiffness',), ('dynamics',))
    >>> gap = found.gap["x"]
    >>> print(f"{gap.before:.0%} given, {gap.after:.1%} with the effect, {gap.noise_floor:.1%} noise")
    123% given, 0.4% with the effect, 0.3% noise
    """

    effects: Sequence[str | Effect] | None = None
    seed: int = 0
    n_jobs: int | None = None
    verbose: bool = False
    rig: str | Rig | None = None
    diagnosis_: DiagnosisResult = field(init=False)

    def _effects(self) -> Sequence[Effect]:
        return CATALOGUE if self.effects is None else effects_of(self.effects)

    def _fit(self, campaign: Campaign, n_jobs: int, listener: Listener) -> DiagnosisResult:
        effects = self._effects()
        found = diagnose_campaign(campaign, effects, self.seed, n_jobs, listener)
        tried = None if self.effects is None else [effect.name for effect in effects]
        made_by = f"rigsight.Diagnoser(effects={tried}, seed={self.seed}).fit(...)"
        self.diagnosis_ = DiagnosisResult.of(
            found, made_by, self.seed, (*self._own_effects(), *campaign.modelled)
        )
        return self.diagnosis_


@dataclass(repr=False, eq=False)
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

    method: str = "local_rational"
    resolution: float | None = None
    n_jobs: int | None = None
    verbose: bool = False
    rig: str | Rig | None = None
    effects: Sequence[str | Effect] = ()
    seed: int = 0
    objective: str = "windows"
    initial_samples: int | None = None
    identification_: IdentificationResult = field(init=False)

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


@dataclass(repr=False, eq=False)
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

    effects: Sequence[Effect] = ()
    one_by_one: bool = False
    seed: int = 0
    n_jobs: int | None = None
    verbose: bool = False
    rig: str | Rig | None = None
    discovery_: DiscoveryResult = field(init=False)

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

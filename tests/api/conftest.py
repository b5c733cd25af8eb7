"""The example campaign, and what the estimators make of it; each is fitted once."""

from __future__ import annotations

import pytest

import rigsight as rs


@pytest.fixture(scope="session")
def campaign() -> rs.Campaign:
    """Two sweeps of a stage whose given simulation lacks a cubic spring."""
    return rs.example_campaign()


@pytest.fixture(scope="session")
def diagnoser(campaign: rs.Campaign) -> rs.Diagnoser:
    """Fitted, with one wrong candidate beside the right one."""
    return rs.Diagnoser(effects=["cubic_stiffness", "quadratic_damping"], n_jobs=1).fit(campaign)


@pytest.fixture(scope="session")
def identifier(campaign: rs.Campaign) -> rs.LinearIdentifier:
    """Fitted."""
    return rs.LinearIdentifier(n_jobs=1).fit(campaign)


@pytest.fixture(scope="session")
def discoverer(campaign: rs.Campaign) -> rs.EquationDiscoverer:
    """Fitted."""
    return rs.EquationDiscoverer(n_jobs=1).fit(campaign)


@pytest.fixture(scope="session")
def comparison(
    campaign: rs.Campaign, identifier: rs.LinearIdentifier, diagnoser: rs.Diagnoser
) -> rs.ComparisonResult:
    """The linear model beside the diagnosed one."""
    models = {"linear": identifier.model_, "diagnosed": diagnoser.model_}
    return rs.compare_models(campaign, models, n_jobs=1)

"""Diagnosis of the gap between a test rig and its simulation: where it lies, what causes it, how far it shrinks.

``import rigsight as rs`` exports the functions of the commands. Modules are loaded only when a name is used, so that the command
line starts quickly.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rigsight.api.comparing import ComparisonResult as ComparisonResult
    from rigsight.api.comparing import compare_models as compare_models
    from rigsight.api.estimators import Diagnoser as Diagnoser
    from rigsight.api.estimators import EquationDiscoverer as EquationDiscoverer
    from rigsight.api.estimators import LinearIdentifier as LinearIdentifier
    from rigsight.api.inputs import Rig as Rig
    from rigsight.api.inputs import read_record as read_record
    from rigsight.api.results import DiagnosisResult as DiagnosisResult
    from rigsight.api.results import DiscoveryResult as DiscoveryResult
    from rigsight.api.results import IdentificationResult as IdentificationResult
    from rigsight.campaign import Campaign as Campaign
    from rigsight.effects import CATALOGUE as CATALOGUE
    from rigsight.effects import Effect as Effect
    from rigsight.errors import InputError as InputError
    from rigsight.errors import RigsightError as RigsightError
    from rigsight.errors import SimulationError as SimulationError
    from rigsight.records import ColumnMapping as ColumnMapping
    from rigsight.records import Record as Record
    from rigsight.simulate.model import Model as Model
    from rigsight.workflow.campaign.in_memory import example_campaign as example_campaign
    from rigsight.workflow.campaign.in_memory import make_campaign as make_campaign
    from rigsight.workflow.campaign.in_memory import make_model as make_model
    from rigsight.workflow.campaign.model_file import read_model as read_model
    from rigsight.workflow.campaign.read_campaign import read_campaign as read_campaign
    from rigsight.workflow.own.own_effects import own_effects as own_effects
    from rigsight.workflow.simulate import simulate_model as simulate_model

_HOMES = {
    "CATALOGUE": "rigsight.effects",
    "Campaign": "rigsight.campaign",
    "ColumnMapping": "rigsight.records",
    "ComparisonResult": "rigsight.api.comparing",
    "Diagnoser": "rigsight.api.estimators",
    "DiagnosisResult": "rigsight.api.results",
    "DiscoveryResult": "rigsight.api.results",
    "Effect": "rigsight.effects",
    "EquationDiscoverer": "rigsight.api.estimators",
    "IdentificationResult": "rigsight.api.results",
    "InputError": "rigsight.errors",
    "LinearIdentifier": "rigsight.api.estimators",
    "Model": "rigsight.simulate.model",
    "Record": "rigsight.records",
    "Rig": "rigsight.api.inputs",
    "RigsightError": "rigsight.errors",
    "SimulationError": "rigsight.errors",
    "compare_models": "rigsight.api.comparing",
    "example_campaign": "rigsight.workflow.campaign.in_memory",
    "make_campaign": "rigsight.workflow.campaign.in_memory",
    "make_model": "rigsight.workflow.campaign.in_memory",
    "own_effects": "rigsight.workflow.own.own_effects",
    "read_campaign": "rigsight.workflow.campaign.read_campaign",
    "read_model": "rigsight.workflow.campaign.model_file",
    "read_record": "rigsight.api.inputs",
    "simulate_model": "rigsight.workflow.simulate",
}
"""Public name -> module that defines it."""

__all__ = sorted(_HOMES)

# Type checkers read the imports above, so that they report a name that does not exist.
if not TYPE_CHECKING:

    def __getattr__(name: str) -> object:
        from importlib import import_module

        if name not in _HOMES:
            raise AttributeError(f"module 'rigsight' has no attribute '{name}'")
        found = getattr(import_module(_HOMES[name]), name)
        # The next use finds it without this function.
        globals()[name] = found
        return found


def __dir__() -> list[str]:
    return sorted(__all__)

"""Where the gap between simulation and rig lies, which effect causes it, how far it shrinks."""

from rigsight.diagnose.candidates.placed import candidates_on as candidates_on
from rigsight.diagnose.diagnosis import diagnose as diagnose
from rigsight.diagnose.observer import structures_to_fit as structures_to_fit
from rigsight.diagnose.places.suspects import structures_of_lineup as structures_of_lineup
from rigsight.diagnose.result import Candidate as Candidate
from rigsight.diagnose.result import Diagnosis as Diagnosis
from rigsight.diagnose.task import Task as Task

__all__ = [
    "Candidate",
    "Diagnosis",
    "Task",
    "candidates_on",
    "diagnose",
    "structures_of_lineup",
    "structures_to_fit",
]

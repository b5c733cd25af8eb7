"""Where the gap between simulation and rig lies, which effect causes it, how far it shrinks."""

from rigsight.diagnose.diagnosis import Task as Task
from rigsight.diagnose.diagnosis import diagnose as diagnose
from rigsight.diagnose.result import Candidate as Candidate
from rigsight.diagnose.result import Diagnosis as Diagnosis

__all__ = ["Candidate", "Diagnosis", "Task", "diagnose"]
